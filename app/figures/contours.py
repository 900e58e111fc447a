"""The model's error in a slice of the landscape: its contours, and their labels where these cover nothing.

Plotly's own labels would lie under the marks and numbers of the flights: it does not know of them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import ceil, floor, log10
from typing import Final

import numpy as np
import numpy.typing as npt

from app.core.tuning.landscape import Slice
from app.figures import theme
from app.figures.base import Trace, scatter
from app.figures.landscape_layout import Box, PlotPosition
from app.figures.theme import Palette

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
        count = round((self.high - self.low) / self.step)
        return [round(self.low + index * self.step, 12) for index in range(count + 1)]


@dataclass(frozen=True, slots=True)
class Label:
    """The error of a contour, and where on it that is written, as shares of the slice's width and height."""

    text: str
    position: PlotPosition

    @property
    def box(self) -> Box:
        width, height = _LABEL_ROOM
        return Box(self.position, (len(self.text) * width, height))


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


def place_labels(one: Slice, scale: Scale, taken: Sequence[Box]) -> Iterator[Label]:
    """A label for each contour, at its point farthest from all that is `taken` and from the labels before it; none for
    a contour without a free point."""
    boxes = list(taken)
    for level in scale.levels:
        text = f"{level:g}"
        candidates = [Label(text, (x, y)) for x, y in _crossings(one, level)]
        inside = [label for label in candidates if label.box.is_within_slice]
        farthest = max(inside, key=lambda label: label.box.clearance(boxes), default=None)
        if farthest is not None and farthest.box.clearance(boxes) > 0.0:
            boxes.append(farthest.box)
            yield farthest


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
    palette: Palette, index: int, one: Slice, scale: Scale, unit: str, taken: Sequence[Box]
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
    yield _label_trace(palette, index, one, list(place_labels(one, scale, taken))) | axes


def _label_trace(palette: Palette, index: int, one: Slice, labels: Sequence[Label]) -> Trace:
    x, y = (
        [values[0] + label.position[axis] * (values[-1] - values[0]) for label in labels]
        for axis, values in enumerate((one.x_values, one.y_values))
    )
    return scatter(
        "Labels of the contours",
        (x, y),
        role="labels",
        about={"slice": index},
        mode="text",
        legendgroup=LEGEND,
        text=[label.text for label in labels],
        textfont={"size": 11, "color": palette.ink, "shadow": "auto"},
    )
