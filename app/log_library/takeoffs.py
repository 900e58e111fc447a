"""The answer of a log of takeoffs under Paparazzi, for a person: its facts, table, notes, airframe section, figure."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from app.autopilots.registry import TUNED
from app.autopilots.takeoffs import NOT_COMMANDED, Takeoff
from app.core.analysis.analysis import Grade
from app.core.errors import Problem, TrajectoryError
from app.core.experiments.takeoff import Takeoff as Experiment
from app.core.formatting import count, format_gains, number, plus_minus
from app.core.reasons import Reason, ReasonCode
from app.core.records.trajectory import Trajectory
from app.core.tuning.logged_takeoffs import AssessedGains, LoggedTakeoff, TakeoffAnalysis
from app.figures.data import Curve, thinned
from app.figures.panels import Line, Panel, Plot, Style
from app.log_library.library_schemas import LogNumbers
from app.log_library.schemas import (
    Facts,
    GainsInTakeoff,
    ParameterFile,
    PartTexts,
    ReasonField,
    TakeoffNumbers,
    TextTable,
    TuningAnswer,
)

_IDENTIFIED_SHARE: Final = 0.5
"""A log identifies a parameter whose standard error is less than this share of the prior's."""
_FORMAT: Final = TUNED[Experiment.name].parameter_file
_SHOWN_S: Final = 8.0
_POINTS: Final = 1500


def logged_takeoffs(found: Sequence[Takeoff], *, name: str) -> list[LoggedTakeoff]:
    """The takeoffs whose command and gains the log contains. Raises TrajectoryError if there is none."""
    known = [
        LoggedTakeoff(number=each.number, gains=each.gains, trajectory=each.trajectory)
        for each in found
        if each.is_commanded and each.gains
    ]
    if not known:
        without_gains = f"does not contain the values of {', '.join(Experiment.space.names)}"
        is_commanded = any(each.is_commanded for each in found)
        raise TrajectoryError(
            f"{name} cannot be analysed.",
            hint="Add the .log file of the same name to Paparazzi's .data file; start a telemetry log before the "
            "ground station connects.",
            problems=(Problem("file", without_gains if is_commanded else NOT_COMMANDED),),
        )
    return known


def answer_of(analysis: TakeoffAnalysis, file_name: str) -> tuple[TuningAnswer, PartTexts]:
    """The answer in numbers, and for a person."""
    proposes = analysis.proposed is not None
    why = [] if proposes else [ReasonField.view_of(Reason(code=ReasonCode.NONE_BETTER).problem)]
    texts = PartTexts(
        answer=analysis.answer,
        facts=[Facts(title="Flight", values=_flight(analysis)), Facts(title="Vehicle", values=_vehicle(analysis))],
        table=_table(analysis),
        notes=_notes(analysis),
        parameter_file=_airframe_section(analysis, file_name),
    )
    numbers = _numbers(analysis)
    return TuningAnswer(grade=Grade.FULL, reasons=why, proposes=proposes, starts_campaign=True, numbers=numbers), texts


def listed_numbers(analysis: TakeoffAnalysis) -> LogNumbers:
    """Those for lists, of the best takeoff."""
    return LogNumbers(deviation_m=analysis.best.error, gains=dict(analysis.best.gains))


def plot_of(analysis: TakeoffAnalysis) -> Plot:
    """The best takeoff beside its prediction: altitude, and deviation from 3 m."""
    gains = (analysis.proposed or analysis.assessments[0]).gains
    best, predicted = analysis.best.trajectory, analysis.predicted
    goal_m = float(Experiment().set_point(best.time_s[-1:])[0])
    which = f"Predicted with the {'proposed' if analysis.proposed else 'same'} gains"

    def line(name: str, style: Style, record: Trajectory, offset_m: float) -> Line:
        shown = (record.time_s >= 0.0) & (record.time_s <= analysis.window_s)
        x, y = thinned(Curve(record.time_s[shown], record["altitude_m"][shown] - offset_m), _POINTS)
        return Line(name=name, style=style, x=tuple(x), y=tuple(y))

    def lines(offset_m: float) -> tuple[Line, ...]:
        return line("Flown", "measured", best, offset_m), line(which, "model", predicted, offset_m)

    goal = Line(name="Set point", style="goal", x=(0.0, analysis.window_s), y=(goal_m, goal_m))
    return Plot(
        title="The takeoff and its prediction",
        summary=f"Altitude and deviation from {goal_m:g} m as flown, and as predicted with {format_gains(gains)}.",
        x_title="Time since the command (s)",
        panels=(
            Panel(y_title="Altitude (m)", digits=2, lines=(goal, *lines(0.0))),
            Panel(y_title="Deviation (m)", digits=3, y_range=(-0.25, 0.25), lines=lines(goal_m)),
        ),
        x_range=(0.0, min(_SHOWN_S, analysis.window_s)),
    )


def _airframe_section(analysis: TakeoffAnalysis, file_name: str) -> ParameterFile | None:
    """The proposed gains as a section of an airframe file; None without a proposal."""
    if analysis.proposed is None:
        return None
    heading = f"Gainline, from {file_name}. Fly first with free space, ready to take over."
    content = _FORMAT.content(heading, analysis.assessments[0].gains, analysis.proposed.gains)
    return ParameterFile(name=f"{PurePath(file_name).stem}{_FORMAT.suffix}", content=content)


def _flight(analysis: TakeoffAnalysis) -> list[str]:
    error = f"mean distance from 3 m {number(analysis.best.error)} m"
    facts = [
        f"{count(len(analysis.numbers), 'takeoff')} analysed over {analysis.window_s:g} s",
        error if len(analysis.numbers) == 1 else f"{error} in the best, number {analysis.best.number}",
    ]
    response = analysis.response
    if response is None:
        return facts
    settling_s = response.settling_time_s
    return [
        *facts,
        f"rise time {number(response.rise_time_s, 2)} s",
        "did not settle" if settling_s is None else f"settling time {number(settling_s, 2)} s",
        f"overshoot {number(response.overshoot, 2)} m",
        f"steady-state error {number(response.steady_state_error)} m",
    ]


def _vehicle(analysis: TakeoffAnalysis) -> list[str]:
    identified = [each for each in analysis.fitted if each.standard_error < _IDENTIFIED_SHARE * each.prior_sd]
    return [
        *(f"{each.title.lower()} {plus_minus(each.value, each.standard_error, each.unit)}" for each in identified),
        f"{analysis.residual_m:.3f} m of altitude unexplained",
    ]


def _table(analysis: TakeoffAnalysis) -> TextTable:
    flown, *others = analysis.assessments
    listed = [flown, *([analysis.proposed] if analysis.proposed else []), *others]
    return TextTable(
        title="The takeoff with other gains",
        columns=["Gains", *flown.gains, "Flown", "Predicted", "90 % interval", "Gate"],
        rows=[
            [
                each.name,
                *(f"{value:g}" for value in each.gains.values()),
                f"{number(each.flown_error_m)} m" if each.flown_error_m is not None else number(None),
                f"{number(each.predicted_error_m)} m",
                f"{number(each.interval.lower)} … {number(each.interval.upper)} m",
                "refused" if each.refusal else "passed",
            ]
            for each in listed
        ],
    )


def _notes(analysis: TakeoffAnalysis) -> list[str]:
    refused = [each for each in analysis.assessments if each.refusal]
    return [
        f"Errors are the mean distance from 3 m in the first {analysis.window_s:g} s of a takeoff to 3 m.",
        *(f"The gate refuses {format_gains(each.gains)}: {each.refusal}" for each in refused),
        *([_LOAD] if analysis.proposed else []),
    ]


_LOAD: Final = (
    "Set the gains in the airframe file or in the ground station's settings, on the ground. Fly them first with free "
    "space around, ready to take over."
)


def _numbers(analysis: TakeoffAnalysis) -> TakeoffNumbers:
    response = analysis.response
    return TakeoffNumbers.view_of(
        analysis,
        takeoffs=list(analysis.numbers),
        best=analysis.best.number,
        error_m=analysis.best.error or 0.0,
        rise_time_s=None if response is None else response.rise_time_s,
        settling_time_s=None if response is None else response.settling_time_s,
        overshoot_m=None if response is None else response.overshoot,
        steady_state_error_m=None if response is None else response.steady_state_error,
        vehicle=analysis.fitted,
        assessments=[_assessed(each) for each in analysis.assessments],
        proposed=None if analysis.proposed is None else _assessed(analysis.proposed),
    )


def _assessed(each: AssessedGains) -> GainsInTakeoff:
    low_m, high_m = each.interval.lower, each.interval.upper
    return GainsInTakeoff.view_of(
        each, error_m=each.predicted_error_m, low_m=low_m, high_m=high_m, passes_gate=not each.refusal
    )
