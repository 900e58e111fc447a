"""Where things lie in a slice of the landscape, and which flights bear their number there."""

from collections.abc import Sequence
from typing import Final

from app.core.landscape import Slice
from app.core.policy import Gains
from app.figures.history import FlightData

NUMBER_ROOM: Final = (0.07, 0.075)
"""A flight's number takes this share of a slice's width and of its height."""
_EDGE: Final = 0.03

PlotPosition = tuple[float, float]


def numbers(
    flights: Sequence[FlightData], best: FlightData | None, one: Slice, *, aside: Gains | None = None
) -> list[str]:
    """What stands beside each flight: the first, the best and the latest flight's number, then those that have room.

    Where those three, or flights of one place, are together, one mark bears all their numbers. What lies at `aside`
    covers a number, so that only those three may be there.
    """
    leading = {flights[0].number, flights[-1].number, *([best.number] if best else [])}
    spots = {flight.number: spot(one, flight.gains) for flight in flights}
    covered = [] if aside is None else [spot(one, aside)]
    told: dict[int, list[int]] = {}
    for number in sorted(spots, key=lambda number: (number not in leading, number)):
        near = next((other for other in told if _collide(spots[number], spots[other], len(told[other]))), None)
        if near is not None:
            if number in leading or spots[number] == spots[near]:
                told[near].append(number)
        elif number in leading or not any(_collide(spots[number], other) for other in covered):
            told[number] = [number]
    return [", ".join(map(str, sorted(told.pop(flight.number, [])))) for flight in flights]


def spot(one: Slice, gains: Gains) -> PlotPosition:
    """Where gains lie in a slice, as shares of its width and height."""
    x, y = (
        (gains[name] - values[0]) / (values[-1] - values[0])
        for name, values in ((one.x, one.x_values), (one.y, one.y_values))
    )
    return x, y


def is_high(one: Slice, gains: Gains) -> bool:
    """Whether a number above these gains would be cut off at the slice's top."""
    return spot(one, gains)[1] > 1.0 - NUMBER_ROOM[1]


def _collide(one: PlotPosition, other: PlotPosition, count: int = 1) -> bool:
    """Whether a number at `one` would touch the `count` numbers at `other`."""
    width, height = NUMBER_ROOM
    return abs(one[0] - other[0]) < width * (1 + count) / 2 and abs(one[1] - other[1]) < height


def to_edge(one: Slice, centre: Gains, direction: Gains) -> list[Gains] | None:
    """The centre, and where the direction leaves the slice; None where it does not lead anywhere in it."""
    lengths = []
    for name, values in ((one.x, one.x_values), (one.y, one.y_values)):
        if slope := direction.get(name, 0.0):
            edge = values[-1] if slope > 0.0 else values[0]
            lengths.append((edge - centre[name]) / slope)
    if not lengths or min(lengths) <= 0.0:
        return None
    return [centre, {name: value + min(lengths) * direction.get(name, 0.0) for name, value in centre.items()}]


def holds(one: Slice, gains: Gains) -> bool:
    return all(
        values[0] <= gains[name] <= values[-1] for name, values in ((one.x, one.x_values), (one.y, one.y_values))
    )


def padded(values: Sequence[float]) -> list[float]:
    """A slice's range, with room for marks that stand on its edge."""
    room = _EDGE * (values[-1] - values[0])
    return [values[0] - room, values[-1] + room]
