"""Steps of the altitude set point in flight, under Paparazzi's vertical loop."""

import math
from collections.abc import Mapping
from typing import Final, Self

import numpy as np

from app.core.analysis.linear_guidance import LinearGuidance
from app.core.control.vertical_guidance import POSITION_BITS, RATE_HZ, STEP_S
from app.core.definition import OptionValue
from app.core.experiments.base import Check, Envelope, Matrix, ModelParameter, ParameterDistribution, Scatter
from app.core.experiments.copter_steps_hazards import COPTERS, check_margin
from app.core.experiments.step_sequence import REFERENCE, StepSequence, step_options
from app.core.experiments.vertical_loop import MODEL_PARAMETERS, VerticalLoop, counts
from app.core.models.copter import filtered, motor_filter
from app.core.models.vertical import (
    ALTITUDE,
    CHANNELS,
    COLUMNS,
    ENTERED,
    START_LATENCY_S,
    commanded,
    fly_recorded,
    observe,
)
from app.core.models.vertical_batch import reference_altitude
from app.core.policy import Vector
from app.core.records.trajectory import Samples, Trajectory

CLIMB_S: Final = 10.0
"""Time from the command to the first step: the reference needs 4 s for the climb."""

_SCATTER_M: Final = 0.005
_THRUST: Final = CHANNELS.index("thrust")
_SLOW_S: Final = 1.0 / (2.0 * math.pi * 2.0)
_SEQUENCE: Final = StepSequence(climb_s=CLIMB_S)


class AltitudeSteps(VerticalLoop):
    """Steps of the altitude set point, scored by the distance from the autopilot's own reference.

    That depends on the set points alone, and is at rest before the first step.
    """

    name = "altitude-steps"
    title = curves_title = "Altitude steps"
    options = step_options(largest_step_m=1.0)
    scored_from_s = CLIMB_S
    target_channel = REFERENCE
    scatter = Scatter(_SCATTER_M, degrees_of_freedom=1.0, measured=False)
    """Between that of the twin with the default gains, 19 mm, and with tuned ones, 0.5 mm: no real vehicle has flown it
    yet."""
    held_s = 20.0

    def __init__(
        self, model_parameters: tuple[ModelParameter, ...] = MODEL_PARAMETERS, *, sequence: StepSequence = _SEQUENCE
    ) -> None:
        super().__init__(model_parameters, sequence.set_points, sequence.ends_s)
        self.sequence: Final = sequence
        self.measure = str(sequence)

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with another sequence; itself if that is its own."""
        sequence = self.sequence.chosen(options, self.options)
        return self if sequence == self.sequence else type(self)(self.model_parameters, sequence=sequence)

    def with_parameters(self, model_parameters: tuple[ModelParameter, ...]) -> Self:
        """The same sequence on another model."""
        return type(self)(model_parameters, sequence=self.sequence)

    def least_model_error(self, base: Trajectory) -> float:
        """The loop rounds the altitude to 1/256 m, and the time at which a step took effect is known to a row of the
        record, by which the reference is early or late; both are uniformly distributed."""
        scored = (base.time_s >= self.scored_from_s) & (base.time_s <= self.window_s)
        row_m = np.abs(np.diff(base[REFERENCE][scored])).mean()
        return math.hypot((1 / (1 << POSITION_BITS)) / math.sqrt(12.0), float(row_m) / math.sqrt(3.0))

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix:
        """As of all flights under this loop; a thrust command that a link does not record is what the replica commands
        for the recorded altitude, climb rate and set points."""
        grid_s, time_s = self.grid_s, trajectory.time_s
        altitude, climb = (np.interp(grid_s, time_s, trajectory[name]) for name in ("altitude_m", "climb_rate_m_s"))
        if "thrust" in trajectory.channels:
            thrust = np.interp(grid_s, time_s, trajectory["thrust"])
        else:
            rows = np.maximum(np.searchsorted(time_s, grid_s, side="right") - 1, 0)
            targets = np.rint(trajectory["set_point_m"][rows] * (1 << POSITION_BITS)).astype(np.int64)
            entered_step = round(float(model[START_LATENCY_S]) * RATE_HZ)
            thrust = commanded(counts(gains), targets, altitude, climb, entered_step)
        return observe(altitude, climb, thrust, self._models(model, 1)[0])

    def flown(self, gains: Vector, models: Matrix, own: Vector, disturbances: Matrix) -> tuple[float, float]:
        """Mean error, m, of models, (k, m), to which is added what the disturbances cause on their `own` model, (m,),
        and the throttle activity there, share of full: the standard deviation of the commanded thrust about its own
        2 Hz low-pass, over the windows of the steps."""
        calm = disturbances * (np.arange(COLUMNS) == ENTERED)
        disturbed, still = (fly_recorded(counts(gains), own, self.set_points, each) for each in (disturbances, calm))
        outputs = self.outputs(np.tile(gains, (len(models), 1)), models) + disturbed[ALTITUDE] - still[ALTITUDE]
        fast = disturbed[_THRUST] - filtered(disturbed[_THRUST], motor_filter(_SLOW_S, STEP_S))
        scored = self.grid_s >= self.scored_from_s
        return float(np.abs(outputs - self.reference)[:, scored].mean()), float(fast[scored].std())

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """As of all flights under this loop, and the margin from ringing."""
        return (
            *super().hazards(gains, spread, envelope),
            check_margin(LinearGuidance(gains), list(spread.sample(self, COPTERS))),
        )

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute distance from the loop's reference, m, over the windows of the steps: (k, n) → (k,)."""
        return self.sequence.errors(self.grid_s, outputs, self.reference)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight, against its recorded reference; raises TrajectoryError if it does not
        count."""
        return self.sequence.error(trajectory, accept_gaps=accept_gaps)

    @property
    def reference(self) -> Samples:
        """The loop's reference in a model run."""
        return reference_altitude(self.set_points, self._samples)
