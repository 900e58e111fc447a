"""What the experiments under Paparazzi's vertical loop share: the gains, the simple model of the vehicle with its
parameters, and the hazards. An experiment adds its set points and its performance measure.
"""

from functools import lru_cache
from typing import ClassVar, Final

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ
from app.core.experiments.base import (
    Check,
    Envelope,
    Matrix,
    ModelledExperiment,
    ModelParameter,
    ParameterDistribution,
    SimplexSearch,
)
from app.core.experiments.integer_overflow import check_wrapping
from app.core.experiments.vertical_loop_hazards import MODELS, Manoeuvre, check_flights
from app.core.models.set_points import SetPoints
from app.core.models.vertical import CHANNELS, Counts, fly, fly_disturbed, observe
from app.core.models.vertical_batch import fly_batch
from app.core.policy import Gain, PolicySpace, Vector
from app.core.records.trajectory import Trajectory

_STATE_AND_COMMAND: Final = ("altitude_m", "climb_rate_m_s", "thrust")


def _gain(name: str, title: str, upper: int, default: int) -> Gain:
    return Gain(name, title, "counts", lower=0, upper=upper, scale=upper / 10, default=default, integer=True)


MODEL_PARAMETERS: Final = (
    ModelParameter(
        "hover_throttle", "Hover throttle", "of full", 0.95, 0.09, 0.05, nominal=0.63, lower=0.3, flight_sd=0.002
    ),
    ModelParameter("start_latency_s", "Start latency", "s", 1.0, 0.15, 0.3, expected=0.2, flight_sd=0.06),
    ModelParameter("motor_lag_s", "Motor lag", "s", 0.3, 0.04, 0.05, expected=0.05),
    ModelParameter("drag_1_s", "Drag", "1/s", 1.0, 0.15, 0.2, expected=0.15),
    ModelParameter("quadratic_share", "Quadratic share of thrust", "", 1.0, 0.5, 0.3),
    ModelParameter("ground_effect", "Ground effect", "of weight", 0.5, 0.12, 0.1),
    ModelParameter("measurement_delay_s", "Measurement delay", "s", 0.1, 0.02, 0.01),
    ModelParameter("battery_sag", "Battery sag", "of thrust", 0.1, 0.015, 0.01),
)
"""The nominal model has mass and thrust only: every other nominal value is zero. The expected values of the others are
typical of small multicopters; flights of one vehicle differ by 0.3 % in thrust and 60 ms in their start."""


class VerticalLoop(ModelledExperiment):
    """An experiment under Paparazzi's vertical loop, with its simple model; a run has n samples.

    Gains are the loop's integers; above 1073 for ki and 409 for kd a product can wrap at 32 bits.
    """

    output = "altitude_m"
    error_unit = "m"
    grid_hz = RATE_HZ
    space = PolicySpace(
        (
            _gain("kp", "Proportional gain", 4000, 283),
            _gain("ki", "Integral gain", 1073, 13),
            _gain("kd", "Derivative gain", 409, 82),
        )
    )
    search = SimplexSearch(of_gain=0.3, constant=20.0, evaluations=300)
    difference = 0.1
    simulated_as: ClassVar[str] = "flight"
    """What the gate calls a simulated flight."""
    held_s: ClassVar[float] = 0.0
    """Time that the gate simulates beyond the window, at the last set point."""
    set_points: SetPoints

    model_parameters = MODEL_PARAMETERS

    def __init__(self, set_points: SetPoints, window_s: float) -> None:
        self.set_points = set_points
        self.window_s = window_s
        self._samples: Final = len(self.grid_s)

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One run of the simple model, for any integer gains, inside the bounds or not."""
        channels, _ = fly(counts(gains), self._models(model, 1)[0], self.set_points, self._samples)
        time_s = self.grid_s
        named = dict(zip(CHANNELS, channels, strict=True)) | {"set_point_m": self.set_point(time_s)}
        return Trajectory(time_s, named, "model", "simulation")

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Altitude of many policies, each on its own model or all on one: gains (k, 3) → (k, n)."""
        return fly_batch(counts(gains), self._models(model, len(gains)), self.set_points, self._samples)

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix | None:  # noqa: ARG002
        """Difference of altitude and climb rate from the model's in every step of a flight, shape (n, 3).

        The third column marks when the loop is entered. None if the record lacks the climb rate or the thrust command.
        """
        if any(name not in trajectory.channels for name in _STATE_AND_COMMAND):
            return None
        altitude, climb_rate, thrust = (
            np.interp(self.grid_s, trajectory.time_s, trajectory[name]) for name in _STATE_AND_COMMAND
        )
        return observe(altitude, climb_rate, thrust, self._models(model, 1)[0])

    def disturbed_outputs(self, gains: Matrix, model: Matrix, disturbances: Matrix) -> Matrix:
        """`outputs` with `disturbances` added to the state after each step: gains (k, 3) → (k, n)."""
        return fly_disturbed(counts(gains), self._models(model, len(gains)), self.set_points, disturbances)

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """Check for products that can wrap, exactly, and simulate flights.

        The flights are checked for altitude, divergence, oscillation and aborts. Takes a tenth of a second; repeated
        questions are answered from a cache.
        """
        safe_gains = self.space.vector(envelope.safe_gains)
        steps = self._samples + round(self.held_s * RATE_HZ)
        return _hazards(
            tuple(gains.tolist()),
            tuple(safe_gains.tolist()),
            envelope.ceiling_m,
            tuple(map(tuple, spread.sample(self, MODELS).tolist())),
            self.model_parameters,
            Manoeuvre(self.set_points, steps, self.simulated_as),
        )

    def _models(self, model: Matrix | Vector, runs: int) -> Matrix:
        return np.ascontiguousarray(np.broadcast_to(model, (runs, len(self.model_parameters))))


def counts(gains: Vector | Matrix) -> Counts:
    """The gains as the loop's integers."""
    return np.ascontiguousarray(np.rint(gains), dtype=np.int64)


@lru_cache(maxsize=64)
def _hazards(
    gains: tuple[float, ...],
    safe_gains: tuple[float, ...],
    ceiling_m: float,
    models: tuple[tuple[float, ...], ...],
    parameters: tuple[ModelParameter, ...],
    manoeuvre: Manoeuvre,
) -> tuple[Check, ...]:
    own, safe, vehicles = counts(np.array(gains)), counts(np.array(safe_gains)), np.array(models)
    baseline = gains == tuple(VerticalLoop.space.default.tolist())
    return (
        *check_wrapping(own, vehicles[0], manoeuvre.set_points),
        *check_flights(own, safe, baseline, parameters, vehicles, ceiling_m, manoeuvre),
    )
