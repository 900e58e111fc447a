"""Changed settings, and staging, takeoff, unstaging and abort of flights, are acts of a vehicle too."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None
release = "0.3.0"

_OLD = (
    *("connect", "disconnect", "check", "restore", "parameters", "release", "land", "motors off"),
    *("safe gains", "control"),
)
_NEW = ("settings", "stage", "take-off", "unstage", "abort")
_UNDER_WAY = "state IN ('requested', 'running')"


def upgrade() -> None:
    """What was asked before of flights stays in the flights alone."""
    _rebuild((*_OLD, *_NEW))


def downgrade() -> None:
    """The older table has no place for these: they are deleted."""
    op.execute(f"DELETE FROM vehicle_act WHERE kind IN ({_quoted(_NEW)})")  # noqa: S608  our own names
    _rebuild(_OLD)


def _rebuild(kinds: tuple[str, ...]) -> None:
    """SQLite changes no constraint of a table that is there: a new one takes the rows, and then the name."""
    op.create_table(
        "vehicle_act_rebuilt",
        *_columns(),
        sa.CheckConstraint(f"kind IN ({_quoted(kinds)})", name=op.f("ck_vehicle_act_kind")),
        sa.CheckConstraint("state IN ('requested', 'running', 'done', 'failed')", name=op.f("ck_vehicle_act_state")),
        sa.ForeignKeyConstraint(["vehicle_id"], ["vehicle.id"], name="fk_vehicle_act_vehicle_id_vehicle"),
        sa.PrimaryKeyConstraint("id", name="pk_vehicle_act"),
        sqlite_autoincrement=True,
    )
    names = ", ".join(column.name for column in _columns())
    op.execute(f"INSERT INTO vehicle_act_rebuilt ({names}) SELECT {names} FROM vehicle_act")  # noqa: S608
    op.drop_table("vehicle_act")
    op.rename_table("vehicle_act_rebuilt", "vehicle_act")
    op.create_index("ix_vehicle_act_vehicle_id", "vehicle_act", ["vehicle_id"], unique=False)
    op.create_index(
        "uq_vehicle_act_vehicle_under_way",
        "vehicle_act",
        ["vehicle_id"],
        unique=True,
        sqlite_where=sa.text(_UNDER_WAY),
        postgresql_where=sa.text(_UNDER_WAY),
    )


def _quoted(names: tuple[str, ...]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def _columns() -> tuple[sa.Column[Any], ...]:
    return (
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("vehicle_id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        *(sa.Column(name, sa.JSON(none_as_null=True), nullable=True) for name in ("asked", "read_back", "result")),
        sa.Column("problem", sa.String(), nullable=False),
        sa.Column("worker", sa.String(), nullable=True),
        sa.Column("requested_at", sa.DateTime(), nullable=False),
        sa.Column("claimed_at", sa.DateTime(), nullable=True),
        sa.Column("finished_at", sa.DateTime(), nullable=True),
    )
