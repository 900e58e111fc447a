"""Trust region: how far a step may go from the best flight, given how well earlier predictions held."""

from collections.abc import Sequence
from typing import Final

from app.core.definition import Flight

SHRINK: Final = 0.5
GROW: Final = 2.0


def trust_fraction(flights: Sequence[Flight]) -> float:
    """Allowed step as a share of each gain's range, at most 1, from the flights in order.

    Starts at the whole range. Halved after a flight aborted because of its gains, and after one whose error exceeds its
    predicted interval; doubled after one inside the interval. The first valid flight is ignored, because its prediction
    did not come from a calibrated model.
    """
    fraction, is_calibrated = 1.0, False
    for flight in flights:
        if flight.outcome == "aborted":
            fraction *= SHRINK if flight.against_gains else 1.0
        elif is_calibrated and flight.error is not None and (told := flight.predicted) is not None:
            if told.upper is not None and flight.error > told.upper:
                fraction *= SHRINK
            elif told.lower is not None and flight.error >= told.lower:
                fraction = min(fraction * GROW, 1.0)
        is_calibrated = is_calibrated or flight.outcome == "valid"
    return fraction
