"""Positions in a slice of the landscape, and placement of the flight numbers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.core.policy import Gains
from app.core.tuning.landscape import Slice
from app.figures.data import FlightData

NUMBER_ROOM: Final = (0.07, 0.075)
"""Size of a flight's number, as shares of a slice's width and height."""
_EDGE: Final = 0.03
_MARK: Final = (0.06, 0.07)
"""Size of the largest mark, the star, likewise."""

PlotPosition = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Box:
    """Room of something in a slice: its centre, and its width and height, as shares of the slice's."""

    centre: PlotPosition
    size: tuple[float, float]

    def clearance(self, others: Sequence["Box"]) -> float:
        """Distance to the nearest of the others along the axis where it is larger; negative if they overlap."""
        return min((self._gap(other) for other in others), default=1.0)

    def overlaps(self, other: "Box") -> bool:
        return self._gap(other) < 0.0

    def _gap(self, other: "Box") -> float:
        return max(
            abs(self.centre[axis] - other.centre[axis]) - (self.size[axis] + other.size[axis]) / 2 for axis in (0, 1)
        )

    @property
    def is_within_slice(self) -> bool:
        return all(size / 2 <= centre <= 1.0 - size / 2 for centre, size in zip(self.centre, self.size, strict=True))


def numbers(
    flights: Sequence[FlightData], best: FlightData | None, one: Slice, *, aside: Gains | None = None
) -> list[str]:
    """Text beside each flight: the numbers of the first, the best and the latest flight, then of those that have room.

    If those three overlap, or flights have the same position, one mark carries all their numbers. Numbers that would
    cover the mark at `aside` are omitted, except for those three.
    """
    leading = {flight.number for flight in (*flights[:1], *flights[-1:], *([best] if best else []))}
    gains = {flight.number: flight.gains for flight in flights}
    covered = [] if aside is None else [mark_box(one, aside)]
    shared: dict[int, list[int]] = {}
    for number in sorted(gains, key=lambda number: (number not in leading, number)):
        box = number_box(one, gains[number], str(number))
        near = next(
            (other for other in shared if box.overlaps(number_box(one, gains[other], _text(shared[other])))), None
        )
        if near is not None:
            if number in leading or spot(one, gains[number]) == spot(one, gains[near]):
                shared[near].append(number)
        elif number in leading or not any(box.overlaps(mark) for mark in covered):
            shared[number] = [number]
    return [_text(shared.pop(flight.number, [])) for flight in flights]


def _text(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, sorted(numbers)))


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
    width, height = _number_size(text)
    across = "left" if x + width / 2 > 1.0 + _EDGE else "right" if x - width / 2 < -_EDGE else "center"
    return f"{'bottom' if y > 1.0 - height else 'top'} {across}"


def number_box(one: Slice, gains: Gains, text: str) -> Box:
    """Room of the text beside the mark at these gains."""
    x, y = spot(one, gains)
    width, height = _number_size(text)
    vertical, horizontal = number_position(one, gains, text).split()
    up = {"top": 0.5, "bottom": -0.5}[vertical]
    across = {"left": -0.5, "center": 0.0, "right": 0.5}[horizontal]
    return Box((x + across * width, y + up * height), (width, height))


def mark_box(one: Slice, gains: Gains) -> Box:
    """Room of the mark at these gains."""
    return Box(spot(one, gains), _MARK)


def _number_size(text: str) -> tuple[float, float]:
    return (1 + text.count(",")) * NUMBER_ROOM[0], NUMBER_ROOM[1]


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
