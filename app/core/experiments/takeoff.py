"""The paper's takeoff: from the ground to 3 m, scored by the altitude error; under Paparazzi's vertical loop, or under
ArduCopter or PX4 with gains of their own controllers, without a model so far.

The ranges of the latter are those that may be written to such a vehicle at all: a campaign narrows them to suit its
vehicle.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Self

import numpy as np

from app.core.control.paparazzi import POSITION_BITS, RATE_HZ, fix
from app.core.definition import Option, OptionValue, with_defaults
from app.core.experiments.base import (
    Check,
    Envelope,
    Matrix,
    ModelParameter,
    ParameterDistribution,
    Scatter,
    SimplexSearch,
    informed_parameters,
)
from app.core.experiments.takeoff_hazards import MODELS, check_flights, check_wrapping
from app.core.models.vertical import CHANNELS, Counts, fly, fly_disturbed, observe
from app.core.models.vertical_batch import fly_batch
from app.core.policy import Gain, PolicySpace, Vector
from app.core.records.metrics import mean_absolute_error, mean_absolute_errors, require_scorable
from app.core.records.trajectory import Samples, Trajectory

TARGET_M: Final = 3.0
WINDOW_S: Final = 32.6
"""The paper's scored window, from the command on."""

OPTIONS: Final = (
    Option(
        name="window_s",
        title="Scored window",
        default=WINDOW_S,
        unit="s",
        lower=10.0,
        upper=60.0,
    ),
)

SETTLED_S: Final = 5.0
"""A takeoff should be near its target from this time on."""

_SKETCH_EVERY: Final = 4
_SKETCH_END_S: Final = 2.0
_SCATTER_M: Final = 0.0105
_STATE_AND_COMMAND: Final = ("altitude_m", "climb_rate_m_s", "thrust")
_TARGET: Final = fix(TARGET_M, POSITION_BITS)


def _gain(name: str, title: str, upper: int, default: int) -> Gain:
    return Gain(name, title, "counts", lower=0, upper=upper, scale=upper / 10, default=default, integer=True)


def _known(
    name: str,
    title: str,
    unit: str,
    upper: float,
    prior_sd: float,
    within: float,
    *,
    nominal: float = 0.0,
    lower: float = 0.0,
    expected: float | None = None,
    flight_sd: float = 0.0,
) -> ModelParameter:
    return ModelParameter(name, title, unit, nominal, lower, upper, prior_sd, within, expected, flight_sd)


MODEL_PARAMETERS: Final = (
    _known("hover_throttle", "Hover throttle", "of full", 0.95, 0.09, 0.05, nominal=0.63, lower=0.3, flight_sd=0.002),
    _known("start_latency_s", "Start latency", "s", 1.0, 0.15, 0.3, expected=0.2, flight_sd=0.06),
    _known("motor_lag_s", "Motor lag", "s", 0.3, 0.04, 0.05, expected=0.05),
    _known("drag_1_s", "Drag", "1/s", 1.0, 0.15, 0.2, expected=0.15),
    _known("quadratic_share", "Quadratic share of thrust", "1", 1.0, 0.5, 0.3),
    _known("ground_effect", "Ground effect", "of weight", 0.5, 0.12, 0.1),
    _known("measurement_delay_s", "Measurement delay", "s", 0.1, 0.02, 0.01),
    _known("battery_sag", "Battery sag", "of thrust", 0.1, 0.015, 0.01),
)
"""The data sheet gives mass and thrust only: every other nominal value is zero. The expected values of the others are
typical of small multicopters; flights of one vehicle differ by 0.3 % in thrust and 60 ms in their start."""


@dataclass(frozen=True, slots=True)
class Sketches:
    """Shortened takeoffs of c policies on k models; all of shape (c, k).

    The error extrapolates the mean deviation of the last two seconds over the rest of the flight; `lowest_m` is taken
    from 5 s after the command on.
    """

    errors: Matrix
    highest_m: Matrix
    lowest_m: Matrix


def _window_of(options: Mapping[str, OptionValue]) -> float:
    return float(with_defaults(options, OPTIONS)["window_s"])


def _scatter(window_s: float, degrees_of_freedom: float, *, measured: bool = True) -> Scatter:
    """The scatter measured over the paper's window. Most of it arises in the climb, so it grows as 1/window for shorter
    ones; for longer ones it is kept, because with soft gains it hardly falls."""
    return Scatter(_SCATTER_M * max(1.0, WINDOW_S / window_s), degrees_of_freedom, measured)


class Takeoff:
    """Takeoff with the paper's autopilot, scored over the first `window_s` from the command on.

    Gains are the loop's integers; above 1073 for ki and 409 for kd a product can wrap at 32 bits. A run has n samples,
    16693 in the paper's window.
    """

    name: Final = "takeoff"
    title: Final = "Takeoff to 3 m"
    output: Final = "altitude_m"
    integrates: Final = False
    error_unit: Final = "m"
    space: Final = PolicySpace(
        (
            _gain("kp", "Proportional gain", 4000, 283),
            _gain("ki", "Integral gain", 1073, 13),
            _gain("kd", "Derivative gain", 409, 82),
        )
    )
    options: Final = OPTIONS
    search: Final = SimplexSearch(of_gain=0.3, constant=20.0, evaluations=300)
    difference: Final = 0.1

    def __init__(
        self, model_parameters: tuple[ModelParameter, ...] = MODEL_PARAMETERS, *, window_s: float = WINDOW_S
    ) -> None:
        """`window_s` must be free of problems."""
        self.model_parameters: Final = model_parameters
        self.window_s: Final = window_s
        self.scatter: Final = _scatter(window_s, degrees_of_freedom=4.0)
        self._samples: Final = int(np.ceil(window_s * RATE_HZ)) + 1

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The takeoff with another window; itself if that is its own."""
        window_s = _window_of(options)
        return self if window_s == self.window_s else type(self)(self.model_parameters, window_s=window_s)

    def informed(self, mean: Vector, sd: Vector) -> Self:
        """The takeoff with another vehicle's fitted model: mean and standard deviation, shape (m,)."""
        return type(self)(informed_parameters(self.model_parameters, mean, sd), window_s=self.window_s)

    @property
    def modelled(self) -> Self:
        """The experiment itself."""
        return self

    @property
    def nominal_model(self) -> Vector:
        """Parameters before the first flight. From the data sheet, only mass and thrust are known."""
        return np.array([parameter.nominal for parameter in self.model_parameters])

    @property
    def grid_s(self) -> Samples:
        """Every 1/512 s from the command to the first instant at or past the end of the window, shape (n,)."""
        return np.arange(self._samples) / RATE_HZ

    def set_point(self, time_s: Samples) -> Samples:
        """3 m from the command on."""
        return np.where(time_s >= 0.0, TARGET_M, 0.0)

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One run of the simple model, for any integer gains, inside the bounds or not."""
        parameters = np.ascontiguousarray(np.broadcast_to(model, (len(self.model_parameters),)))
        channels, _ = fly(_counts(gains), parameters, _TARGET, self._samples)
        time_s = self.grid_s
        named = dict(zip(CHANNELS, channels, strict=True)) | {"set_point_m": self.set_point(time_s)}
        return Trajectory(time_s, named, "model", "simulation")

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Altitude of many policies, each on its own model or all on one: gains (k, 3) → (k, n)."""
        return fly_batch(_counts(gains), self._models(model, len(gains)), _TARGET, self._samples)

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
        return fly_disturbed(_counts(gains), self._models(model, len(gains)), _TARGET, disturbances)

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """Check for products that can wrap, exactly, and simulate takeoffs.

        The takeoffs are checked for altitude, divergence, oscillation and aborts. Takes a tenth of a second; repeated
        questions are answered from a cache.
        """
        safe_gains = self.space.vector(envelope.safe_gains)
        return _hazards(
            tuple(gains.tolist()),
            tuple(safe_gains.tolist()),
            envelope.ceiling_m,
            spread,
            self.model_parameters,
            self._samples,
        )

    def sketches(self, gains: Matrix, models: Matrix, until_s: float) -> Sketches:
        """Simulate every policy on every model until `until_s`, which must exceed 5 s, or to the end of the window:
        gains (c, 3), models (k, m)."""
        until_s = min(until_s, self.window_s)
        samples = round(until_s * RATE_HZ)
        runs = np.repeat(_counts(gains), len(models), axis=0), np.tile(models, (len(gains), 1))
        altitude = fly_batch(*runs, _TARGET, samples)[:, ::_SKETCH_EVERY]
        rate_hz = RATE_HZ / _SKETCH_EVERY
        deviations = np.abs(TARGET_M - altitude)
        end = deviations[:, -round(_SKETCH_END_S * rate_hz) :].mean(axis=1) * (self.window_s - until_s)
        return Sketches(
            errors=_by_policy((deviations.sum(axis=1) / rate_hz + end) / self.window_s, gains),
            highest_m=_by_policy(altitude.max(axis=1), gains),
            lowest_m=_by_policy(altitude[:, round(SETTLED_S * rate_hz) :].min(axis=1), gains),
        )

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute altitude error, m, over the window: (k, n) → (k,)."""
        return mean_absolute_errors(self.grid_s, outputs, self.set_point, 0.0, self.window_s)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight. Raises TrajectoryError if it has gaps or does not cover the window."""
        require_scorable(trajectory, self.output, 0.0, self.window_s, accept_gaps=accept_gaps)
        return mean_absolute_error(trajectory.time_s, trajectory[self.output], self.set_point, 0.0, self.window_s)

    def _models(self, model: Matrix | Vector, runs: int) -> Matrix:
        return np.ascontiguousarray(np.broadcast_to(model, (runs, len(self.model_parameters))))


def _by_policy(runs: Vector, gains: Matrix) -> Matrix:
    return runs.reshape(len(gains), -1)


@lru_cache(maxsize=64)
def _hazards(
    gains: tuple[float, ...],
    safe_gains: tuple[float, ...],
    ceiling_m: float,
    spread: ParameterDistribution,
    parameters: tuple[ModelParameter, ...],
    samples: int,
) -> tuple[Check, ...]:
    takeoff = Takeoff(parameters)
    counts, safe_counts = _counts(np.array(gains)), _counts(np.array(safe_gains))
    models = spread.sample(takeoff, MODELS)
    baseline = gains == tuple(takeoff.space.default.tolist())
    return (
        *check_wrapping(counts, models[0], _TARGET),
        *check_flights(counts, safe_counts, baseline, parameters, models, ceiling_m, _TARGET, samples),
    )


def _counts(gains: Vector) -> Counts:
    return np.ascontiguousarray(np.rint(gains), dtype=np.int64)


_PAPER: Final = Takeoff()


def _copter_gain(name: str, title: str, unit: str, lower: float, upper: float, default: float) -> Gain:
    return Gain(name, title, unit, lower=lower, upper=upper, scale=upper / 10, default=default, integer=False)


ARDUPILOT_GAINS: Final = (
    _copter_gain("PSC_POSZ_P", "Climb rate per altitude error", "1/s", 0.1, 4.0, 1.0),
    _copter_gain("PSC_VELZ_P", "Acceleration per climb rate error", "1/s", 0.5, 10.0, 5.0),
    _copter_gain("PSC_ACCZ_P", "Thrust per acceleration error", "10 %·s²/m", 0.05, 2.0, 0.5),
    _copter_gain("PSC_ACCZ_I", "Thrust per integrated acceleration error", "10 %·s/m", 0.0, 4.0, 1.0),
    _copter_gain("PSC_ACCZ_D", "Thrust per change of acceleration error", "10 %·s³/m", 0.0, 0.4, 0.0),
)
"""Names and defaults before release 4.7; from 4.7 on the names differ, and the acceleration gains are a tenth."""

PX4_GAINS: Final = (
    _copter_gain("MPC_Z_P", "Climb rate per altitude error", "1/s", 0.1, 1.5, 1.0),
    _copter_gain("MPC_Z_VEL_P_ACC", "Acceleration per climb rate error", "1/s", 2.0, 15.0, 4.0),
    _copter_gain("MPC_Z_VEL_I_ACC", "Acceleration per integrated climb rate error", "1/s²", 0.2, 3.0, 2.0),
    _copter_gain("MPC_Z_VEL_D_ACC", "Acceleration per measured acceleration", "1", 0.0, 2.0, 0.0),
)


class CopterTakeoff:
    """The paper's takeoff, manoeuvre and score, with the gains of another autopilot."""

    options: Final = OPTIONS
    modelled: Final = None
    output: Final = _PAPER.output
    integrates: Final = _PAPER.integrates
    error_unit: Final = _PAPER.error_unit

    def __init__(self, name: str, autopilot: str, gains: tuple[Gain, ...], *, paper: Takeoff = _PAPER) -> None:
        self.name: Final = name
        self.title: Final = f"{paper.title} under {autopilot}"
        self.space: Final = PolicySpace(gains)
        self.window_s: Final = paper.window_s
        self.scatter: Final = _scatter(paper.window_s, degrees_of_freedom=1.0, measured=False)
        """That of the paper's drone, as none was measured; under PX4 one flight scattered three times as much."""
        self._autopilot: Final = autopilot
        self._paper: Final = paper

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The takeoff with another window; itself if that is its own."""
        paper = self._paper.configured(options)
        return self if paper is self._paper else type(self)(self.name, self._autopilot, self.space.gains, paper=paper)

    @property
    def grid_s(self) -> Samples:
        """The same as the paper's takeoff."""
        return self._paper.grid_s

    def set_point(self, time_s: Samples) -> Samples:
        """3 m from the command on."""
        return self._paper.set_point(time_s)

    def errors(self, outputs: Matrix) -> Vector:
        """Mean absolute altitude error, m, over the window: (k, n) → (k,)."""
        return self._paper.errors(outputs)

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """The same for a recorded flight. Raises TrajectoryError if it has gaps or does not cover the window."""
        return self._paper.error(trajectory, accept_gaps=accept_gaps)


TAKEOFF_ARDUPILOT: Final = CopterTakeoff("takeoff-ardupilot", "ArduCopter", ARDUPILOT_GAINS)
TAKEOFF_PX4: Final = CopterTakeoff("takeoff-px4", "PX4", PX4_GAINS)
