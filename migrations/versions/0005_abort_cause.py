"""Why a flight was broken off, so that an operator's caution does not count against the gains."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None
release = "0.2.0"


def upgrade() -> None:
    """Of flights from before nobody knows it: they count as they did, until an operator says otherwise."""
    op.add_column("trial", sa.Column("abort_cause", sa.String(), nullable=True))


def downgrade() -> None:
    op.drop_column("trial", "abort_cause")
