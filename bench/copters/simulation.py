"""Flights of 2 m steps: the replica of ArduCopter's loop around a vehicle that differs from the model of the analysis.

Its thrust is a polynomial of the throttle and falls with the battery, its drag has a quadratic part, its motors have a
dead time beside their lag, gusts shake it, and the estimator's altitude and climb rate wander.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import lfilter

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.kernels import kernel
from app.core.models.copter import GRAVITY_M_S2, Copter, accelerometer_filter
from app.core.records.trajectory import Samples

FILTER_HZ: Final = 20.0
SETTLE_S: Final = 4.0
STEP_LASTS_S: Final = 6.5
HEIGHT_M: Final = 5.0
CLIMB_M: Final = 2.0
_STEPS: Final = round((SETTLE_S + 2 * STEP_LASTS_S) / STEP_S)
_ROW_EVERY: Final = 40
_SCORED_FROM: Final = round(SETTLE_S / STEP_S)

_CLIMB_RATE_WANDER_S, _ALTITUDE_WANDER_S = 3.0, 5.0

# Indices of a packed vehicle.
_HOVER, _QUADRATIC, _LAG_GAIN, _DRAG, _DRAG_QUADRATIC, _SAG, _DEAD_STEPS = range(7)

# Columns of the flown steps.
_Z, _V, _A, _Z_D, _V_D, _A_D, _V_T, _THROTTLE, _FILTERED = range(9)


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedCopter:
    """A vehicle and its surroundings: `quadratic` is the share of u² in its thrust, `sag` the thrust lost in 33 s,
    `gust_m_s2`, `noise_m_s2`, `wander_m_s` and `wander_m` are standard deviations, and gusts decay within `gust_s`."""

    hover_throttle: float
    assumed_hover_throttle: float
    quadratic: float
    motor_lag_s: float
    dead_time_s: float
    drag_1_s: float
    drag_1_m: float
    sag: float
    gust_m_s2: float
    noise_m_s2: float
    wander_m_s: float
    wander_m: float
    gust_s: float = 0.5

    @property
    def thrust_slope(self) -> float:
        """Slope of log thrust over log throttle in hover."""
        linear, square = (1.0 - self.quadratic) * self.hover_throttle, self.quadratic * self.hover_throttle**2
        return (linear + 2.0 * square) / (linear + square)

    @property
    def linear(self) -> Copter:
        """The model closest to it in hover, with the dead time as lag."""
        return Copter(
            hover_throttle=self.hover_throttle,
            thrust_slope=self.thrust_slope,
            motor_lag_s=self.motor_lag_s + self.dead_time_s,
            drag_1_s=self.drag_1_s,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFlight:
    """A flight of the steps: mean distance between reference and estimated altitude, m, throttle activity as in the
    analysis, and the log with ten rows a second."""

    error_m: float
    activity: float
    log: LoggedFlight


def sample(random: np.random.Generator) -> SimulatedCopter:
    """Draw a vehicle."""
    hover = float(random.uniform(0.15, 0.6))
    return SimulatedCopter(
        hover_throttle=hover,
        assumed_hover_throttle=float(np.clip(hover * random.uniform(0.75, 1.3), 0.125, 0.6875)),
        quadratic=float(random.uniform(-0.3, 0.6)),
        motor_lag_s=float(random.uniform(0.02, 0.12)),
        dead_time_s=float(random.uniform(0.0, 0.01)),
        drag_1_s=float(random.uniform(0.1, 0.4)),
        drag_1_m=float(random.uniform(0.0, 0.1)),
        sag=float(random.uniform(0.0, 0.04)),
        gust_m_s2=float(random.uniform(0.03, 0.4)),
        noise_m_s2=float(random.uniform(0.02, 0.3)),
        wander_m_s=float(random.uniform(0.005, 0.03)),
        wander_m=float(random.uniform(0.005, 0.03)),
    )


def fly_steps(copter: SimulatedCopter, parameters: Parameters, *, seed: int) -> StepFlight:
    """Hover at 5 m, climb 2 m and descend again, in the weather of `seed`."""
    targets = np.full(_STEPS, HEIGHT_M)
    targets[_SCORED_FROM : _SCORED_FROM + round(STEP_LASTS_S / STEP_S)] += CLIMB_M
    flown = fly_targets(copter, parameters, targets, seed=seed)
    scored = flown[_SCORED_FROM:]
    rows = flown[::_ROW_EVERY]
    segment = Segment(
        time_s=np.asarray(STEP_S * np.arange(0, _STEPS, _ROW_EVERY), dtype=np.float64),
        z_m=rows[:, _Z],
        v_m_s=rows[:, _V],
        a_m_s2=rows[:, _A],
        z_d_m=rows[:, _Z_D],
        v_d_m_s=rows[:, _V_D],
        a_d_m_s2=rows[:, _A_D],
        v_t_m_s=rows[:, _V_T],
        throttle=rows[:, _THROTTLE],
        throttle_filtered=rows[:, _FILTERED],
        assumed_hover=np.full(len(rows), parameters.hover_throttle),
    )
    return StepFlight(
        error_m=float(np.abs(scored[:, _Z_D] - scored[:, _Z]).mean()),
        activity=float(np.std(scored[:, _THROTTLE] - scored[:, _FILTERED])),
        log=LoggedFlight(loop=loop_of(parameters), segments=[segment]),
    )


def fly_targets(copter: SimulatedCopter, parameters: Parameters, targets: Samples, *, seed: int) -> Samples:
    """Fly along these targets, shape (n,), from hover at the first of them: shape (n, 9), with the columns altitude,
    climb rate and acceleration as measured, the same as desired, the climb rate target, and the throttle as demanded
    and as filtered."""
    p = loop.packed(parameters)
    state, flown = np.empty(loop.STATE_SIZE), np.empty((len(targets), 9))
    loop.start_hover(state, p, copter.hover_throttle, float(targets[0]), 0.0, 0.0)
    numerator, denominator = accelerometer_filter(FILTER_HZ, STEP_S)
    _fly(
        state,
        p,
        packed(copter, STEP_S),
        weather_of(copter, seed, len(targets), STEP_S),
        targets,
        np.concatenate([numerator, denominator]),
        flown,
    )
    return flown


def loop_of(parameters: Parameters) -> ArduPilotLoop:
    """The loop of every flight, with these parameters."""
    return ArduPilotLoop(parameters=parameters, filter_hz=FILTER_HZ, step_s=STEP_S)


def packed(copter: SimulatedCopter, step_s: float) -> Samples:
    """Constants of `move` for steps of this duration."""
    return np.array([
        copter.hover_throttle,
        copter.quadratic,
        step_s / (step_s + copter.motor_lag_s),
        copter.drag_1_s,
        copter.drag_1_m,
        copter.sag / 33.0,
        round(copter.dead_time_s / step_s),
    ])  # fmt: skip


def weather_of(
    copter: SimulatedCopter,
    seed: int,
    steps: int,
    step_s: float,
    *,
    climb_rate_wander_s: float = _CLIMB_RATE_WANDER_S,
) -> Samples:
    """Gust, noise of the accelerometer, errors of the estimated climb rate and altitude at each step, shape (n, 4)."""
    random = np.random.default_rng(seed)
    slow = (
        (copter.gust_m_s2, copter.gust_s),
        (copter.wander_m_s, climb_rate_wander_s),
        (copter.wander_m, _ALTITUDE_WANDER_S),
    )
    gust, climb_rate, altitude = (deviation * coloured(random, steps, step_s / time_s) for deviation, time_s in slow)
    noise, _ = lfilter(*accelerometer_filter(FILTER_HZ, step_s), random.standard_normal(steps), zi=np.zeros(2))
    return np.column_stack([gust, copter.noise_m_s2 * noise / noise.std(), climb_rate, altitude])


def coloured(random: np.random.Generator, steps: int, step: float) -> Samples:
    """Noise of standard deviation 1, correlated over the time of which a step is the share `step`."""
    kept = float(np.exp(-step))
    drive = np.sqrt(1.0 - kept**2) * random.standard_normal(steps)
    values, _ = lfilter([1.0], [1.0, -kept], drive, zi=[kept * random.standard_normal()])
    return np.asarray(values)


@kernel
def move(moving: Samples, copter: Samples, command: float, time_s: float, gust: float, dt: float) -> float:
    """Move the vehicle by a step of `dt` with this throttle, `time_s` into the flight; returns its acceleration."""
    hover, quadratic = copter[0], copter[1]
    weight = (1.0 - quadratic) * hover + quadratic * hover * hover
    moving[0] += copter[2] * (command - moving[0])
    lagged, v = moving[0], moving[2]
    thrust = ((1.0 - quadratic) * lagged + quadratic * lagged * lagged) / weight * (1.0 - copter[5] * time_s)
    a: float = GRAVITY_M_S2 * (thrust - 1.0) - copter[3] * v - copter[4] * v * abs(v) + gust
    moving[2] += dt * a
    moving[1] += dt * moving[2]
    return a


@kernel
def _fly(
    state: loop.State,
    p: loop.Packed,
    copter: Samples,
    weather: Samples,
    targets: Samples,
    accelerometer: Samples,
    flown: Samples,
) -> None:
    hover = copter[0]
    moving = np.array([hover, targets[0], 0.0])
    sensed, memory_1, memory_2 = 0.0, 0.0, 0.0
    b, a_filter = accelerometer[:3], accelerometer[3:]
    for row in range(len(targets)):
        filtered = state[loop.THROTTLE_FILTERED]
        filtered += p[loop.THROTTLE_GAIN] * (state[loop.THROTTLE] - filtered)
        measured_z, measured_v = moving[1] + weather[row, 3], moving[2] + weather[row, 2]
        measured_a = sensed + weather[row, 1]
        loop.shape(state, p, targets[row])
        loop.control(state, p, measured_z, measured_v, measured_a, filtered <= 0.0, filtered >= 1.0)
        flown[row, 0], flown[row, 1], flown[row, 2] = measured_z, measured_v, measured_a
        flown[row, 3], flown[row, 4], flown[row, 5] = state[loop.Z_D], state[loop.V_D], state[loop.A_D]
        flown[row, 6] = state[loop.V_T]
        flown[row, 7], flown[row, 8] = state[loop.THROTTLE], state[loop.THROTTLE_FILTERED]
        late = row - int(copter[6])
        command = flown[late, 8] if late >= 0 else hover
        a = move(moving, copter, command, row * p[loop.DT], weather[row, 0], p[loop.DT])
        sensed = b[0] * a + memory_1
        memory_1 = b[1] * a - a_filter[1] * sensed + memory_2
        memory_2 = b[2] * a - a_filter[2] * sensed
