"""Finished campaigns can be reopened for more flights."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None
release = "0.3.0"


def upgrade() -> None:
    """No campaign from before was ever reopened."""
    op.add_column("campaign", sa.Column("open_until_flight", sa.Integer(), nullable=False, server_default="0"))


def downgrade() -> None:
    op.drop_column("campaign", "open_until_flight")
