"""Steps of the altitude set point in flight, under Paparazzi's vertical loop."""

import math
from collections.abc import Mapping
from typing import Final, Self

import numpy as np

from app.core.control.paparazzi import POSITION_BITS
from app.core.definition import OptionValue
from app.core.experiments.base import Matrix, ModelParameter, Scatter
from app.core.experiments.step_sequence import REFERENCE, StepSequence, step_options
from app.core.experiments.vertical_loop import MODEL_PARAMETERS, SKETCH_EVERY, VerticalLoop
from app.core.models.vertical_batch import reference_altitude
from app.core.policy import Vector
from app.core.records.trajectory import Samples, Trajectory

CLIMB_S: Final = 10.0
"""Time from the command to the first step: the reference needs 4 s for the climb."""

_SCATTER_M: Final = 0.005
_SEQUENCE: Final = StepSequence(climb_s=CLIMB_S)


class AltitudeSteps(VerticalLoop):
    """Steps of the altitude set point, scored by the distance from the autopilot's own reference.

    That depends on the set points alone, and is at rest before the first step.
    """

    name = "altitude-steps"
    title = "Altitude steps"
    options = step_options(largest_step_m=1.0)
    scored_from_s = CLIMB_S
    target_channel = REFERENCE
    scatter = Scatter(_SCATTER_M, degrees_of_freedom=1.0, measured=False)
    """Between that of the twin with the default gains, 19 mm, and with tuned ones, 0.5 mm: no real vehicle has flown it
    yet."""
    least_model_error = (1 / (1 << POSITION_BITS)) / math.sqrt(12.0)
    """The loop rounds the altitude to 1/256 m, which is uniformly distributed; errors of tuned gains are as small."""
    held_s = 20.0

    def __init__(
        self, model_parameters: tuple[ModelParameter, ...] = MODEL_PARAMETERS, *, sequence: StepSequence = _SEQUENCE
    ) -> None:
        super().__init__(model_parameters, sequence.set_points, sequence.ends_s)
        self.sequence: Final = sequence
        self.measure = str(sequence)
        self._first: Final = self.set_points.steps[1]

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with another sequence; itself if that is its own."""
        sequence = self.sequence.chosen(options, self.options)
        return self if sequence == self.sequence else type(self)(self.model_parameters, sequence=sequence)

    def with_parameters(self, model_parameters: tuple[ModelParameter, ...]) -> Self:
        """The same sequence on another model."""
        return type(self)(model_parameters, sequence=self.sequence)

    @property
    def sketches_s(self) -> tuple[float, float]:
        """The first two steps, which differ in their direction; then the whole flight."""
        return CLIMB_S + 2.0 * self.sequence.step_window_s, self.window_s

    def sketch_errors(self, altitude: Matrix, until_s: float) -> Vector:  # noqa: ARG002
        """Mean distance from the reference after the first step."""
        first = -(-self._first // SKETCH_EVERY)
        reference = self.reference[::SKETCH_EVERY][first : altitude.shape[1]]
        return np.asarray(np.abs(altitude[:, first:] - reference).mean(axis=1))

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
