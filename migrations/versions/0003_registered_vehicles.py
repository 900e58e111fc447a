"""Vehicles registered one by one, with their own settings, link, control and acts; flights that wait for a take-off."""

from typing import Any

import sqlalchemy as sa
from alembic import op
from sqlalchemy.schema import SchemaItem

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None
release = "0.2.0"

_UNDER_WAY = "state IN ('requested', 'running')"
_KEPT = ("id", "kind", "title", "is_real", "state", "safe_gains", "concern", "created_at")


def upgrade() -> None:
    name_vehicles()
    create_vehicle_act()
    for column in _flight_columns():
        op.add_column("flight", column)
    op.add_column("campaign", _json("safe_gains"))
    op.execute("""
        UPDATE campaign SET safe_gains = (SELECT safe_gains FROM vehicle WHERE vehicle.id = campaign.vehicle_id)
        WHERE definition_digest IS NOT NULL
    """)
    op.execute("UPDATE flight SET take_off_at = requested_at")


def name_vehicles() -> None:
    """Of one kind there may be several from now on; those that there are get their kind's title as their name."""
    _rebuild_vehicle(
        (*_vehicle_columns(), sa.UniqueConstraint("name", name="uq_vehicle_name")), {**_same(_KEPT), "name": "title"}
    )
    op.create_index("ix_vehicle_kind", "vehicle", ["kind"], unique=False)


def create_vehicle_act() -> None:
    op.create_table(
        "vehicle_act",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("vehicle_id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("by", sa.String(), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        _json("asked"),
        _json("read_back"),
        _json("result"),
        sa.Column("problem", sa.String(), nullable=False),
        sa.Column("worker", sa.String(), nullable=True),
        sa.Column("requested_at", sa.DateTime(), nullable=False),
        sa.Column("claimed_at", sa.DateTime(), nullable=True),
        sa.Column("finished_at", sa.DateTime(), nullable=True),
        sa.CheckConstraint(
            "kind IN ('connect', 'disconnect', 'check', 'restore', 'parameters', 'release', 'land', 'motors off', "
            "'safe gains', 'control')",
            name=op.f("ck_vehicle_act_kind"),
        ),
        sa.CheckConstraint("state IN ('requested', 'running', 'done', 'failed')", name=op.f("ck_vehicle_act_state")),
        sa.ForeignKeyConstraint(["vehicle_id"], ["vehicle.id"], name="fk_vehicle_act_vehicle_id_vehicle"),
        sa.PrimaryKeyConstraint("id", name="pk_vehicle_act"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_vehicle_act_vehicle_id", "vehicle_act", ["vehicle_id"], unique=False)
    op.create_index(
        "uq_vehicle_act_vehicle_under_way",
        "vehicle_act",
        ["vehicle_id"],
        unique=True,
        sqlite_where=sa.text(_UNDER_WAY),
        postgresql_where=sa.text(_UNDER_WAY),
    )


def downgrade() -> None:
    """Registered vehicles have no place in the older tables: it is refused, by the unique kind, where there are any."""
    op.drop_column("campaign", "safe_gains")
    for column in _flight_columns():
        op.drop_column("flight", column.name)
    op.drop_table("vehicle_act")
    _rebuild_vehicle((sa.UniqueConstraint("kind", name="uq_vehicle_kind"),), _same(_KEPT))


def _rebuild_vehicle(additions: tuple[SchemaItem, ...], values: dict[str, str]) -> None:
    """SQLite drops no constraint of a table that is there: a new one takes the rows, and then the name."""
    op.create_table(
        "vehicle_rebuilt",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("is_real", sa.Boolean(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("safe_gains", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("concern", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.CheckConstraint(
            "state IN ('disconnected', 'ready', 'staged', 'flying', 'quarantined')", name=op.f("ck_vehicle_state")
        ),
        sa.PrimaryKeyConstraint("id", name="pk_vehicle"),
        *additions,
        sqlite_autoincrement=True,
    )
    op.execute(
        f"INSERT INTO vehicle_rebuilt ({', '.join(values)}) SELECT {', '.join(values.values())} FROM vehicle"  # noqa: S608
    )
    op.drop_table("vehicle")
    op.rename_table("vehicle_rebuilt", "vehicle")


def _same(names: tuple[str, ...]) -> dict[str, str]:
    return {name: name for name in names}


def _vehicle_columns() -> tuple[sa.Column[Any], ...]:
    return (
        sa.Column("version", sa.Integer(), nullable=False, server_default="1"),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("registered", sa.Boolean(), nullable=False, server_default=sa.text("0")),
        sa.Column("options", sa.JSON(none_as_null=True), nullable=False, server_default=sa.text("'{}'")),
        _json("identity"),
        _json("held"),
        _time("held_at"),
        _json("checks"),
        _time("checked_at"),
        _text("battery"),
        sa.Column("wanted_connected", sa.Boolean(), nullable=False, server_default=sa.text("0")),
        sa.Column("operator", sa.String(), nullable=True),
        sa.Column("operator_token_hash", sa.String(), nullable=True),
        _time("operator_until"),
    )


def _flight_columns() -> tuple[sa.Column[Any], ...]:
    return (
        _text("mode", "fly"),
        _time("take_off_at"),
        _text("stand_down"),
        _json("safe_gains"),
        _json("restored"),
        _time("restored_at"),
        _text("battery"),
        sa.Column("battery_v_before", sa.Double(), nullable=True),
        sa.Column("battery_v_after", sa.Double(), nullable=True),
    )


def _json(name: str) -> sa.Column[Any]:
    return sa.Column(name, sa.JSON(none_as_null=True), nullable=True)


def _time(name: str) -> sa.Column[Any]:
    return sa.Column(name, sa.DateTime(), nullable=True)


def _text(name: str, default: str = "") -> sa.Column[Any]:
    return sa.Column(name, sa.String(), nullable=False, server_default=default)
