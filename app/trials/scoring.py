"""Score of a flight's record: its error, its overshoot, a coarse curve."""

from dataclasses import dataclass
from typing import Final

from app.core.errors import TrajectoryError
from app.core.experiments.base import Experiment
from app.core.thinning import select_samples
from app.core.trajectory import Trajectory

CURVE_POINTS: Final = 48


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Score of a record. `error` is in the experiment's unit, or None with the reason in `refusal`."""

    error: float | None
    refusal: str
    overshoot: float | None
    curve: list[list[float]]


def score(experiment: Experiment, trajectory: Trajectory, *, accept_gaps: bool = False) -> Score:
    """Score a record as stored. `accept_gaps`: a person has decided that its gaps are harmless."""
    error, refusal = None, ""
    try:
        error = experiment.error(trajectory, accept_gaps=accept_gaps)
    except TrajectoryError as found:
        refusal = "; ".join(f"{problem.field} {problem.reason}" for problem in found.problems) or found.message
    return Score(
        error=error, refusal=refusal, overshoot=_overshoot(experiment, trajectory), curve=_curve(experiment, trajectory)
    )


def _overshoot(experiment: Experiment, trajectory: Trajectory) -> float | None:
    """Overshoot of the output over its last set point; zero when it stayed below.

    None without samples, and where the set point is zero, because there is no rise.
    """
    if experiment.output not in trajectory.channels:
        return None
    flown = trajectory[experiment.output][trajectory.time_s >= 0.0]
    if not flown.size:
        return None
    target = float(experiment.set_point(trajectory.time_s[-1:])[0])
    return max(float(flown.max()) - target, 0.0) if target > 0.0 else None


def _curve(experiment: Experiment, trajectory: Trajectory) -> list[list[float]]:
    if experiment.output not in trajectory.channels:
        return []
    flown = trajectory.time_s >= 0.0
    time_s, values = trajectory.time_s[flown], trajectory[experiment.output][flown]
    return [
        [round(float(time_s[index]), 3), round(float(values[index]), 4)]
        for index in select_samples(time_s, values, CURVE_POINTS)
    ]
