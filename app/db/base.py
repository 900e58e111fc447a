"""What the tables have in common: naming, states, ids, types that SQLite lacks, the time, the report of changes."""

import enum
from collections.abc import Iterable
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, ClassVar, Final, Literal, TypeVar

from pydantic import TypeAdapter
from sqlalchemy import JSON, CheckConstraint, DateTime, Dialect, Enum, MetaData, TypeDecorator
from sqlalchemy.orm import DeclarativeBase, Mapped, Session, mapped_column

from app.common.errors import NotFoundError
from app.vehicles.flight_end import FlightEnd

Topic = Literal["campaign", "trial", "proposal", "job", "flight", "vehicle"]


JsonObject = dict[str, Any]
GainsJson = dict[str, float]
OptionsJson = dict[str, bool | int | float | str]

FLIGHT_END: Final = TypeAdapter(FlightEnd)
"""Reads what `asdict` made of the end of a flight."""


def utc_now() -> datetime:
    return datetime.now(UTC)


class FlightEndJson(TypeDecorator[FlightEnd]):
    """How a flight ended, stored as JSON."""

    impl = JSON(none_as_null=True)
    cache_ok = True

    def process_bind_param(self, value: FlightEnd | None, _dialect: Dialect) -> dict[str, Any] | None:
        return None if value is None else asdict(value)

    def process_result_value(self, value: dict[str, Any] | None, _dialect: Dialect) -> FlightEnd | None:
        return None if value is None else FLIGHT_END.validate_python(value)


class UtcDateTime(TypeDecorator[datetime]):
    """An instant: timezone-aware in Python, stored as UTC. A naive time is refused because it is ambiguous."""

    impl = DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        if value.tzinfo is None:
            raise ValueError("a time without a zone cannot be stored")
        return value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, _dialect: Dialect) -> datetime | None:
        return None if value is None else value.replace(tzinfo=UTC)


_JSON: Final = JSON(none_as_null=True)
_STATE: Final = Enum(
    enum.Enum, native_enum=False, length=20, values_callable=lambda every: [state.value for state in every]
)
"""A state is stored as text; the check is a separate constraint, so that a migration can change it."""
NEVER_REUSE_IDS: Final = {"sqlite_autoincrement": True}
"""Otherwise SQLite gives a deleted row's id to the next one, and an open page would show the wrong row."""


class Base(DeclarativeBase):
    metadata = MetaData(
        naming_convention={
            "ix": "ix_%(table_name)s_%(column_0_N_name)s",
            "uq": "uq_%(table_name)s_%(column_0_N_name)s",
            "ck": "ck_%(table_name)s_%(constraint_name)s",
            "fk": "fk_%(table_name)s_%(column_0_name)s_%(referred_table_name)s",
            "pk": "pk_%(table_name)s",
        }
    )
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


def existing(session: Session, kind: type[R], identity: int, what: str) -> R:
    """The row with that id. Raises NotFoundError, which says `what` there is none of."""
    if (row := session.get(kind, identity)) is None:
        raise NotFoundError(what, identity)
    return row


def added(session: Session, row: R) -> R:
    """Add a row to the database and return it, with its id and defaults."""
    session.add(row)
    session.flush()
    return row
