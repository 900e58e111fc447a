"""The answer to a log of takeoffs under Paparazzi: the calibrated model behind them, and gains for the next one.

The takeoffs count as the flights of a campaign: the strategy `calibrated` fits the model to them and proposes its
robust optimum, and the gate judges every gain set.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, Interval, StopRule
from app.core.errors import Problem, TrajectoryError
from app.core.experiments.base import FittedParameter
from app.core.experiments.takeoff import WINDOW_S, Takeoff
from app.core.formatting import format_gains, interval_text, short
from app.core.policy import Gains
from app.core.records.metrics import StepResponse, step_response
from app.core.records.trajectory import Trajectory
from app.core.statistics.gain_change import COMPARED_S, ScoredTakeoff
from app.core.tuning.calibration import calibrate
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import check_policy
from app.core.tuning.predictions import predict_flight
from app.core.tuning.proposals import next_proposal

SHORTEST_S: Final = COMPARED_S
MOST_TAKEOFFS: Final = 8
_BETTER: Final = 0.95
_LARGEST_RESIDUAL_M: Final = (0.05, 0.15)
_RESIDUAL_SHARE: Final = 0.4
"""Of the error. Takeoffs of vehicles beyond the model, in gusts, leave at most a third."""
_KEEP: Final = "Keep the gains flown: no other gains are predicted to reduce the error by more than 5 %."


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedTakeoff:
    """A takeoff of a log: its number there, the gains that it was flown with, and its record."""

    number: int
    gains: Gains
    trajectory: Trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class AssessedGains:
    """A gain set on the calibrated model: predicted error, m, with the 90 % interval of a single flight; the mean error
    of its takeoffs, None if the log has none; why the gate refuses it, empty if it does not."""

    name: str
    gains: Gains
    predicted_error_m: float
    interval: Interval
    flown_error_m: float | None
    refusal: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TakeoffAnalysis:
    """Everything that a log of takeoffs answers.

    `numbers` are the takeoffs used, all scored over `window_s`; `best` is the one with the lowest error, and `response`
    how it followed the step to 3 m. `fitted` is the vehicle, and `residual_m` the rms of the altitude that it does not
    explain. `assessments` begins with the gains of `best`; `proposed` is None if none are better.
    `predicted` is a takeoff with the proposed gains, else with those of `best`.
    """

    window_s: float
    numbers: Sequence[int]
    best: Flight
    response: StepResponse | None
    fitted: Sequence[FittedParameter]
    residual_m: float
    assessments: Sequence[AssessedGains]
    proposed: AssessedGains | None
    predicted: Trajectory

    @property
    def answer(self) -> str:
        """The answer in a sentence or two."""
        if self.proposed is None:
            return _KEEP
        error_m, interval = self.proposed.predicted_error_m, self.proposed.interval
        refused = " The gate refuses the gains flown." if self.assessments[0].refusal else ""
        return (
            f"Mean distance from 3 m: {short(self.best.error or 0.0)} m measured. The model predicts "
            f"{short(error_m)} m ({interval_text(interval.lower, interval.upper)} m) for the proposed gains.{refused}"
        )


def analyze_takeoffs(takeoffs: Sequence[LoggedTakeoff]) -> TakeoffAnalysis:
    """Analyse the takeoffs of one vehicle; deterministic, takes some seconds.

    Raises TrajectoryError if none is long enough or can be scored, and if the best does not fly as the model does with
    its gains.
    """
    used, window_s = comparable_takeoffs(takeoffs)
    definition = Definition(
        strategy="calibrated", experiment_options={"window_s": window_s}, stop=StopRule(kind="budget", max_flights=99)
    )
    experiment = Takeoff(window_s=window_s)
    flights = [_flight(experiment, each) for each in used]
    evidence = Evidence(definition=definition, experiment=experiment, flights=flights)
    best, calibration = evidence.best, calibrate(experiment, flights)
    residual_m = float(np.sqrt(np.mean(calibration.residual**2)))
    _require_likeness(best, residual_m)
    spread = calibration.spread()

    def assess(name: str, gains: Gains) -> AssessedGains:
        predicted = predict_flight(calibration, best, experiment.space.vector(gains))
        gate = check_policy(evidence, gains, spread=spread)
        errors = [flight.error for flight in flights if flight.error is not None and flight.gains == gains]
        return AssessedGains(
            name=name,
            gains=gains,
            predicted_error_m=predicted.error,
            interval=predicted.interval,
            flown_error_m=sum(errors) / len(errors) if errors else None,
            refusal=" ".join(check.sentence for check in gate.refusals),
        )

    flown_sets = list({tuple(each.gains.items()): dict(each.gains) for each in (best, *flights)}.values())
    default = experiment.space.mapping(experiment.space.default)
    flown = [assess("As flown", gains) for gains in flown_sets]
    stock = [] if default in flown_sets else [assess("Paparazzi's default gains", default)]
    proposed = assess("Proposed", next_proposal(evidence).gains)
    is_better = not proposed.refusal and (
        bool(flown[0].refusal) or proposed.predicted_error_m <= _BETTER * flown[0].predicted_error_m
    )
    shown = proposed if is_better else flown[0]
    return TakeoffAnalysis(
        window_s=window_s,
        numbers=[each.number for each in used],
        best=best,
        response=step_response(
            best.trajectory.time_s, best.trajectory[experiment.output], experiment.set_point, window_s
        ),
        fitted=calibration.fitted,
        residual_m=residual_m,
        assessments=(*flown, *stock),
        proposed=proposed if is_better else None,
        predicted=predict_flight(calibration, best, experiment.space.vector(shown.gains)).trajectory,
    )


def score_takeoffs(takeoffs: Sequence[LoggedTakeoff]) -> list[ScoredTakeoff]:
    """What other logs of the vehicle are compared with: the takeoffs that an analysis uses. Raises TrajectoryError as
    `analyze_takeoffs` does."""
    experiment = Takeoff(window_s=COMPARED_S)
    used, _ = comparable_takeoffs(takeoffs)
    return [ScoredTakeoff(gains=dict(each.gains), error_m=experiment.error(each.trajectory)) for each in used]


def comparable_takeoffs(takeoffs: Sequence[LoggedTakeoff]) -> tuple[list[LoggedTakeoff], float]:
    """The last 8 takeoffs of at least 10 s, and the window, s, over which all are scored: that of a campaign, or the
    shortest of them. Raises TrajectoryError if none is long enough."""
    used = [each for each in takeoffs if each.trajectory.time_s[-1] >= SHORTEST_S][-MOST_TAKEOFFS:]
    if not used:
        flown = (
            f"{each.trajectory.time_s[-1]:.1f} s with {format_gains(each.gains)}" for each in takeoffs[-MOST_TAKEOFFS:]
        )
        raise _unanswered(f"has only takeoffs of {'; of '.join(flown)}; at least {SHORTEST_S:g} s are needed")
    return used, min(WINDOW_S, *(math.floor(10.0 * each.trajectory.time_s[-1]) / 10.0 for each in used))


def _flight(experiment: Takeoff, takeoff: LoggedTakeoff) -> Flight:
    """The takeoff as a strategy sees it. Raises TrajectoryError if it cannot be."""
    for gain in experiment.space.gains:
        if reason := gain.refusal_by_controller(takeoff.gains[gain.name]):
            raise _unanswered(f"has a takeoff with {gain.name} that {reason}")
    return experiment.scored_flight(takeoff.number, takeoff.gains, takeoff.trajectory)


def _require_likeness(best: Flight, residual_m: float) -> None:
    least, most = _LARGEST_RESIDUAL_M
    if residual_m > min(most, max(least, _RESIDUAL_SHARE * (best.error or 0.0))):
        raise _unanswered(
            f"has a takeoff that differs by {residual_m:.2f} m rms from every vehicle of the model with its gains: it "
            "climbed to a height other than 3 m, flew with gains other than the log says, or flew in strong gusts"
        )


def _unanswered(reason: str) -> TrajectoryError:
    return TrajectoryError(
        "The log cannot be analysed.",
        hint="Take off to 3 m with the block Takeoff, hold that height for 30 s, and land.",
        problems=(Problem("file", reason),),
    )
