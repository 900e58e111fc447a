"""Analysed logs, kept as flights of a vehicle."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None
release = "0.7.0"


def upgrade() -> None:
    op.create_table(
        "logged_vehicle",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("hardware_id", sa.String(), nullable=True),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_logged_vehicle"),
        sa.UniqueConstraint("name", name="uq_logged_vehicle_name"),
        sa.UniqueConstraint("hardware_id", name="uq_logged_vehicle_hardware_id"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "analysed_log",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("vehicle_id", sa.Integer(), nullable=True),
        sa.Column("digest", sa.String(), nullable=False),
        sa.Column("file_digest", sa.String(), nullable=False),
        sa.Column("file_name", sa.String(), nullable=False),
        sa.Column("autopilot", sa.String(), nullable=False),
        sa.Column("grade", sa.String(), nullable=False),
        sa.Column("hardware_id", sa.String(), nullable=False),
        sa.Column("vehicle_name", sa.String(), nullable=False),
        sa.Column("program", sa.String(), nullable=False),
        sa.Column("flown_at", sa.DateTime(), nullable=True),
        sa.Column("analysed_at", sa.DateTime(), nullable=False),
        sa.Column("ordered_at", sa.DateTime(), nullable=False),
        sa.Column("numbers", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("fit", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("answer", sa.LargeBinary(), nullable=False),
        sa.Column("flight", sa.LargeBinary(), nullable=True),
        sa.Column("file_bytes", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(["vehicle_id"], ["logged_vehicle.id"], name="fk_analysed_log_vehicle_id"),
        sa.PrimaryKeyConstraint("id", name="pk_analysed_log"),
        sa.UniqueConstraint("digest", name="uq_analysed_log_digest"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_analysed_log_vehicle_id_ordered_at", "analysed_log", ["vehicle_id", "ordered_at"])
    op.create_table(
        "log_file",
        sa.Column("log_id", sa.Integer(), nullable=False),
        sa.Column("content", sa.LargeBinary(), nullable=False),
        sa.Column("companion", sa.LargeBinary(), nullable=True),
        sa.ForeignKeyConstraint(["log_id"], ["analysed_log.id"], name="fk_log_file_log_id", ondelete="CASCADE"),
        sa.PrimaryKeyConstraint("log_id", name="pk_log_file"),
    )


def downgrade() -> None:
    """Kept logs are lost."""
    op.drop_table("log_file")
    op.drop_table("analysed_log")
    op.drop_table("logged_vehicle")
