"""Flights under the replicas of ArduCopter's and PX4's loops, in which one cause at a time may be severe.

Vibration is that of the motors, far above the rate of the loop: sampled at 1 kHz within the accelerometer's range,
aliased, filtered, and integrated by the estimator with a bias that grows with it. A wound-up integral comes from a
takeoff in which the ground holds the vehicle for some time; the estimator jumps as its barometer or its GPS resets.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from app.autopilots.ardupilot.replica import parameters as ardupilot
from app.autopilots.ardupilot.replica import vertical as ardupilot_loop
from app.autopilots.px4.replica import parameters as px4
from app.autopilots.px4.replica import vertical as px4_loop
from app.core.kernels import kernel
from app.core.models.copter import GRAVITY_M_S2, accelerometer_filter
from app.core.records.trajectory import Samples
from bench.copters import px4_simulation, simulation
from bench.copters.simulation import SimulatedCopter, coloured, move, packed, weather_of

Autopilot = Literal["ardupilot", "px4"]

STEP_S: Final[Mapping[Autopilot, float]] = {"ardupilot": ardupilot.STEP_S, "px4": px4.STEP_S}
_MOVES: Final[Mapping[Autopilot, int]] = {"ardupilot": 1, "px4": 2}
_WANDERS_S: Final[Mapping[Autopilot, float]] = {"ardupilot": 3.0, "px4": 0.6}
"""Within which the error of the estimated climb rate changes."""
_ROW_S: Final = 0.1
ARMED_S: Final = 2.0
"""On the ground before the throttle rises."""
_RAMPED_S: Final = 3.0
_IMU_HZ: Final = 1000.0
_IMU_RANGE_M_S2: Final = 16.0 * GRAVITY_M_S2
_CORRECTED_S: Final = 1.5
"""Within which the estimator corrects what it integrated."""
_ESTIMATED_S: Final = 3.0
"""Within which PX4 finds the hover throttle in flight."""
_HOVER_RANGE: Final = 0.2
_FREQUENCIES_HZ: Final = (0.25, 2.5)

# Columns of a flown step.
Z, V, A, Z_D, THROTTLE, DEMANDED, TRUE_Z, _TRUE_V, INTEGRAL = range(9)


@dataclass(frozen=True, slots=True, kw_only=True)
class Jump:
    """The estimate changes at a time by an altitude and a climb rate; a filter takes back the second within 1 s. The
    autopilot may move its reference with it."""

    at_s: float
    by_m: float
    by_m_s: float
    moves_reference: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """What is flown: a vehicle under a loop with these gains, as factors on the defaults, along targets from these
    times on, s. One with `held_down_s` takes off, and the ground lets go of it so long after it could lift itself."""

    autopilot: Autopilot
    copter: SimulatedCopter
    seed: int
    targets: tuple[tuple[float, float], ...]
    lasts_s: float
    climb_m_s: float = 2.5
    gains: Mapping[str, float] = field(default_factory=dict)
    held_down_s: float | None = None
    jump: Jump | None = None
    vibration_m_s2: float = 0.0
    vibration_hz: float = 100.0
    row_s: float = _ROW_S


@dataclass(frozen=True, slots=True)
class Flown:
    """A flight as flown: at each step of the loop, shape (n, 9), altitude, climb rate and acceleration as estimated,
    the altitude of the reference, throttle as sent and as demanded, altitude and climb rate, and the acceleration of
    the integral beyond the weight; and the noise of the accelerometer and the gusts at each move."""

    steps: Samples
    noise_m_s2: Samples
    gust_m_s2: Samples


def fly(flight: Flight) -> Flown:
    """Fly it."""
    step_s, moves = STEP_S[flight.autopilot], _MOVES[flight.autopilot]
    steps = round(flight.lasts_s / step_s)
    weather = weather_of(
        flight.copter, flight.seed, moves * steps, step_s / moves, climb_rate_wander_s=_WANDERS_S[flight.autopilot]
    )
    noise_m_s2 = np.zeros(moves * steps)
    if flight.vibration_m_s2:
        noise_m_s2 = _vibration(flight, moves * steps, step_s / moves)
        gain = step_s / moves / _CORRECTED_S
        drift_m_s = lfilter([step_s / moves], [1.0, gain - 1.0], noise_m_s2)
        weather += np.column_stack([
            np.zeros_like(drift_m_s), noise_m_s2, drift_m_s, lfilter([step_s / moves], [1.0, gain - 1.0], drift_m_s)
        ])  # fmt: skip
    times_s = step_s * np.arange(steps)
    changes_s, altitudes_m = np.array(flight.targets).T
    target_m = altitudes_m[np.searchsorted(changes_s, times_s, side="right") - 1]
    if (jump := flight.jump) is not None:
        since_s = step_s / moves * np.arange(moves * steps) - jump.at_s
        after = since_s >= 0.0
        weather[:, 3] += jump.by_m * after
        weather[:, 2] += jump.by_m_s * after * np.exp(-np.maximum(since_s, 0.0))
        target_m = target_m + jump.by_m * jump.moves_reference * (times_s >= jump.at_s)
    flown = _LOOPS[flight.autopilot](flight, weather, target_m)
    return Flown(flown, noise_m_s2 + weather[:, 1] * (not flight.vibration_m_s2), weather[:, 0])


def _vibration(flight: Flight, steps: int, step_s: float) -> Samples:
    """Noise of the accelerometer at each step, shape (n,): the blades pass at a frequency that changes with the
    throttle, and twice in a turn; the sensor's range ends, and its mean rises with the square of what shakes it."""
    random = np.random.default_rng((flight.seed, 1))
    count = round(steps * step_s * _IMU_HZ)
    frequency_hz = flight.vibration_hz * (1.0 + 0.05 * coloured(random, count, 1.0 / _IMU_HZ / 0.5))
    phase = 2.0 * np.pi * np.cumsum(frequency_hz) / _IMU_HZ
    strength_m_s2 = flight.vibration_m_s2 * (1.0 + 0.2 * coloured(random, count, 1.0 / _IMU_HZ / 2.0))
    shaken = strength_m_s2 * (np.sin(phase) + 0.4 * np.sin(2.0 * phase + 1.0) + 0.3 * random.standard_normal(count))
    shaken = np.clip(shaken + GRAVITY_M_S2, -_IMU_RANGE_M_S2, _IMU_RANGE_M_S2) - GRAVITY_M_S2
    shaken += 2e-5 * (strength_m_s2**2 - flight.vibration_m_s2**2)
    filtered = np.asarray(lfilter(*_FILTERS[flight.autopilot], shaken))
    return np.asarray(filtered[np.minimum((np.arange(steps) * step_s * _IMU_HZ).astype(int), count - 1)])


_FILTERS: Final[Mapping[Autopilot, tuple[Samples, Samples]]] = {
    "ardupilot": accelerometer_filter(simulation.FILTER_HZ, 1.0 / _IMU_HZ),
    "px4": (np.full(8, 0.125), np.ones(1)),
}
"""Of what is logged: INS_ACCEL_FILTER, and the mean over 8 ms that PX4's estimator integrates."""


def ardupilot_parameters(flight: Flight) -> ardupilot.Parameters:
    """Of its loop."""
    defaults = ardupilot.DEFAULTS
    given = {name: defaults[name] * factor for name, factor in flight.gains.items()}
    parameters = ardupilot.parameters_from({**given, "WPNAV_SPEED_UP": 100.0 * flight.climb_m_s})
    return replace(parameters, hover_throttle=flight.copter.assumed_hover_throttle)


def px4_parameters(flight: Flight) -> px4.Parameters:
    """Of its loop."""
    given = {name: px4.DEFAULTS[name] * factor for name, factor in flight.gains.items()}
    limits = {"MPC_Z_VEL_MAX_UP": flight.climb_m_s + 1.0, "MPC_THR_HOVER": flight.copter.assumed_hover_throttle}
    return px4.parameters_from({**given, **limits})


def slowest_damped(flight: Flight) -> tuple[float, float]:
    """Damping ratio and frequency, Hz, of the least damped oscillation of the vehicle's linear model about hover within
    the frequencies at which an altitude swings."""
    loop = (
        simulation.loop_of(ardupilot_parameters(flight))
        if flight.autopilot == "ardupilot"
        else px4_simulation.loop_of(px4_parameters(flight))
    )
    modes = np.linalg.eigvals(loop.transition(flight.copter.linear)).astype(np.complex128)
    poles = np.log(modes[np.abs(modes) > 1e-3]) / loop.step_s
    frequency_hz = np.abs(poles) / (2.0 * np.pi)
    slow, fast = _FREQUENCIES_HZ
    swings = (np.abs(poles.imag) > 0.5) & (frequency_hz > slow) & (frequency_hz < fast)
    found = [(float(-pole.real / abs(pole)), float(abs(pole) / 2.0 / np.pi)) for pole in poles[swings]]
    return min(found, default=(1.0, 1.0))


def _fly_ardupilot(flight: Flight, weather: Samples, target_m: Samples) -> Samples:
    p = ardupilot_loop.packed(ardupilot_parameters(flight))
    state, flown = np.empty(ardupilot_loop.STATE_SIZE), np.zeros((len(target_m), 9))
    takes_off = flight.held_down_s is not None
    if takes_off:
        ardupilot_loop.start_takeoff(state, p, ARMED_S)
    else:
        ardupilot_loop.start_hover(state, p, flight.copter.hover_throttle, float(target_m[0]), 0.0, 0.0)
    moving = np.array([0.0 if takes_off else flight.copter.hover_throttle, 0.0 if takes_off else target_m[0], 0.0])
    accelerometer = np.concatenate(accelerometer_filter(simulation.FILTER_HZ, ardupilot.STEP_S))
    held, constants = round((flight.held_down_s or 0.0) / ardupilot.STEP_S), packed(flight.copter, ardupilot.STEP_S)
    _step_ardupilot(state, p, constants, moving, weather, target_m, accelerometer, held, flown)
    return flown


def _fly_px4(flight: Flight, weather: Samples, target_m: Samples) -> Samples:
    parameters, copter = px4_parameters(flight), flight.copter
    p, flown = px4_loop.packed(parameters), np.zeros((len(target_m), 9))
    state = np.empty(px4_loop.STATE_SIZE, dtype=np.float32)
    takes_off = flight.held_down_s is not None
    assumed = parameters.hover_thrust
    found = float(np.clip(copter.hover_throttle, assumed - _HOVER_RANGE, assumed + _HOVER_RANGE))
    if takes_off:
        px4_loop.start(state, p)
    else:
        px4_loop.start_hover(state, p, found, copter.hover_throttle, 0.0)
    shaper = ardupilot_loop.packed(ardupilot.Parameters(climb_m_s=flight.climb_m_s, acceleration_m_s2=2.0), px4.STEP_S)
    reference, begins = np.zeros((len(target_m), 4)), round((ARMED_S + _RAMPED_S) / px4.STEP_S) if takes_off else 0
    shaped_m = np.concatenate([np.zeros(begins), target_m[begins:]])
    ardupilot_loop.shaped(shaper, float(shaped_m[0]), shaped_m, reference)
    if (jump := flight.jump) is not None and jump.moves_reference:
        plain_m = shaped_m - jump.by_m * (px4.STEP_S * np.arange(len(shaped_m)) >= jump.at_s)
        ardupilot_loop.shaped(shaper, float(plain_m[0]), plain_m, reference)
        reference[:, 0] += shaped_m - plain_m
    inputs, outputs = np.zeros((1, len(px4_loop.INPUTS)), np.float32), np.empty((1, len(px4_loop.OUTPUTS)), np.float32)
    given = {"dt_s": px4.STEP_S, "set_new": 1.0, "armed": 1.0, "limit_up_m_s": parameters.climb_m_s}
    for name, value in {**given, "limit_down_m_s": parameters.descent_m_s}.items():
        inputs[0, px4_loop.INPUTS.index(name)] = value
    moving = np.array([0.0 if takes_off else copter.hover_throttle, 0.0 if takes_off else target_m[0], 0.0])
    accelerometer = np.concatenate(accelerometer_filter(simulation.FILTER_HZ, 0.5 * px4.STEP_S))
    held = round((flight.held_down_s or 0.0) / px4.STEP_S)
    hovers = np.array([assumed, found, px4.STEP_S / _ESTIMATED_S, round(ARMED_S / px4.STEP_S) if takes_off else 0])
    constants = packed(copter, 0.5 * px4.STEP_S)
    _step_px4(state, p, constants, moving, weather, reference, inputs, outputs, accelerometer, held, hovers, flown)
    return flown


_LOOPS: Final[Mapping[Autopilot, Callable[[Flight, Samples, Samples], Samples]]] = {
    "ardupilot": _fly_ardupilot,
    "px4": _fly_px4,
}


@kernel
def _step_ardupilot(
    state: ardupilot_loop.State,
    p: ardupilot_loop.Packed,
    copter: Samples,
    moving: Samples,
    weather: Samples,
    targets: Samples,
    accelerometer: Samples,
    held: int,
    flown: Samples,
) -> None:
    hover, grounded, could_lift = copter[0], moving[1] <= 0.0, 0
    sensed, memory_1, memory_2 = 0.0, 0.0, 0.0
    b, a_filter = accelerometer[:3], accelerometer[3:]
    for row in range(len(targets)):
        before = state[ardupilot_loop.THROTTLE_FILTERED]
        filtered = before + p[ardupilot_loop.THROTTLE_GAIN] * (state[ardupilot_loop.THROTTLE] - before)
        z, v, measured_a = moving[1] + weather[row, 3], moving[2] + weather[row, 2], sensed + weather[row, 1]
        if state[ardupilot_loop.PHASE] == ardupilot_loop.FLIGHT:
            ardupilot_loop.shape(state, p, targets[row])
            ardupilot_loop.control(state, p, z, v, measured_a, filtered <= 0.0, filtered >= 1.0)
        elif grounded:  # it feels the ground, which does not move
            ardupilot_loop.take_off(state, p, 0.0, 0.0, 0.0)
        else:
            ardupilot_loop.take_off(state, p, z, v, measured_a)
        sent = state[ardupilot_loop.THROTTLE_FILTERED]
        flown[row, 0], flown[row, 1], flown[row, 2] = z, v, measured_a
        flown[row, 3], flown[row, 4] = state[ardupilot_loop.Z_D], sent
        flown[row, 5], flown[row, 6], flown[row, 7] = state[ardupilot_loop.THROTTLE], moving[1], moving[2]
        integral = p[ardupilot_loop.HOVER] + state[ardupilot_loop.ACCELERATION_SUM] / 1000.0
        flown[row, 8] = 9.80665 * (integral / hover - 1.0)
        late = row - int(copter[6])
        command = flown[late, 4] if late >= 0 else moving[0]
        a = move(
            moving, copter, command, row * p[ardupilot_loop.DT], weather[row, 0] * (not grounded), p[ardupilot_loop.DT]
        )
        if grounded:
            could_lift += moving[1] > 0.0 and moving[2] > 0.0
            if could_lift <= held:
                moving[1] = moving[2] = a = 0.0
            else:
                grounded = False
        sensed = b[0] * a + memory_1
        memory_1 = b[1] * a - a_filter[1] * sensed + memory_2
        memory_2 = b[2] * a - a_filter[2] * sensed


@kernel
def _step_px4(
    state: px4_loop.State,
    p: px4_loop.Packed,
    copter: Samples,
    moving: Samples,
    weather: Samples,
    reference: Samples,
    inputs: NDArray[np.float32],
    outputs: NDArray[np.float32],
    accelerometer: Samples,
    held: int,
    hovers: Samples,
    flown: Samples,
) -> None:
    grounded, could_lift, late, estimate = moving[1] <= 0.0, 0, int(copter[6]), hovers[0]
    if not grounded:
        estimate = hovers[1]
    sensed, memory_1, memory_2 = 0.0, 0.0, 0.0
    b, a_filter = accelerometer[:3], accelerometer[3:]
    move_s = 0.004
    for row in range(len(reference)):
        now = 2 * row
        z, v = moving[1] + weather[now, 3], moving[2] + weather[now, 2]
        if not grounded:
            estimate += hovers[2] * (hovers[1] - estimate)
        inputs[0, 1], inputs[0, 2] = -z, -v
        inputs[0, 4], inputs[0, 5], inputs[0, 6] = -reference[row, 0], -reference[row, 1], -reference[row, 2]
        inputs[0, 8] = np.nan if grounded else estimate
        inputs[0, 10] = inputs[0, 11] = row < hovers[3]
        inputs[0, 12] = row >= hovers[3]
        px4_loop.rollout(state, p, inputs, outputs)
        flown[row, 0], flown[row, 1], flown[row, 2] = z, v, sensed + weather[now, 1]
        flown[row, 3], flown[row, 4], flown[row, 5] = reference[row, 0], state[px4_loop.THRUST], state[px4_loop.THRUST]
        flown[row, 6], flown[row, 7] = moving[1], moving[2]
        integral = state[px4_loop.HOVER_THRUST] * (1.0 - state[px4_loop.INTEGRAL] / 9.80665)
        flown[row, 8] = 9.80665 * (integral / copter[0] - 1.0)
        for part in range(2):
            sent = (now + part - late) // 2
            command = flown[sent, 4] if sent >= 0 else moving[0]
            a = move(moving, copter, command, (now + part) * move_s, weather[now + part, 0] * (not grounded), move_s)
            if grounded:
                could_lift += part == 0 and moving[1] > 0.0 and moving[2] > 0.0
                if could_lift <= held:
                    moving[1] = moving[2] = a = 0.0
                else:
                    grounded = False
            sensed = b[0] * a + memory_1
            memory_1 = b[1] * a - a_filter[1] * sensed + memory_2
            memory_2 = b[2] * a - a_filter[2] * sensed
