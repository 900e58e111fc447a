"""The paper's takeoff: from the ground to 3 m under the autopilot's vertical loop, scored by its altitude error."""

from typing import Final

import numpy as np

from app.core.control.fixed_point import fix
from app.core.control.vertical_loop import POSITION_BITS, RATE_HZ
from app.core.experiments.base import Matrix, ModelParameter
from app.core.metrics import mean_absolute_error, require_scorable
from app.core.plants.vertical import CHANNELS, Counts, fly, fly_batch
from app.core.policy import Gain, PolicySpace, Vector
from app.core.trajectory import Samples, Trajectory

TARGET_M: Final = 3.0
WINDOW_S: Final = 32.6

_TARGET: Final = fix(TARGET_M, POSITION_BITS)
_SAMPLES: Final = int(np.ceil(WINDOW_S * RATE_HZ)) + 1


def _gain(name: str, title: str, upper: int, default: int) -> Gain:
    return Gain(name, title, "counts", lower=0, upper=upper, scale=upper / 10, default=default, integer=True)


class Takeoff:
    """Gains are the loop's integers; above 1073 for ki and 409 for kd a product can wrap at 32 bits."""

    name: Final = "takeoff"
    title: Final = "Takeoff to 3 m"
    output: Final = "altitude_m"
    error_unit: Final = "m"
    space: Final = PolicySpace(
        (
            _gain("kp", "Proportional gain", 4000, 283),
            _gain("ki", "Integral gain", 1073, 13),
            _gain("kd", "Derivative gain", 409, 82),
        )
    )
    model_parameters: Final = (
        ModelParameter("hover_throttle", "Hover throttle", "of full", 0.63, lower=0.3, upper=0.95, prior_sd=0.05),
        ModelParameter("start_latency_s", "Start latency", "s", 0.0, lower=0.0, upper=1.0, prior_sd=0.15),
        ModelParameter("motor_lag_s", "Motor lag", "s", 0.0, lower=0.0, upper=0.3, prior_sd=0.05),
        ModelParameter("drag_1_s", "Drag", "1/s", 0.0, lower=0.0, upper=1.0, prior_sd=0.1),
    )

    @property
    def nominal_model(self) -> Vector:
        """What the data sheet gives: mass and thrust, and nothing of the rest."""
        return np.array([parameter.nominal for parameter in self.model_parameters])

    @property
    def grid_s(self) -> Samples:
        """Every 1/512 s from the command to the first instant at or past 32.6 s."""
        return np.arange(_SAMPLES) / RATE_HZ

    def set_point(self, time_s: Samples) -> Samples:
        """3 m from the command on."""
        return np.where(time_s >= 0.0, TARGET_M, 0.0)

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One run of the simple model, for any whole gains, inside the bounds or not."""
        channels, _ = fly(_counts(gains), model, _TARGET, _SAMPLES)
        time_s = self.grid_s
        named = dict(zip(CHANNELS, channels, strict=True)) | {"set_point_m": self.set_point(time_s)}
        return Trajectory(time_s, named, "model", "simulation")

    def outputs(self, gains: Matrix, model: Vector) -> Matrix:
        """Altitude of many policies on one model: gains (k, 3) → (k, 16693)."""
        return fly_batch(_counts(gains), np.tile(model, (len(gains), 1)), _TARGET, _SAMPLES)

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute altitude error, m, over 32.6 s: (k, 16693) → (k,)."""
        time_s = self.grid_s
        return np.array([mean_absolute_error(time_s, row, self.set_point, 0.0, WINDOW_S) for row in outputs])

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same of a recorded flight. Raises TrajectoryError when it has gaps or does not cover the window."""
        require_scorable(trajectory, self.output, 0.0, WINDOW_S, accept_gaps=accept_gaps)
        return mean_absolute_error(trajectory.time_s, trajectory[self.output], self.set_point, 0.0, WINDOW_S)


def _counts(gains: Vector) -> Counts:
    return np.ascontiguousarray(np.rint(gains), dtype=np.int64)
