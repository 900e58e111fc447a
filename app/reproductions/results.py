"""Result of a reproduction: numbers compared with the published ones, and figures. Plain data, stored as JSON."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from app.core.records.trajectory import Samples
from app.figures.data import Curve, thinned
from app.figures.panels import Line, Plot, Style

Progress = Callable[[float, str], None]
"""Called with the share done, 0 … 1, and the current activity."""


def counted(on_progress: Progress, total: int, first: float = 0.0, last: float = 1.0) -> Callable[[str], None]:
    """To be called with each of `total` things done, which take the share from `first` to `last`."""
    done = count(1)
    return lambda doing: on_progress(first + (last - first) * next(done) / total, doing)


OVERRULE: Final = "reproduces the paper's own flights in simulation"
"""Reason recorded for flying gains that the gate refuses; not possible on a real vehicle."""

CURVE_POINTS: Final = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One number of a result.

    `measured` is the value here, `paper` the published one, `ratio` their ratio; `reference` is the target value of
    this program, if it was measured or computed beforehand. None if there is no such number. `numbers` are further
    values of the row, by name including the unit; `overruled` is the reason for flying gains that the gate refuses.
    """

    group: str
    label: str
    unit: str
    measured: float
    paper: float | None = None
    reference: float | None = None
    ratio: float | None = None
    digits: int = 4
    note: str = ""
    gains: Mapping[str, int | float] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)
    overruled: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Complete result of one reproduction; `figures` by the names in its registry entry."""

    rows: tuple[Row, ...]
    figures: Mapping[str, Plot]
    notes: tuple[str, ...] = ()


STORED: Final = TypeAdapter(Result)
"""Restores a result from its `asdict` as JSON."""


def curve(name: str, style: Style, x: Samples, y: Samples | NDArray[np.int64], *, note: str = "") -> Line:
    """A line through samples of shape (n,), thinned so that its shape and extremes are preserved."""
    near, values = thinned(Curve(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)), CURVE_POINTS)
    return Line(name=name, style=style, x=tuple(near), y=tuple(values), note=note)


def marks(name: str, style: Style, x: Samples, y: Samples) -> Line:
    """A mark for each sample of shape (n,)."""
    return Line(
        name=name,
        style=style,
        x=tuple(float(value) for value in x),
        y=tuple(round(float(value), 6) for value in y),
        marks=True,
    )
