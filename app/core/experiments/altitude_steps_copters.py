"""Steps of the altitude set point in flight, under ArduCopter and PX4, with gains of their own controllers.

ArduCopter is scored against the target that it shapes, PX4 against the set point. The ranges of the gains are those
that may be written to such a vehicle at all: a campaign narrows them to suit its vehicle.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final, Self

import numpy as np

from app.core.control.ardupilot_parameters import STEP_S, Parameters
from app.core.definition import OptionValue
from app.core.experiments.base import Matrix, Scatter
from app.core.experiments.step_sequence import ALTITUDE, REFERENCE, StepSequence, step_options
from app.core.experiments.takeoff import ARDUPILOT_GAINS, PX4_GAINS
from app.core.models.ardupilot_copter import shaped
from app.core.models.set_points import SetPoints
from app.core.policy import Gain, PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory

CLIMB_S: Final = 15.0
"""Time from the command to the first step: ArduCopter's motors are off for 2 s after arming, PX4's thrust rises for 3 s
in a takeoff, and both then settle."""
GRID_HZ: Final = 50.0
"""Rate of a model run's output."""

_SEQUENCE: Final = StepSequence(climb_s=CLIMB_S)

ReferenceOf = Callable[[SetPoints, Samples], Samples]
"""Set points and times, shape (n,) → the altitude that the autopilot follows, (n,), with the firmware's defaults."""


class CopterSteps:
    """Steps of the altitude set point under another autopilot, without a model so far."""

    options: Final = step_options(largest_step_m=2.0)
    modelled: Final = None
    output: Final = ALTITUDE
    integrates: Final = False
    error_unit: Final = "m"
    scored_from_s: Final = CLIMB_S
    target_channel: Final = REFERENCE

    def __init__(
        self,
        name: str,
        autopilot: str,
        gains: tuple[Gain, ...],
        scatter: Scatter,
        reference: ReferenceOf,
        *,
        sequence: StepSequence = _SEQUENCE,
    ) -> None:
        self.name: Final = name
        self.title: Final = f"Altitude steps under {autopilot}"
        self.space: Final = PolicySpace(gains)
        self.scatter: Final = scatter
        self.sequence: Final = sequence
        self.set_points: Final = sequence.set_points
        self.window_s: Final = sequence.ends_s
        self.measure: Final = f"{sequence}, under {autopilot}"
        self._autopilot: Final = autopilot
        self._reference: Final = reference

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with another sequence; itself if that is its own."""
        sequence = self.sequence.chosen(options, self.options)
        if sequence == self.sequence:
            return self
        return type(self)(
            self.name, self._autopilot, self.space.gains, self.scatter, self._reference, sequence=sequence
        )

    @property
    def grid_s(self) -> Samples:
        """Every 20 ms from the command to the first instant at or past the end of the window, shape (n,)."""
        return np.arange(int(np.ceil(self.window_s * GRID_HZ)) + 1) / GRID_HZ

    def set_point(self, time_s: Samples) -> Samples:
        """The altitude asked for at each time, m."""
        return self.set_points.at(time_s)

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute distance from the reference, m, over the windows of the steps: (k, n) → (k,)."""
        grid_s = self.grid_s
        return self.sequence.errors(grid_s, outputs, self._reference(self.set_points, grid_s))

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight, against its recorded reference; raises TrajectoryError if it does not
        count."""
        return self.sequence.error(trajectory, accept_gaps=accept_gaps)


def _shaped(set_points: SetPoints, time_s: Samples) -> Samples:
    steps_s = np.arange(0.0, time_s[-1] + STEP_S, STEP_S)
    references = np.zeros((len(steps_s), 4))
    shaped(Parameters().packed(), set_points.altitudes_m[0], set_points.at(steps_s), references)
    return np.interp(time_s, steps_s, references[:, 0])


def _straight(set_points: SetPoints, time_s: Samples) -> Samples:
    return set_points.at(time_s)


_LEAST_I: Final = 0.2
"""A smaller integral gain of the acceleration fails the arming check."""

ALTITUDE_STEPS_ARDUPILOT: Final = CopterSteps(
    "altitude-steps-ardupilot",
    "ArduCopter",
    tuple(replace(gain, lower=_LEAST_I) if gain.name == "PSC_ACCZ_I" else gain for gain in ARDUPILOT_GAINS),
    Scatter(0.003, degrees_of_freedom=1.0, measured=False),
    _shaped,
)
ALTITUDE_STEPS_PX4: Final = CopterSteps(
    "altitude-steps-px4",
    "PX4",
    PX4_GAINS,
    Scatter(0.02, degrees_of_freedom=1.0, measured=False),
    _straight,
)
"""The scatter is that of a few flights of the firmware's binary in its own simulation, in gusts."""
