"""Operations on log analyses: analyse an uploaded log. Nothing is stored."""

import io
from typing import Annotated, get_args

from pydantic import Field

from app.common.schemas import FigureCard, Gains, Schema, figure_card
from app.core.analysis.analysis import Analysis, Assessment, analyze
from app.core.formatting import format_gains
from app.core.records.trajectory import Samples
from app.figures.base import card_of
from app.figures.panels import Line, Panel, PanelsFigure, Plot
from app.figures.theme import ThemeName
from app.logs.ardupilot_flight import read_ardupilot_flight
from app.processes.sandbox import FILE, run_limited


class LoggedBehaviour(Schema):
    """How the altitude loop behaved in the flight."""

    duration_s: Annotated[float, Field(description="time analysed")]
    error_m: Annotated[float, Field(description="mean distance between reference and altitude")]
    largest_deviation_m: float
    reference_range_m: float
    throttle_mean: float
    saturated_share: Annotated[float, Field(description="share of the rows with the throttle at a limit")]


class EstimatedValue(Schema):
    """A fitted quantity and its standard deviation."""

    mean: float
    deviation: Annotated[float, Field(description="standard deviation")]


class EstimatedVehicle(Schema):
    """The vehicle behind the log."""

    hover_throttle: EstimatedValue
    assumed_hover_throttle: Annotated[float, Field(description="MOT_THST_HOVER in flight")]
    thrust_slope: EstimatedValue
    motor_lag_s: EstimatedValue
    drag_1_s: EstimatedValue
    residual_m_s2: Annotated[float, Field(description="acceleration that throttle and climb rate do not explain, rms")]


class AssessedGains(Schema):
    """What the model predicts for a gain set in the same manoeuvre and weather."""

    name: str
    gains: Gains
    error_m: float
    low_m: Annotated[float, Field(description="lower end of the 90 % interval of a single flight")]
    high_m: float
    activity: Annotated[float, Field(description="throttle activity relative to the gains flown")]
    margin: Annotated[
        float,
        Field(
            description="factor on the acceleration gains at which the loop rings with 30 ms more lag, on the most "
            "critical of the vehicles that the log allows; 0: less than 1, 8: at least 8"
        ),
    ]


class LogAnalysis(Schema):
    """What a log tells about the altitude control of its vehicle. `assessments` begins with the gains flown."""

    file_name: str
    answer: str
    behaviour: LoggedBehaviour
    vehicle: EstimatedVehicle
    proposed: AssessedGains | None
    insufficient: Annotated[str | None, Field(description="why nothing is proposed")]
    assessments: list[AssessedGains]
    at_limit: Annotated[list[str], Field(description="proposed gains at an end of the range that was searched")]
    parameter_file: Annotated[str | None, Field(description="the proposed gains as a ground station loads them")]
    figures: Annotated[dict[ThemeName, FigureCard], Field(description="by theme")]


def analyze_upload(content: bytes, *, name: str) -> LogAnalysis:
    """Analyse an uploaded log in a process with limits.

    Raises InputError that names what is missing or wrong.
    """
    analysis, assumed_hover_throttle = run_limited(FILE, _analyze, content, name)
    mean, deviation = analysis.estimate.mean, analysis.estimate.deviation
    values = {
        each: EstimatedValue(mean=getattr(mean, each), deviation=getattr(deviation, each))
        for each in ("hover_throttle", "thrust_slope", "motor_lag_s", "drag_1_s")
    }
    plot = _plot(analysis)
    return LogAnalysis(
        file_name=name,
        answer=analysis.answer,
        behaviour=LoggedBehaviour.model_validate(analysis.behaviour, from_attributes=True),
        vehicle=EstimatedVehicle(
            **values,
            assumed_hover_throttle=assumed_hover_throttle,
            residual_m_s2=analysis.estimate.residual_m_s2,
        ),
        proposed=None if analysis.proposed is None else _assessed(analysis.proposed),
        insufficient=analysis.insufficient,
        assessments=[_assessed(each) for each in analysis.assessments],
        at_limit=list(analysis.at_limit),
        parameter_file=analysis.parameter_file(name),
        figures={theme: figure_card(card_of(PanelsFigure(plot, theme))) for theme in get_args(ThemeName)},
    )


def _analyze(content: bytes, name: str) -> tuple[Analysis, float]:
    """The analysis, and the hover throttle that the autopilot assumed."""
    flight = read_ardupilot_flight(io.BytesIO(content), name=name)
    return analyze(flight), flight.parameters.hover_throttle


def _assessed(each: Assessment) -> AssessedGains:
    prediction = each.prediction
    return AssessedGains(
        name=each.name,
        gains=dict(each.gains),
        error_m=prediction.error_m,
        low_m=prediction.low_m,
        high_m=prediction.high_m,
        activity=each.activity,
        margin=each.margin,
    )


def _plot(analysis: Analysis) -> Plot:
    """The flight beside its prediction: altitude, deviation from the reference, throttle."""
    shown, gains = analysis.response, (analysis.proposed or analysis.assessments[0]).gains
    which = f"Predicted with the {'proposed' if analysis.proposed else 'same'} gains"
    time_s = _rounded(shown.time_s)

    def panel(y_title: str, digits: int, flown: Samples, predicted: Samples, *more: Line) -> Panel:
        lines = (
            Line(name="Flown", style="measured", x=time_s, y=_rounded(flown)),
            Line(name=which, style="model", x=time_s, y=_rounded(predicted)),
        )
        return Panel(y_title=y_title, digits=digits, lines=(*more, *lines))

    reference = Line(name="Reference", style="goal", x=time_s, y=_rounded(shown.reference_m))
    return Plot(
        title="The flight and its prediction",
        summary=f"Altitude, deviation and throttle as flown, and as predicted with {format_gains(gains)}.",
        x_title="Time in the flight (s)",
        panels=(
            panel("Altitude (m)", 2, shown.flown_m, shown.predicted_m, reference),
            panel(
                "Deviation (mm)",
                1,
                1e3 * (shown.flown_m - shown.reference_m),
                1e3 * (shown.predicted_m - shown.reference_m),
            ),
            panel("Throttle", 3, shown.flown_throttle, shown.predicted_throttle),
        ),
    )


def _rounded(values: Samples) -> tuple[float, ...]:
    return tuple(round(value, 5) for value in values.tolist())
