"""No stored controller checks: a log is compared with the replica whenever it is analysed, and nothing is stored."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None
release = "0.5.0"


def upgrade() -> None:
    op.drop_table("controller_check")


def downgrade() -> None:
    """The table without its checks, which can be made again from their recordings."""
    op.create_table(
        "controller_check",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("file_name", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("passed", sa.Boolean(), nullable=False),
        sa.Column("result", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("checked_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_controller_check"),
        sqlite_autoincrement=True,
    )
