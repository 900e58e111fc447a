"""Column types that SQLite lacks, and the present time."""

from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any, Final

from pydantic import TypeAdapter
from sqlalchemy import JSON, DateTime, Dialect, TypeDecorator

from app.vehicles.flight_end import FlightEnd

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
