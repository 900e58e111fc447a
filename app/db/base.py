"""What the tables have in common: naming, types, states, ids, and the publication of changes."""

import enum
from collections.abc import Iterable
from datetime import datetime
from typing import Any, ClassVar, Final, Literal, TypeVar

from sqlalchemy import JSON, CheckConstraint, Enum, MetaData
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column

from app.db.types import FlightEndJson, GainsJson, JsonObject, OptionsJson, UtcDateTime
from app.vehicles.flight_end import FlightEnd

Topic = Literal["campaign", "trial", "proposal", "job", "flight", "vehicle"]

NAMING: Final = {
    "ix": "ix_%(table_name)s_%(column_0_N_name)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
    "pk": "pk_%(table_name)s",
}


_JSON: Final = JSON(none_as_null=True)
_STATE: Final = Enum(
    enum.Enum, native_enum=False, length=20, values_callable=lambda every: [state.value for state in every]
)
"""A state is stored as text; the check is a separate constraint, so that a migration can change it."""
NEVER_REUSE_IDS: Final = {"sqlite_autoincrement": True}
"""Otherwise SQLite gives a deleted row's id to the next one, and an open page would show the wrong row."""


class Base(DeclarativeBase):
    metadata = MetaData(naming_convention=NAMING)
    type_annotation_map = {  # noqa: RUF012 - SQLAlchemy reads it from the class
        datetime: UtcDateTime,
        enum.StrEnum: _STATE,
        FlightEnd: FlightEndJson,
        JsonObject: _JSON,
        GainsJson: _JSON,
        OptionsJson: _JSON,
        list[str]: _JSON,
        list[list[float]]: _JSON,
        list[JsonObject]: _JSON,
    }


def is_one_of(column: str, states: Iterable[enum.StrEnum]) -> str:
    return f"{column} IN ({', '.join(repr(state.value) for state in states)})"


def state_check(states: type[enum.StrEnum], *, column: str = "state") -> CheckConstraint:
    return CheckConstraint(is_one_of(column, states), name=column)


class Numbered:
    """A row with an id of its own, which is never used again."""

    __table_args__: Any = NEVER_REUSE_IDS

    id: Mapped[int] = mapped_column(primary_key=True)


class Reported(Numbered):
    """A row whose changes are published to the browsers, under its `topic`."""

    topic: ClassVar[Topic]

    def reported_as(self) -> tuple[Topic, int, int | None]:
        """Topic, the row's id, and the campaign that it belongs to."""
        return self.topic, self.id, getattr(self, "campaign_id", None)


R = TypeVar("R", bound=Base)


def added(session: Session, row: R) -> R:
    """Add a row to the database and return it, with its id and defaults."""
    session.add(row)
    session.flush()
    return row
