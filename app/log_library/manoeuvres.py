"""The answer of an ArduCopter's or PX4's log, for a person: its facts, table, notes, parameter file and figure; and
what a campaign takes of it."""

from collections.abc import Mapping, Sequence
from pathlib import PurePath
from types import MappingProxyType
from typing import Final

from app.autopilots.registry import EXPERIMENTS
from app.campaigns.schemas import Definition, LogEvidence, Start
from app.core.analysis.analysis import Analysis, Assessment
from app.core.analysis.margin import EXTRA_LAG_S, LARGEST_MARGIN, REQUIRED_MARGIN
from app.core.analysis.proposal import LARGEST_ACTIVITY
from app.core.errors import Problem, TrajectoryError
from app.core.experiments.copter_steps import CopterSteps, vector_of
from app.core.formatting import format_gains, percent
from app.core.records.trajectory import Samples
from app.figures.panels import Line, Panel, Plot
from app.log_library.library_schemas import LogNumbers
from app.log_library.schemas import (
    EstimatedValue,
    EstimatedVehicle,
    Facts,
    GainsInManoeuvre,
    ManoeuvreNumbers,
    ParameterFile,
    PartTexts,
    ReasonField,
    TextTable,
    TuningAnswer,
)

_STEPS: Final[Mapping[str, CopterSteps]] = MappingProxyType(
    {each.autopilot: each for each in EXPERIMENTS.values() if isinstance(each, CopterSteps)}
)
_LEAST_SPREAD: Final = 0.01
_FITTED: Final = ("hover_throttle", "thrust_slope", "motor_lag_s", "drag_1_s")


def answer_of(analysis: Analysis, file_name: str, assumed: Sequence[str]) -> tuple[TuningAnswer, PartTexts]:
    """The answer in numbers, and for a person; `assumed` are the parameters that the log lacks, for which the
    firmware's defaults were assumed."""
    content, why = analysis.parameter_file(file_name), analysis.why_none
    name = f"{PurePath(file_name).stem}{analysis.loop.texts.parameter_suffix}"
    answer = TuningAnswer(
        grade=analysis.grade,
        reasons=[] if why is None else [ReasonField.view_of(why.problem)],
        proposes=analysis.proposed is not None,
        starts_campaign=bool(_starting_gains(analysis)),
        experiment=_STEPS[analysis.loop.texts.autopilot].name,
        numbers=_numbers(analysis, assumed),
    )
    texts = PartTexts(
        answer=analysis.answer,
        facts=[Facts(title="Flight", values=_flight(analysis)), Facts(title="Vehicle", values=_vehicle(analysis))],
        table=_table(analysis),
        notes=_notes(analysis, assumed),
        parameter_file=None if content is None else ParameterFile(name=name, content=content),
    )
    return answer, texts


def listed_numbers(analysis: Analysis) -> LogNumbers:
    """Those for lists."""
    flown, mean, deviation = analysis.assessments[0], analysis.estimate.mean, analysis.estimate.deviation
    return LogNumbers(
        hover_throttle=EstimatedValue(mean=mean.hover_throttle, deviation=deviation.hover_throttle),
        thrust_slope=EstimatedValue(mean=mean.thrust_slope, deviation=deviation.thrust_slope),
        deviation_m=analysis.behaviour.error_m,
        activity=flown.prediction.activity,
        margin=flown.margin,
        gains=dict(flown.gains),
    )


def plot_of(analysis: Analysis) -> Plot:
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
    flown_mm, predicted_mm = (1e3 * (each - shown.reference_m) for each in (shown.flown_m, shown.predicted_m))
    return Plot(
        title="The flight and its prediction",
        summary=f"Altitude, deviation and throttle as flown, and as predicted with {format_gains(gains)}.",
        x_title="Time in the flight (s)",
        panels=(
            panel("Altitude (m)", 2, shown.flown_m, shown.predicted_m, reference),
            panel("Deviation (mm)", 1, flown_mm, predicted_mm),
            panel("Throttle", 3, shown.flown_throttle, shown.predicted_throttle),
        ),
    )


def _vehicle(analysis: Analysis) -> list[str]:
    estimate, loop = analysis.estimate, analysis.loop
    assumed, parameter = loop.assumed_hover_throttle, loop.texts.hover_parameter
    mean, deviation = estimate.mean, estimate.deviation
    return [
        f"hover throttle {mean.hover_throttle:.3f}"
        + (f", but {parameter} was {assumed:.3f}" if analysis.hover else ""),
        f"thrust slope {mean.thrust_slope:.2f} ± {max(deviation.thrust_slope, _LEAST_SPREAD):.2f}",
        f"motor lag {1e3 * mean.motor_lag_s:.0f} ± {1e3 * deviation.motor_lag_s:.0f} ms",
        f"drag {mean.drag_1_s:.2f} ± {max(deviation.drag_1_s, _LEAST_SPREAD):.2f} 1/s",
        f"{estimate.residual_m_s2:.2f} m/s² of acceleration unexplained",
    ]


def _numbers(analysis: Analysis, assumed: Sequence[str]) -> ManoeuvreNumbers:
    mean, deviation = analysis.estimate.mean, analysis.estimate.deviation
    values = {each: EstimatedValue(mean=getattr(mean, each), deviation=getattr(deviation, each)) for each in _FITTED}
    return ManoeuvreNumbers.view_of(
        analysis,
        vehicle=EstimatedVehicle(
            **values,
            assumed_hover_throttle=analysis.loop.assumed_hover_throttle,
            residual_m_s2=analysis.estimate.residual_m_s2,
        ),
        assessments=[_assessed(each) for each in analysis.assessments],
        proposed=None if analysis.proposed is None else _assessed(analysis.proposed),
        assumed=list(assumed),
    )


def _flight(analysis: Analysis) -> list[str]:
    behaviour = analysis.behaviour
    return [
        f"{behaviour.duration_s:.0f} s analysed",
        f"reference moves by {behaviour.reference_range_m:.1f} m",
        f"mean deviation {_mm(behaviour.error_m)}, maximum {_mm(behaviour.largest_deviation_m)}",
        f"mean throttle {behaviour.throttle_mean:.3f}",
        *(
            [f"throttle at a limit in {percent(behaviour.saturated_share)} of the samples"]
            * (behaviour.saturated_share > 0.0)
        ),
    ]


def _table(analysis: Analysis) -> TextTable:
    flown, *others = analysis.assessments
    listed = [flown, *([analysis.proposed] if analysis.proposed else []), *others]
    names = [name.removeprefix(analysis.loop.texts.prefix) for name in flown.gains]
    return TextTable(
        title="This flight with other gains",
        columns=["Gains", *names, "Predicted error", "90 % interval", "Throttle activity", "Margin"],
        rows=[_row(each) for each in listed],
    )


def _row(each: Assessment) -> list[str]:
    low, high = each.prediction.low_m, each.prediction.high_m
    return [
        each.name,
        *(f"{value:g}" for value in each.gains.values()),
        _mm(each.prediction.error_m),
        f"{1e3 * low:.1f} … {_mm(high)}",
        f"{each.activity:.2f}",
        margin_text(each.margin),
    ]


def margin_text(margin: float) -> str:
    """A margin as in a table."""
    return "< 1" if not margin else f"{margin:.1f}" if margin < LARGEST_MARGIN else f"> {LARGEST_MARGIN:g}"


def _notes(analysis: Analysis, assumed: Sequence[str]) -> list[str]:
    texts = analysis.loop.texts
    late = f", with {1e3 * EXTRA_LAG_S:.0f} ms of extra {texts.lateness}; a proposal has at least {REQUIRED_MARGIN:g}."
    hover = analysis.hover
    but_hover = f" but {hover.parameter}" if hover is not None and hover.is_outside else ""
    return [
        *([] if hover is None else [hover.reason]),
        f"Errors are predicted for the same manoeuvre and weather, with all other parameters{but_hover} as flown.",
        f"Throttle activity is relative to the gains flown; a proposal has at most {LARGEST_ACTIVITY:g}.",
        f"The margin is the factor by which {texts.fast_gains} can be raised before the loop rings{late}",
        *(
            [f"At the limit of the search range, which is the documented range: {', '.join(analysis.at_limit)}."]
            if analysis.at_limit
            else []
        ),
        *([_LOAD] if analysis.proposed else []),
        *([f"Not in the log, and assumed to have the firmware's default: {', '.join(assumed)}."] if assumed else []),
    ]


_LOAD: Final = "Load the gains on the ground. Fly them first at a safe height, ready to take over."


def _assessed(each: Assessment) -> GainsInManoeuvre:
    prediction = each.prediction
    return GainsInManoeuvre.view_of(each, error_m=prediction.error_m, low_m=prediction.low_m, high_m=prediction.high_m)


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.1f} mm"


def _rounded(values: Samples) -> tuple[float, ...]:
    return tuple(round(value, 5) for value in values.tolist())


def _starting_gains(analysis: Analysis) -> dict[str, float]:
    """The proposed gains by the names of the loop; none if campaigns do not fly those of the vehicle's release."""
    experiment = _STEPS[analysis.loop.texts.autopilot]
    gains = {} if analysis.proposed is None else experiment.loop_parameters(analysis.proposed.gains)
    return gains if gains.keys() >= analysis.loop.gains.keys() else {}


def start_of(analysis: Analysis, file_name: str) -> Definition:
    """The definition of a campaign that starts with the proposed gains. Raises TrajectoryError if the analysis proposes
    none that a campaign flies."""
    proposed = _starting_gains(analysis)
    if not proposed:
        raise TrajectoryError(
            f"No campaign starts from {file_name}.",
            hint=analysis.answer,
            problems=(Problem("file", "gives no better gains for a campaign to begin with"),),
        )
    experiment = _STEPS[analysis.loop.texts.autopilot]
    parameters = analysis.loop.firmware_parameters
    space = experiment.space
    mean, deviation = (vector_of(each).tolist() for each in (analysis.estimate.mean, analysis.estimate.deviation))
    gains = space.mapping(space.nearest(space.vector({name: parameters[name] for name in space.names} | proposed)))
    log = LogEvidence(
        file_name=file_name,
        error_m=analysis.behaviour.error_m,
        vehicle={
            each.name: (min(max(value, each.lower), each.upper), spread)
            for each, value, spread in zip(experiment.model_parameters, mean, deviation, strict=True)
        },
        parameters=parameters,
    )
    return Definition(experiment=experiment.name, start=Start(kind="given", gains=gains, log=log))
