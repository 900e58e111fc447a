"""Shapes of failure for a person: the atlas, each drawn from a simulation, and those found in a log."""

import json
import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final, get_args

from app.core.analysis import shapes
from app.core.analysis.description import LEAST_PERIODS
from app.core.analysis.shapes import FailureShape, FoundShape
from app.figures.base import Card, card_of
from app.figures.panels import Line, Panel, PanelsFigure, Plot, Style
from app.figures.theme import ThemeName
from app.log_library.library_schemas import AtlasShape
from app.log_library.schemas import FoundShapeField, ShapeTexts

ATLAS: Final = Path(__file__).with_name("failure_shapes.json")
"""A simulated flight with each shape, which `python -m bench.failure_shapes --atlas` writes."""


_CONSTANTS: Final = {**vars(shapes), "LEAST_PERIODS": LEAST_PERIODS}
WORDS: Final[Mapping[FailureShape, ShapeTexts]] = {
    FailureShape(code): ShapeTexts(
        **{**words, "recognised": words["recognised"].format_map(_CONSTANTS).replace("%", "\u00a0%")}
    )
    for code, words in tomllib.loads(Path(__file__).with_name("failure_shapes.toml").read_text("utf-8")).items()
}
"""What is written about each shape; `found` has the numbers of a flight in their places."""

_PANELS: Final[Mapping[str, Mapping[str, tuple[str, Style]]]] = {
    "Altitude (m)": {"reference_m": ("Reference", "goal"), "altitude_m": ("Altitude", "measured")},
    "Throttle": {"assumed_1": ("Parameter for hover", "goal"), "throttle_1": ("Throttle", "measured")},
    "Acceleration (m/s²)": {"sensed_m_s2": ("Sensed acceleration", "measured")},
}
"""Panels of a figure, each with its lines by the name of the column; those without a column are not drawn."""


def fields_of(found: Sequence[FoundShape]) -> list[FoundShapeField]:
    """Shapes found in a log, in numbers."""
    return [FoundShapeField.view_of(each, code=each.shape) for each in found]


def texts_of(found: Sequence[FoundShape]) -> list[ShapeTexts]:
    """The same for a person."""
    sentences = {each.shape: _sentence(each.shape, each.numbers, each.since_s) for each in found}
    return [ShapeTexts.view_of(WORDS[shape], found=sentence) for shape, sentence in sentences.items()]


@cache
def atlas() -> tuple[AtlasShape, ...]:
    """All shapes, each with its figure."""
    traces = json.loads(ATLAS.read_text())
    return tuple(
        AtlasShape.view_of(WORDS[each], code=each, figures=_cards(plot_of(each, traces[each]))) for each in FailureShape
    )


def plot_of(shape: FailureShape, trace: Mapping[str, Any]) -> Plot:
    """The figure of a simulated flight with a shape."""
    x = tuple(round(trace["step_s"] * row, 2) for row in range(len(trace["altitude_m"])))
    panels = {
        y_title: tuple(
            Line(name=name, style=style, x=x, y=tuple(trace[column]))
            for column, (name, style) in lines.items()
            if column in trace
        )
        for y_title, lines in _PANELS.items()
    }
    return Plot(
        title=WORDS[shape].title,
        summary=_sentence(shape, trace["numbers"], trace["since_s"]),
        x_title="Time (s)",
        panels=tuple(Panel(y_title=y_title, lines=lines) for y_title, lines in panels.items() if lines),
    )


def _cards(plot: Plot) -> dict[ThemeName, Card]:
    return {theme: card_of(PanelsFigure(plot, theme_name=theme)) for theme in get_args(ThemeName)}


def _sentence(shape: FailureShape, numbers: Mapping[str, float], since_s: float) -> str:
    return WORDS[shape].found.format(**numbers, since_s=since_s).replace(" -", " −")
