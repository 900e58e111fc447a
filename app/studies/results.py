"""What a reproduction comes to: numbers beside the published ones, and figures to draw. Plain data, kept as JSON."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from app.core.trajectory import Samples
from app.figures.panels import Line, Plot, Style
from app.figures.scale import thinned

Progress = Callable[[float, str], None]
"""Told the share that is done, 0 … 1, and what is being done."""

OVERRULE: Final = "reproduces the paper's own flights in simulation"
"""Why gains that the gate refuses are flown all the same; on a real vehicle nobody could."""

CURVE_POINTS: Final = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One number: `measured` here, `paper` as published, `ratio` of the two; `reference` is what this program is held
    to, where it was measured or worked out beforehand. None where there is no such number.

    `numbers` are further figures of the same row by name with their unit in it; `overruled` says why gains were flown
    that the gate refuses.
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
    gains: Mapping[str, float] = field(default_factory=dict)
    numbers: Mapping[str, float] = field(default_factory=dict)
    overruled: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Everything that one reproduction found; `figures` by their name in its registry entry."""

    rows: tuple[Row, ...]
    figures: Mapping[str, Plot]
    notes: tuple[str, ...] = ()

    def as_json(self) -> dict[str, object]:
        return asdict(self)


_RESULT: Final = TypeAdapter(Result)


def result_from_json(document: object) -> Result:
    """What `as_json` made, back again. Raises ValueError for anything else."""
    return _RESULT.validate_python(document)


def ratio(measured: float, paper: float | None) -> float | None:
    return None if not paper else measured / paper


def curve(
    name: str, style: Style, x: Samples, y: Samples | NDArray[np.int64], *, note: str = "", points: int = CURVE_POINTS
) -> Line:
    """A line through samples of shape (n,), thinned so that it keeps its look and its extremes."""
    near, values = thinned(np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64), points)
    return Line(name=name, style=style, x=tuple(near), y=tuple(values), note=note)


def marks(name: str, style: Style, x: Samples, y: Samples, *, note: str = "") -> Line:
    """A mark for each of the samples of shape (n,)."""
    return Line(
        name=name,
        style=style,
        x=tuple(float(value) for value in x),
        y=tuple(round(float(value), 6) for value in y),
        marks=True,
        note=note,
    )
