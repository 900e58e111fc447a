"""Queries of the flight history, shared by strategies."""

from collections.abc import Sequence

from app.core.definition import Flight
from app.core.policy import Gains


def best_flight(flights: Sequence[Flight]) -> Flight:
    """The valid flight with the lowest error, the earliest of equals. At least one flight must be valid."""
    return min(
        (flight for flight in flights if flight.error is not None and flight.outcome == "valid"),
        key=lambda flight: (flight.error, flight.number),
    )


def was_flown(gains: Gains, flights: Sequence[Flight]) -> bool:
    """Whether these gains were flown before, to the end or until an abort that counts against them."""
    return any(
        dict(flight.gains) == dict(gains) for flight in flights if flight.outcome == "valid" or flight.against_gains
    )


def format_gains(gains: Gains) -> str:
    """`kp 283, ki 13, kd 82`."""
    return ", ".join(f"{name} {value:g}" for name, value in gains.items())
