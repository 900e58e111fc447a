"""How far a step may go from the best flight: as far as the predictions before it held."""

from collections.abc import Sequence
from typing import Final

from app.core.definition import Flight

SHRINK: Final = 0.5
GROW: Final = 2.0


def trust_fraction(flights: Sequence[Flight]) -> float:
    """Share of each gain's range, at most 1, from the flights in their order.

    The whole range until a prediction fails. Half as much after a flight that was aborted for its gains and after one
    whose error lies above its predicted interval, twice as much after one inside it. The first valid flight says
    nothing: what foretold it was not calibrated.
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
