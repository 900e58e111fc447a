"""The simple vertical model of a multicopter, and its takeoff under the autopilot's vertical loop.

Force, mass, gravity (the paper's eq. 7), with refinements that are zero in the nominal model:

    z̈ = g·(T/W − 1) − drag·ż,   T/W = ((1 − q)·u + q·u²) / ((1 − q)·h + q·h²) · (1 + e·exp(−z/0.4 m)) · (1 − s·t/33 s),

where u is the commanded share of full thrust after a first-order lag, h the hover throttle, q the quadratic share of
thrust, e the ground effect, s the battery sag; altitude z is up from the ground at 0; explicit Euler at 512 Hz. The
loop senses altitude and climb rate with a measurement delay; the delayed values are also those recorded and scored. The
loop starts a latency after the command, from rest on the ground; until then nothing moves, so the latency shifts the
whole run in time. Both delays are interpolated to fractions of a step, so that the outputs depend on them continuously,
as a fit requires.

The takeoff can also be run with the disturbances of a recorded flight added inside the control loop: the paper's step 4
(Abbeel et al. 2006): f(s, a) + s_{t+1} − f(s_t, a_t), indexed by time; s is altitude and climb rate, a the thrust
command, whose lagged value follows from the commands. The loop is entered at the first thrust of the recorded flight.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.paparazzi import (
    ALT,
    FB_CMD,
    FF_CMD,
    FULL_THRUST,
    LARGEST_PRODUCT,
    LEVEL,
    POSITION_BITS,
    RATE_HZ,
    SPEED_BITS,
    STATE_SIZE,
    STEP_S,
    Z_REF,
    State,
    detect_flight,
    measured,
    start,
    step,
)
from app.core.kernels import kernel
from app.core.records.trajectory import Samples

GRAVITY_M_S2: Final = 9.81

HOVER_THROTTLE: Final = 0
START_LATENCY_S: Final = 1
MOTOR_LAG_S: Final = 2
DRAG_1_S: Final = 3
QUADRATIC_SHARE: Final = 4
GROUND_EFFECT: Final = 5
MEASUREMENT_DELAY_S: Final = 6
BATTERY_SAG: Final = 7
"""Indices in a model vector."""

GROUND_EFFECT_HEIGHT_M: Final = 0.4
BATTERY_SAG_S: Final = 33.0
"""Time in which a flight reaches the full sag."""

CHANNELS: Final = ("altitude_m", "climb_rate_m_s", "reference_m", "thrust", "feed_forward", "feedback")

Counts = NDArray[np.int64]


@kernel
def delay_by(signal: Samples, steps: float) -> None:
    """Delay a signal by a fractional number of steps, in place; before its first sample it was at rest at 0."""
    whole = int(steps)
    part = steps - whole
    for i in range(len(signal) - 1, -1, -1):
        late = signal[i - whole] if i >= whole else 0.0
        later = signal[i - whole - 1] if i > whole else 0.0
        signal[i] = (1.0 - part) * late + part * later


@kernel
def sensed(history: Samples, step: int, delay_steps: float) -> float:
    """Value of a signal a fractional number of steps before `step`; before its first sample it was at rest at 0.

    `history` is a ring buffer of its latest values.
    """
    whole = int(delay_steps)
    part = delay_steps - whole
    size = len(history)
    late = history[(step - whole) % size] if step >= whole else 0.0
    later = history[(step - whole - 1) % size] if step > whole else 0.0
    return (1.0 - part) * late + part * later


@kernel
def decay(x: float) -> float:
    """exp(−x) for x ≥ 0, accurate to 1e-13.

    Multiplications only, so identical on every machine, and vectorisable over runs.
    """
    part = max(-x, -64.0) * (1 / 128)
    power = 1.0 + part * (1.0 + part * (1 / 2 + part * (1 / 6 + part * (1 / 24 + part * (1 / 120 + part * (1 / 720))))))
    power *= power
    power *= power
    power *= power
    power *= power
    power *= power
    power *= power
    return power * power


@kernel
def lift_of(
    thrust: float, altitude: float, seconds: float, share: float, ground: float, sag: float, hover_force: float
) -> float:
    """Thrust of the rotors in units of weight; `hover_force` is the force at hover throttle, a share of full force."""
    ratio = ((1.0 - share) * thrust + share * thrust * thrust) / hover_force
    if ground > 0.0:
        ratio *= 1.0 + ground * decay(altitude * (1.0 / GROUND_EFFECT_HEIGHT_M))
    return ratio * (1.0 - sag * (1.0 / BATTERY_SAG_S) * seconds)


@kernel
def thrust_to_weight(thrust: float, altitude: float, seconds: float, model: Samples, hover_force: float) -> float:
    """The same with a model vector, shape (8,)."""
    return lift_of(
        thrust, altitude, seconds, model[QUADRATIC_SHARE], model[GROUND_EFFECT], model[BATTERY_SAG], hover_force
    )


@kernel
def advance(altitude: float, climb: float, thrust_to_weight: float, drag: float) -> tuple[float, float]:
    """One explicit Euler step; the ground at 0 stops a descent."""
    acceleration = GRAVITY_M_S2 * (thrust_to_weight - 1.0) - drag * climb
    altitude += climb * STEP_S
    climb += acceleration * STEP_S
    if altitude <= 0.0:
        return 0.0, max(climb, 0.0)
    return altitude, climb


@kernel
def _write_detail(detail: Samples, i: int, climb: float, command: int, state: State) -> None:
    detail[0, i] = climb
    detail[1, i] = -state[Z_REF] / (1 << POSITION_BITS)
    detail[2, i] = command / FULL_THRUST
    detail[3, i] = state[FF_CMD] / FULL_THRUST
    detail[4, i] = state[FB_CMD] / FULL_THRUST


@kernel
def rollout(gains: Counts, model: Samples, target: int, state: State, altitude: Samples, detail: Samples) -> int:
    """Fly one takeoff to `target` (8 fractional bits) and return the largest |product| in the loop.

    `gains` holds kp, ki, kd; `model` the eight parameters. Writes `altitude`, shape (n,), every 1/512 s from the
    command on, and the other `CHANNELS` to `detail`, shape (5, n), or (5, 0) to omit them. `state` is scratch.
    """
    kp, ki, kd = gains[0], gains[1], gains[2]
    share, hover, lag, latency = (
        model[QUADRATIC_SHARE],
        model[HOVER_THROTTLE],
        model[MOTOR_LAG_S],
        model[START_LATENCY_S],
    )
    hover_force = (1.0 - share) * hover + share * hover * hover
    response = STEP_S / lag if lag > STEP_S else 1.0
    delay = model[MEASUREMENT_DELAY_S] * RATE_HZ
    heights = np.zeros(int(delay) + 2 if delay > 0.0 else 0)
    climbs = np.zeros_like(heights)
    height, climb, thrust, command = 0.0, 0.0, 0.0, 0
    start(state, 0, 0)
    for i in range(len(altitude)):
        sensed_height, sensed_climb = height, climb
        if delay > 0.0:
            heights[i % len(heights)], climbs[i % len(heights)] = height, climb
            sensed_height, sensed_climb = sensed(heights, i, delay), sensed(climbs, i, delay)
        in_flight = detect_flight(state, command)
        z, zd = measured(-sensed_height, POSITION_BITS), measured(-sensed_climb, SPEED_BITS)
        command = step(state, ALT, target, kp, ki, kd, z, zd, LEVEL, in_flight)
        altitude[i] = sensed_height
        if detail.shape[1] > 0:
            _write_detail(detail, i, sensed_climb, command, state)
        thrust += response * (command / FULL_THRUST - thrust)
        lift = thrust_to_weight(thrust, height, i * STEP_S + latency, model, hover_force)
        height, climb = advance(height, climb, lift, model[DRAG_1_S])
    if latency > 0.0:
        delay_by(altitude, latency * RATE_HZ)
        for channel in range(detail.shape[0] if detail.shape[1] > 0 else 0):
            delay_by(detail[channel], latency * RATE_HZ)
    return int(state[LARGEST_PRODUCT])


@kernel
def rollouts(gains: Counts, models: Samples, target: int, state: State, altitude: Samples, no_detail: Samples) -> None:
    """Fly k takeoffs: gains (k, 3), models (k, 8), altitude out (k, n); `no_detail` has shape (5, 0)."""
    for run in range(len(gains)):
        rollout(gains[run], models[run], target, state, altitude[run], no_detail)


def fly(gains: Counts, model: Samples, target: int, samples: int) -> tuple[Samples, int]:
    """One takeoff with every channel: shape (6, samples) in the order of `CHANNELS`, and the largest |product|."""
    channels = np.empty((len(CHANNELS), samples))
    largest = rollout(gains, model, target, np.empty(STATE_SIZE, dtype=np.int64), channels[0], channels[1:])
    return channels, largest


ALTITUDE: Final = 0
CLIMB_RATE: Final = 1
ENTERED: Final = 2
COLUMNS: Final = 3
"""Columns of the disturbances: of altitude (m) and climb rate (m/s) in the next step, and whether the loop is
entered."""

_NEVER: Final = 1 << 30


@kernel
def _hover_force(model: Samples) -> float:
    share, hover = model[QUADRATIC_SHARE], model[HOVER_THROTTLE]
    force: float = (1.0 - share) * hover + share * hover * hover
    return force


@kernel
def _observe(altitude: Samples, climb: Samples, thrust: Samples, model: Samples, found: Samples) -> None:
    hover_force, lag = _hover_force(model), model[MOTOR_LAG_S]
    response = STEP_S / lag if lag > STEP_S else 1.0
    lagged, entered = 0.0, 0.0
    for i in range(len(altitude)):
        if thrust[i] > 0.0:
            entered = 1.0
        found[i, ENTERED] = entered
        if i + 1 == len(altitude):
            break
        lagged += response * (thrust[i] - lagged)
        lift = thrust_to_weight(lagged, altitude[i], i * STEP_S, model, hover_force)
        height, speed = advance(altitude[i], climb[i], lift, model[DRAG_1_S])
        found[i, ALTITUDE], found[i, CLIMB_RATE] = altitude[i + 1] - height, climb[i + 1] - speed


@kernel
def _rollout(gains: Counts, model: Samples, target: int, state: State, added: Samples, altitude: Samples) -> None:
    hover_force, lag = _hover_force(model), model[MOTOR_LAG_S]
    response = STEP_S / lag if lag > STEP_S else 1.0
    height, climb, thrust, command = 0.0, 0.0, 0.0, 0
    entered_at = _NEVER
    for i in range(len(altitude)):
        z, zd = measured(-height, POSITION_BITS), measured(-climb, SPEED_BITS)
        if entered_at == _NEVER and added[i, ENTERED] > 0.0:
            start(state, z, zd)
            entered_at = i
        if i >= entered_at:
            in_flight = detect_flight(state, command)
            command = step(state, ALT, target, gains[0], gains[1], gains[2], z, zd, LEVEL, in_flight)
        altitude[i] = height
        thrust += response * (command / FULL_THRUST - thrust)
        lift = thrust_to_weight(thrust, height, i * STEP_S, model, hover_force)
        height, climb = advance(height, climb, lift, model[DRAG_1_S])
        height += added[i, ALTITUDE]
        climb += added[i, CLIMB_RATE]


@kernel
def _rollouts(gains: Counts, models: Samples, target: int, state: State, added: Samples, altitude: Samples) -> None:
    for run in range(len(gains)):
        _rollout(gains[run], models[run], target, state, added, altitude[run])


def observe(altitude_m: Samples, climb_rate_m_s: Samples, thrust: Samples, model: Samples) -> Samples:
    """Disturbances of a flight recorded at 512 Hz, channels of shape (n,): (n, 3), see `COLUMNS`.

    The model's latency and measurement delay are ignored: the recorded values are taken as the state.
    """
    found = np.zeros((len(altitude_m), COLUMNS))
    _observe(altitude_m, climb_rate_m_s, thrust, model, found)
    return found


def fly_batch(gains: Counts, models: Samples, target: int, disturbances: Samples) -> Samples:
    """Many disturbed takeoffs in one call: gains (k, 3), models (k, 8), disturbances (n, 3) → altitude (k, n)."""
    altitude = np.empty((len(gains), len(disturbances)))
    _rollouts(gains, models, target, np.empty(STATE_SIZE, dtype=np.int64), disturbances, altitude)
    return altitude
