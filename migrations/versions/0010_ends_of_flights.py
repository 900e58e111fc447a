"""How a flight ended, in codes and names instead of sentences.

The sentences of before are in the application, because bundles and spooled records have them too; it only adds to them.
"""

from typing import Any

import sqlalchemy as sa
from alembic import op

from app.db.earlier_ends import ORIGINS, give_end, landing_of, read_end

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None
release = "0.4.0"

_JSON = sa.JSON(none_as_null=True)
_ACTIVE = ("requested", "running")
_LANDINGS = {"failed": "stayed", "cancelled": "stayed", "lost": "unknown"}

_trial = sa.table(
    "trial",
    *(sa.column(name) for name in ("id", "state", "reason", "ending", "abort_cause")),
    sa.column("settings", _JSON),
    sa.column("end", _JSON),
)
_flight = sa.table(
    "flight",
    *(sa.column(name) for name in ("id", "trial_id", "state", "problem", "stand_down")),
    *(sa.column(name, _JSON) for name in ("safe_gains", "restored", "end")),
)


def upgrade() -> None:
    """What is recognised in the words of before becomes codes; the rest stays a remark, or the trial's reason."""
    op.add_column("trial", sa.Column("end", _JSON, nullable=True))
    op.add_column("flight", sa.Column("end", _JSON, nullable=True))
    connection = op.get_bind()
    trials = {row["id"]: dict(row) for row in connection.execute(sa.select(_trial)).mappings()}
    last: dict[int, tuple[str, Any]] = {}
    for flight in connection.execute(sa.select(_flight).order_by(_flight.c.id)).mappings().all():
        end = _end_of(flight, trials[flight["trial_id"]])
        last[flight["trial_id"]] = flight["problem"], end
        stand_down = ORIGINS.get(flight["stand_down"], "operator") if flight["stand_down"] else ""
        connection.execute(_flight.update().where(_flight.c.id == flight["id"]).values(end=end, stand_down=stand_down))
    for trial in trials.values():
        if trial["id"] in last:
            text, trial["end"] = last[trial["id"]]
            trial["reason"] = "" if trial["reason"] == text else trial["reason"]
        elif trial["ending"] is not None:
            give_end(trial)
        connection.execute(
            _trial.update().where(_trial.c.id == trial["id"]).values(end=trial["end"], reason=trial["reason"])
        )
    op.drop_column("flight", "problem")


def _end_of(flight: Any, trial: Any) -> Any:
    if flight["state"] in _ACTIVE:
        return None
    gains_left = "unknown"
    if flight["restored"] is not None:
        gains_left = "safe" if flight["restored"] == flight["safe_gains"] else "other"
    landed = _LANDINGS.get(flight["state"]) or landing_of(trial["settings"])
    on_request = flight["state"] == "aborted" and trial["abort_cause"] not in {None, "limit"}
    return read_end(flight["problem"], on_request=on_request, landed=landed, gains_left=gains_left)


def downgrade() -> None:
    """The older tables have no place for codes: of the ends their remarks are kept."""
    op.add_column("flight", sa.Column("problem", sa.String(), nullable=False, server_default=""))
    connection = op.get_bind()
    for table, name in ((_flight, "problem"), (_trial, "reason")):
        for row in connection.execute(sa.select(table).where(table.c.end.is_not(None))).mappings().all():
            values = {name: row.get("reason") or " ".join(row["end"]["remarks"])}
            connection.execute(table.update().where(table.c.id == row["id"]).values(**values))
    op.drop_column("trial", "end")
    op.drop_column("flight", "end")
