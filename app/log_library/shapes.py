"""Shapes of failure for a person: the atlas, each drawn from a simulation, and those found in a log."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, get_args

from app.core.analysis import shapes
from app.core.analysis.description import LEAST_PERIODS
from app.core.analysis.shapes import FailureShape, FoundShape
from app.core.formatting import percent
from app.figures.base import Card, card_of
from app.figures.panels import Line, Panel, PanelsFigure, Plot, Style
from app.figures.theme import ThemeName
from app.log_library.library_schemas import AtlasShape
from app.log_library.schemas import FoundShapeField, ShapeTexts

ATLAS: Final = Path(__file__).with_name("failure_shapes.json")
"""A simulated flight with each shape, which `python -m bench.failure_shapes --atlas` writes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """What is written about a shape; `found` has the numbers of a flight in their places."""

    title: str
    recognised: str
    advice: str
    found: str


WORDS: Final[Mapping[FailureShape, Words]] = {
    FailureShape.RINGING: Words(
        title="Ringing altitude",
        recognised="A line stands out of the spectrum of the deviation, for "
        f"{LEAST_PERIODS:g} periods or more and with an amplitude of {shapes.LEAST_RINGING_M:g} m or more, and is not "
        "in the reference.",
        advice="Lower the gains of altitude and climb rate by a third and fly again; if it rings slowly, lower the "
        "integral gain first. Slow or late motors allow less gain. Gains with a margin follow from a log with "
        "altitude changes.",
        found="The altitude swings by ±{amplitude_m:.2f} m at {frequency_hz:.2f} Hz, from {since_s:.0f} s on.",
    ),
    FailureShape.WINDUP: Words(
        title="Integral windup after takeoff",
        recognised=f"Within {shapes.AFTER_LIFT_OFF_S:g} s of lift-off the altitude exceeds the reference by "
        f"{shapes.LEAST_OVERSHOOT_M:g} m or more, by half of that for {shapes.LEAST_OVERSHOT_S:g} s or more, and "
        f"deviates by less than {percent(shapes.REPEATED)} of it afterwards.",
        advice="Let nothing hold the vehicle on the ground, and take off without delay: the integral grows while the "
        "throttle is up and the vehicle does not move. Then check the parameter for the hover throttle and the ramp "
        "of the takeoff; a larger integral gain unwinds sooner.",
        found="After lift-off at {since_s:.0f} s the altitude exceeds the reference by {overshoot_m:.2f} m, by half "
        "of that for {lasts_s:.1f} s.",
    ),
    FailureShape.HOVER_THROTTLE: Words(
        title="Hover throttle parameter off",
        recognised="The throttle at rest differs from the parameter for it by more than "
        f"{percent(shapes.LARGEST_HOVER_DIFFERENCE)}, and by more than {shapes.SCATTERS:g} of its standard deviations.",
        advice="Set the parameter to the throttle of this log, as far as its range allows. Until then the integral "
        "makes up for the difference after every takeoff, and the loop may be stiffer or softer than its gains say.",
        found="The vehicle hovers at a throttle of {hover_throttle_1:.3f}, and the parameter is {assumed_1:.3f}.",
    ),
    FailureShape.SATURATED_CLIMB: Words(
        title="Saturated climb",
        recognised=f"The throttle is at its upper limit for {shapes.LEAST_SATURATED_S:g} s or more while the reference "
        "rises. The altitude falls behind, or the reference waits for it.",
        advice="Lower the weight, charge or change the battery, or lower the climb rate. Gains do not help: at the "
        "limit none acts, and the rate controllers lack thrust, too.",
        found="The throttle is at its limit for {at_limit_s:.1f} s of a climb, from {since_s:.0f} s on; the altitude "
        "is up to {behind_m:.2f} m behind.",
    ),
    FailureShape.ESTIMATOR_JUMP: Words(
        title="Estimator jump",
        recognised=f"From one row to the next the altitude changes by {shapes.LEAST_JUMP_M:g} m more than its rate and "
        f"{shapes.LARGEST_ACCELERATION_M_S2:g} m/s² account for, or the climb rate by {shapes.LEAST_JUMP_M_S:g} m/s "
        "more than that acceleration.",
        advice="Look for resets of barometer, GPS or range finder at this time: cover the barometer against light and "
        "propeller wash, and check the sources of altitude. The vehicle moved because its estimate did; no gain "
        "prevents it.",
        found="The estimate jumps at {since_s:.1f} s (in all: {jumps_1:.0f}×), at most by {altitude_m:+.2f} m and "
        "{climb_rate_m_s:+.2f} m/s.",
    ),
    FailureShape.VIBRATION: Words(
        title="Vibration",
        recognised=f"The sensed acceleration has noise of {shapes.LEAST_NOISE_M_S2:g} m/s² or more that neither the "
        "rows beside nor the climb rate have, as they would of a gust.",
        advice="Balance and tighten propellers and motors, and mount the flight controller softly. Do not raise gains "
        "before: the noise passes through them, and the estimate drifts.",
        found="The sensed acceleration has noise of {noise_m_s2:.1f} m/s².",
    ),
    FailureShape.WIND: Words(
        title="Wind",
        recognised="In hover, the mean throttle over a second leaves an acceleration of "
        f"{shapes.LEAST_DISTURBANCE_M_S2:g} m/s² (standard deviation) or more unexplained, and "
        f"{percent(shapes.NOT_FOLLOWED)} or more of how the vehicle accelerates.",
        advice="Compare and tune gains in calmer air, or fly more altitude changes: gusts hide what gains do. To hold "
        "the altitude better in wind takes more gain, as far as the margin allows.",
        found="Something pushes the vehicle in hover: {disturbance_m_s2:.2f} m/s² that its throttle does not explain.",
    ),
}

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
