"""What is drawn in a slice of the landscape: the flights' numbers, and the contours of the model's error, with labels
where these cover nothing.

Plotly's own labels would lie under the marks and numbers of the flights: it does not know of them.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Final

import numpy as np
import numpy.typing as npt

from app.core.policy import Gains
from app.core.tuning.landscape import Slice
from app.figures import theme
from app.figures.base import Trace, scatter
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


LEVELS: Final = 9
"""Approximate number of contours."""
SHOWN_SHARE: Final = 0.8
"""Share of all points covered by the scale; the rest is shaded as off the scale."""
LEGEND: Final = "contours"
_TINTS: Final = ((0.0, 0.5), (0.3, 0.26), (1.0, 0.0))
"""Strength of the colour from the bottom to the top of the scale: the lower the error, the stronger the colour."""
_LABEL_ROOM: Final = (0.024, 0.06)
"""Width of a character and height of a label, as shares of a slice's width and height."""

_Points = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Scale:
    """Contours from `low` to `high` every `step`, in the error's unit; higher values are off the scale."""

    low: float
    high: float
    step: float

    @property
    def levels(self) -> list[float]:
        return [
            round(self.low + index * self.step, 12) for index in range(round((self.high - self.low) / self.step) + 1)
        ]


def scale_of(slices: Sequence[Slice]) -> Scale:
    """Common scale of all slices: from the lowest error to the 80 % quantile of their points, in steps of 1, 2 or 5."""
    errors = np.array([error for one in slices for row in one.errors for error in row if error is not None])
    low, high = float(errors.min()), float(np.quantile(errors, SHOWN_SHARE))
    step = _nice(max(high - low, 1e-3 * max(abs(high), 1e-9)) / LEVELS)
    return Scale(low=floor(low / step) * step, high=ceil(high / step) * step, step=step)


def _nice(width: float) -> float:
    """1, 2 or 5 times a power of ten, at least `width`."""
    decade = 10.0 ** floor(log10(width))
    return next(round(factor * decade, 12) for factor in (1, 2, 5, 10) if factor * decade >= width)


def place_labels(one: Slice, scale: Scale, taken: Sequence[Box]) -> dict[str, Box]:
    """The error of each contour, and the room of that label at its point farthest from all that is `taken` and from the
    labels before it; none for a contour without a free point."""
    labels: dict[str, Box] = {}
    width, height = _LABEL_ROOM
    for level in scale.levels:
        text = f"{level:g}"
        rooms = [Box(position, (len(text) * width, height)) for position in _crossings(one, level)]
        covered = [*taken, *labels.values()]
        inside = [room for room in rooms if room.is_within_slice]
        farthest = max(inside, key=lambda room: room.clearance(covered), default=None)
        if farthest is not None and farthest.clearance(covered) > 0.0:
            labels[text] = farthest
    return labels


def _crossings(one: Slice, level: float) -> list[PlotPosition]:
    """Points where a contour crosses the lines of the slice's grid, shares of its width and height."""
    errors = np.array([[np.nan if error is None else error for error in row] for row in one.errors])
    x, y = (np.array(values) for values in (one.x_values, one.y_values))
    x, y = (x - x[0]) / (x[-1] - x[0]), (y - y[0]) / (y[-1] - y[0])
    along_rows = _crossed(errors, x, y, level)
    along_columns = _crossed(errors.T, y, x, level)[:, ::-1]
    return [(float(across), float(up)) for across, up in np.vstack((along_rows, along_columns))]


def _crossed(errors: _Points, along: _Points, line: _Points, level: float) -> _Points:
    """Where the rows of `errors` cross a level, linear between their points: position along and line, shape (n, 2)."""
    above = errors - level
    rows, columns = np.nonzero(above[:, :-1] * above[:, 1:] < 0.0)
    share = above[rows, columns] / (above[rows, columns] - above[rows, columns + 1])
    return np.column_stack((along[columns] + share * (along[columns + 1] - along[columns]), line[rows]))


def contour_traces(
    palette: theme.Palette, index: int, one: Slice, scale: Scale, unit: str, taken: Sequence[Box]
) -> Iterator[Trace]:
    """The contours, a shade over errors above the scale, and the labels, clear of what is `taken`."""
    axes = theme.on(index)
    common: dict[str, object] = axes | {
        "type": "contour",
        "x": list(one.x_values),
        "y": list(one.y_values),
        "z": [list(row) for row in one.errors],
        "showscale": False,
        "line": {"width": 0.9, "color": theme.with_opacity(palette.dim, 0.75), "smoothing": 0},
    }
    ground = common | {
        "name": "Predicted error",
        "legendgroup": LEGEND,
        "contours": {"start": scale.low, "end": scale.high, "size": scale.step, "coloring": "fill"},
        "zmin": scale.low,
        "zmax": scale.high,
        "colorscale": [[place, theme.mixed(palette.best, palette.surface, share)] for place, share in _TINTS],
        "meta": {"role": "model", "slice": index},
        "hovertemplate": f"{one.x} %{{x:.4~g}}, {one.y} %{{y:.4~g}}<br>"
        f"<b>%{{z:.4f}} {unit}</b> predicted<extra></extra>",
    }
    beyond = common | {
        "name": f"Above {scale.high:g} {unit}",
        "legendgroup": "beyond",
        "contours": {"type": "constraint", "operation": "<", "value": scale.high},  # Plotly shades where it fails
        "fillcolor": theme.mixed(palette.earlier, palette.surface, 0.4),
        "line": {"width": 0.9, "color": palette.earlier, "smoothing": 0},
        "hoverinfo": "skip",
        "meta": {"role": "beyond", "slice": index},
    }
    yield ground
    yield beyond
    yield _label_trace(palette, index, one, place_labels(one, scale, taken)) | axes


def _label_trace(palette: theme.Palette, index: int, one: Slice, labels: Mapping[str, Box]) -> Trace:
    x, y = (
        [values[0] + box.centre[axis] * (values[-1] - values[0]) for box in labels.values()]
        for axis, values in enumerate((one.x_values, one.y_values))
    )
    return scatter(
        "Labels of the contours",
        (x, y),
        role="labels",
        about={"slice": index},
        mode="text",
        legendgroup=LEGEND,
        text=list(labels),
        textfont={"size": 11, "color": palette.ink, "shadow": "auto"},
    )
