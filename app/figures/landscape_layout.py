"""Positions in a slice of the landscape, and placement of the flight numbers."""

from collections.abc import Sequence
from typing import Final

from app.core.policy import Gains
from app.core.tuning.landscape import Slice
from app.figures.data import FlightData

NUMBER_ROOM: Final = (0.07, 0.075)
"""Size of a flight's number, as shares of a slice's width and height."""
_EDGE: Final = 0.03

PlotPosition = tuple[float, float]


def numbers(
    flights: Sequence[FlightData], best: FlightData | None, one: Slice, *, aside: Gains | None = None
) -> list[str]:
    """Text beside each flight: the numbers of the first, the best and the latest flight, then of those that have room.

    If those three overlap, or flights have the same position, one mark carries all their numbers. Numbers that would
    cover the mark at `aside` are omitted, except for those three.
    """
    leading = {flights[0].number, flights[-1].number, *([best.number] if best else [])}
    spots = {flight.number: spot(one, flight.gains) for flight in flights}
    covered = [] if aside is None else [spot(one, aside)]
    shared: dict[int, list[int]] = {}
    for number in sorted(spots, key=lambda number: (number not in leading, number)):
        near = next((other for other in shared if _collide(spots[number], spots[other], len(shared[other]))), None)
        if near is not None:
            if number in leading or spots[number] == spots[near]:
                shared[near].append(number)
        elif number in leading or not any(_collide(spots[number], other) for other in covered):
            shared[number] = [number]
    return [", ".join(map(str, sorted(shared.pop(flight.number, [])))) for flight in flights]


def spot(one: Slice, gains: Gains) -> PlotPosition:
    """Position of gains in a slice, as shares of its width and height."""
    x, y = (
        (gains[name] - values[0]) / (values[-1] - values[0])
        for name, values in ((one.x, one.x_values), (one.y, one.y_values))
    )
    return x, y


def number_position(one: Slice, gains: Gains, text: str) -> str:
    """Where a text of some numbers stands beside the mark at these gains, so that it lies within the slice."""
    x, y = spot(one, gains)
    width, height = (1 + text.count(",")) * NUMBER_ROOM[0], NUMBER_ROOM[1]
    across = "left" if x + width / 2 > 1.0 + _EDGE else "right" if x - width / 2 < -_EDGE else "center"
    return f"{'bottom' if y > 1.0 - height else 'top'} {across}"


def _collide(one: PlotPosition, other: PlotPosition, count: int = 1) -> bool:
    """Whether a number at `one` would overlap the `count` numbers at `other`."""
    width, height = NUMBER_ROOM
    return abs(one[0] - other[0]) < width * (1 + count) / 2 and abs(one[1] - other[1]) < height


def to_edge(one: Slice, centre: Gains, direction: Gains) -> list[Gains] | None:
    """The centre, and the point where the direction leaves the slice; None if the direction does not move within it."""
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
    """A slice's range, with room for marks on its edge."""
    room = _EDGE * (values[-1] - values[0])
    return [values[0] - room, values[-1] + room]
