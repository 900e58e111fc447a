"""Steps of the altitude set point in flight: climb, settle, then steps down and up; when a record counts, its score.

A takeoff is scored from the ground, where the reference trajectory, which does not depend on the gains, makes up much
of the error. Here each step is scored against that reference, so that only what the gains can change remains.
"""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Self

import numpy as np

from app.core.definition import Option, OptionValue, with_defaults
from app.core.errors import Problem, TrajectoryError
from app.core.experiments.base import Experiment, Matrix
from app.core.models.set_points import SetPoints, on_step
from app.core.policy import Vector
from app.core.records.metrics import SetPoint, mean_absolute_error, mean_absolute_errors, require_scorable
from app.core.records.trajectory import Samples, Trajectory

ALTITUDE: Final = "altitude_m"
"""The scored channel."""
REFERENCE: Final = "reference_m"
"""Recorded channel with the autopilot's own reference."""

SETTLED_FOR_S: Final = 2.0
"""The vehicle must be at rest for this time before the first step."""
LARGEST_DRIFT_M: Final = 0.2
"""A vehicle at rest stays within a band of this height; means over a tenth of a second count."""
_MEAN_S: Final = 0.1

LARGEST_PUSH_M_S2: Final = 2.0
"""A fifth of gravity, beside which thrust remains in both directions."""

DOWN_FIRST: Final = "down first"
UP_FIRST: Final = "up first"


def step_options(*, largest_step_m: float, largest_push_m_s2: float = 0.0) -> tuple[Option, ...]:
    """The settings of a sequence, with a push where the autopilot takes one. Its lowest set point must be above half of
    the highest, see `app.core.tuning.definition_checks`."""
    push = Option(name="push_m_s2", title="Push", default=0.0, unit="m/s²", lower=0.0, upper=largest_push_m_s2)
    steps = (
        Option(name="height_m", title="Height", default=3.0, unit="m", lower=2.5, upper=10.0),
        Option(name="step_m", title="Step", default=1.0, unit="m", lower=0.25, upper=largest_step_m),
        Option(name="steps", title="Number of steps", default=4, lower=2, upper=6),
        Option(name="order", title="Order of the steps", default=DOWN_FIRST, choices=(DOWN_FIRST, UP_FIRST)),
        Option(name="step_window_s", title="Scored time after each step", default=5.0, unit="s", lower=3.0, upper=8.0),
    )
    return (*steps, push) if largest_push_m_s2 else steps


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSequence:
    """Steps from `height_m` by `step_m` and back, `steps` of them in all; each is scored for `step_window_s`. If there
    is a push, they are followed by a downward acceleration of `push_m_s2`, fed forward while the last altitude is held,
    for another such window, and by a window without it.

    The first one follows `climb_s` after the command. The windows follow each other, so that a mean over all of them is
    one over that time.
    """

    climb_s: float
    height_m: float = 3.0
    step_m: float = 1.0
    steps: int = 4
    order: str = DOWN_FIRST
    step_window_s: float = 5.0
    push_m_s2: float = 0.0

    def chosen(self, options: Mapping[str, OptionValue], offered: tuple[Option, ...]) -> Self:
        """The sequence of these settings, the others at their defaults, after the same climb."""
        values = with_defaults(options, offered)
        return type(self)(
            climb_s=self.climb_s,
            height_m=float(values["height_m"]),
            step_m=float(values["step_m"]),
            steps=int(values["steps"]),
            order=str(values["order"]),
            step_window_s=float(values["step_window_s"]),
            push_m_s2=float(values.get("push_m_s2", 0.0)),
        )

    @property
    def ends_s(self) -> float:
        """End of the last window, s since the command."""
        return self._time_s(self.steps + len(self._pushes_m_s2))

    @property
    def _pushes_m_s2(self) -> tuple[float, ...]:
        """The push, downward, and its end, if there is one."""
        return (self.push_m_s2, 0.0) if self.push_m_s2 else ()

    @property
    def set_points(self) -> SetPoints:
        """The first height from the command on, then the steps, then the push and its end, if there is one."""
        other_m = self.height_m + (self.step_m if self.order == UP_FIRST else -self.step_m)
        stepped = [self.height_m if number % 2 else other_m for number in range(self.steps)]
        pushes = self._pushes_m_s2
        times_s = [self._time_s(number) for number in range(self.steps + len(pushes))]
        altitudes_m = (self.height_m, *stepped, *(stepped[-1] for _ in pushes))
        accelerations_m_s2 = (*np.zeros(1 + self.steps).tolist(), *(-push for push in pushes)) if pushes else ()
        return SetPoints((0.0, *times_s), altitudes_m, accelerations_m_s2)

    def __str__(self) -> str:
        return (
            f"{self.steps} steps of {self.step_m:g} m from {self.height_m:g} m, {self.order}, "
            f"{self.step_window_s:g} s each{f', then a push of {self.push_m_s2:g} m/s²' if self.push_m_s2 else ''}"
        )

    def _time_s(self, number: int) -> float:
        return on_step(self.climb_s + number * self.step_window_s)


class StepsManoeuvre(Experiment):
    """Steps of the altitude set point, scored by the distance from the autopilot's own reference."""

    curves_title = "Altitude steps"
    output = ALTITUDE
    error_unit = "m"
    target_channel = REFERENCE
    sequence: StepSequence
    set_points: SetPoints

    @property
    @abstractmethod
    def followed_m(self) -> Samples:
        """The reference in a model run, on the grid, shape (n,)."""

    @abstractmethod
    def with_sequence(self, sequence: StepSequence) -> Self:
        """The experiment with another sequence."""

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with another sequence; itself if that is its own."""
        sequence = self.sequence.chosen(options, self.options)
        return self if sequence == self.sequence else self.with_sequence(sequence)

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute distance from the reference, m, over the windows of the steps: (k, n) → (k,)."""
        grid_s, sequence = self.grid_s, self.sequence
        follow = _follow(grid_s, self.followed_m)
        return mean_absolute_errors(grid_s, outputs, follow, sequence.climb_s, sequence.ends_s)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight, against its recorded reference.

        Raises TrajectoryError if the record has gaps, does not cover the windows, lacks the reference, or if the
        vehicle had not settled before the first step.
        """
        begin_s, end_s = self.sequence.climb_s, self.sequence.ends_s
        for channel in (ALTITUDE, REFERENCE):
            require_scorable(trajectory, channel, begin_s - SETTLED_FOR_S, end_s, accept_gaps=accept_gaps)
        time_s, altitude = trajectory.time_s, trajectory[ALTITUDE]
        if (why := unsettled(time_s, altitude, begin_s, self.sequence.height_m)) is not None:
            raise TrajectoryError(
                "This flight cannot be scored.",
                problems=(Problem(ALTITUDE, why),),
                hint="Choose gains that bring the vehicle to rest, or mark the flight invalid; the raw record is kept.",
            )
        return mean_absolute_error(time_s, altitude, _follow(time_s, trajectory[REFERENCE]), begin_s, end_s)


def _follow(time_s: Samples, reference: Samples) -> SetPoint:
    """The recorded reference as a function of time."""
    return lambda at_s: np.interp(at_s, time_s, reference)


def unsettled(time_s: Samples, altitude: Samples, first_step_s: float, height_m: float) -> str | None:
    """Why the vehicle had not settled before the first step, or None if it had.

    It has settled if it is in the air, above half of `height_m`, and its altitude stays within a band of 0.2 m for 2 s,
    wherever that lies: a loop with little integral gain hovers beside its set point for a long time. Arrays of shape
    (n,), time stamps increasing; means over a tenth of a second leave out the noise of the measurement.
    """
    edges = np.arange(first_step_s - SETTLED_FOR_S, first_step_s + _MEAN_S / 2, _MEAN_S)
    places = np.searchsorted(time_s, edges)
    means = np.array([altitude[low:high].mean() for low, high in pairwise(places) if high > low])
    if not means.size or means.mean() < 0.5 * height_m:
        return f"had not reached half of {height_m:g} m before the first step, at {first_step_s:g} s"
    drift_m = float(np.ptp(means))
    if drift_m > LARGEST_DRIFT_M:
        return (
            f"had not settled before the first step, at {first_step_s:g} s: it changed by {drift_m:.2f} m in the "
            f"{SETTLED_FOR_S:g} s before; {LARGEST_DRIFT_M:g} m is allowed"
        )
    return None
