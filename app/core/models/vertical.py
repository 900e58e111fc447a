"""The simple vertical model of a multicopter, and its flights under the autopilot's vertical loop.

Force, mass, gravity (the paper's eq. 7), with refinements that are zero in the nominal model:

    z̈ = g·(T/W − 1) − drag·ż,   T/W = ((1 − q)·u + q·u²) / ((1 − q)·h + q·h²) · (1 + e·exp(−z/0.4 m)) · (1 − s·t/33 s),

where u is the commanded share of full thrust after a first-order lag, h the hover throttle, q the quadratic share of
thrust, e the ground effect, s the battery sag; altitude z is up from the ground at 0; explicit Euler at 512 Hz. The
loop senses altitude and climb rate with a measurement delay; the delayed values are also those recorded and scored. The
loop starts a latency after the command, from rest on the ground; until then nothing moves, so the latency shifts the
run in time, up to the first change of the set point: a vehicle that has settled by then follows each later one when it
is commanded, whenever it started. Both delays are interpolated to fractions of a step, so that the outputs depend on
them continuously, as a fit requires.

A flight can also be run with the disturbances of a recorded flight added inside the control loop: the paper's step 4
(Abbeel et al. 2006): f(s, a) + s_{t+1} − f(s_t, a_t), indexed by time; s is altitude and climb rate, a the thrust
command, whose lagged value follows from the commands. The loop is entered at the first thrust of the recorded flight.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_guidance import (
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
from app.core.models.set_points import SetPoints
from app.core.records.trajectory import Samples

GRAVITY_M_S2: Final = 9.81

(
    HOVER_THROTTLE, START_LATENCY_S, MOTOR_LAG_S, DRAG_1_S, QUADRATIC_SHARE, GROUND_EFFECT, MEASUREMENT_DELAY_S,
    BATTERY_SAG,
) = range(8)  # fmt: skip
"""Indices in a model vector."""

GROUND_EFFECT_HEIGHT_M: Final = 0.4
BATTERY_SAG_S: Final = 33.0
"""Time in which a flight reaches the full sag."""

ALTITUDE, CLIMB_RATE = range(2)
"""The first two rows of the channels, columns of the disturbances and entries of a vehicle's state array."""

CHANNELS: Final = ("altitude_m", "climb_rate_m_s", "reference_m", "thrust", "feed_forward", "feedback")

ENTERED, COLUMNS = range(2, 4)
"""Columns of the disturbances: of altitude (m) and climb rate (m/s) in the next step, and whether the loop is
entered."""

THRUST, COMMAND, STEPS_FLOWN, VEHICLE_SIZE = range(2, 6)
"""The other entries of a vehicle's state array: the thrust after the lag (share of full), the last command (counts),
and the steps since the loop was entered."""

Counts = NDArray[np.int64]


@kernel
def delay_by(signal: Samples, steps: float) -> None:
    """Delay a signal by a fractional number of steps, in place; before its first sample it was at rest at 0."""
    whole = int(steps)
    part = steps - whole
    before = np.concatenate((np.zeros(whole + 1), signal))
    signal[:] = (1.0 - part) * before[1 : len(signal) + 1] + part * before[: len(signal)]


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
    for _ in range(7):
        power *= power
    return power


@kernel
def lift_of(
    thrust: float,
    altitude: float,
    seconds: float,
    share: float,
    ground: float,
    ground_height: float,
    sag: float,
    hover_force: float,
) -> float:
    """Thrust of the rotors in units of weight; `hover_force` is the force at hover throttle, a share of full force."""
    ratio = ((1.0 - share) * thrust + share * thrust * thrust) / hover_force
    if ground > 0.0:
        ratio *= 1.0 + ground * decay(altitude * (1.0 / ground_height))
    return ratio * (1.0 - sag * (1.0 / BATTERY_SAG_S) * seconds)


@kernel
def thrust_to_weight(thrust: float, altitude: float, seconds: float, model: Samples, hover_force: float) -> float:
    """The same with a model vector, shape (8,)."""
    return lift_of(
        thrust,
        altitude,
        seconds,
        model[QUADRATIC_SHARE],
        model[GROUND_EFFECT],
        GROUND_EFFECT_HEIGHT_M,
        model[BATTERY_SAG],
        hover_force,
    )


@kernel
def force_at_hover(hover_throttle: float, quadratic_share: float) -> float:
    """Force at hover throttle as a share of full force."""
    return (1.0 - quadratic_share) * hover_throttle + quadratic_share * hover_throttle * hover_throttle


@kernel
def response_of(lag_s: float) -> float:
    """Share of the difference from the commanded thrust that the motors make up in one step."""
    return STEP_S / lag_s if lag_s > STEP_S else 1.0


@kernel
def advance(altitude: float, climb: float, acceleration: float) -> tuple[float, float]:
    """One explicit Euler step; the ground at 0 stops a descent."""
    altitude += climb * STEP_S
    climb += acceleration * STEP_S
    if altitude <= 0.0:
        return 0.0, max(climb, 0.0)
    return altitude, climb


@kernel
def new_past(model: Samples) -> Samples:
    """Buffer for the latest altitudes and climb rates, shape (2, d); d = 0 if the loop senses them without delay."""
    delay = model[MEASUREMENT_DELAY_S] * RATE_HZ
    return np.zeros((2, int(delay) + 2 if delay > 0.0 else 0))


@kernel
def _write_detail(channels: Samples, i: int, climb: float, command: int, state: State) -> None:
    channels[CLIMB_RATE, i] = climb
    channels[2, i] = -state[Z_REF] / (1 << POSITION_BITS)
    channels[3, i] = command / FULL_THRUST
    channels[4, i] = state[FF_CMD] / FULL_THRUST
    channels[5, i] = state[FB_CMD] / FULL_THRUST


@kernel
def fly_steps(
    state: State,
    vehicle: Samples,
    past: Samples,
    model: Samples,
    mode: int,
    targets: Counts,
    gains: Counts,
    disturbances: Samples | None,
    records_sensed: bool,
    ceiling_m: float,
    lands: bool,
    channels: Samples,
) -> int:
    """Fly or continue a flight for up to n steps, and return the steps flown.

    The loop runs in `mode` with `gains` (kp, ki, kd) and the target of each step since its entry, shape (t,), the last
    of which holds. With `disturbances`, shape (n, 3), it is entered
    where they say so, otherwise the caller has entered it. Writes `channels` before each step: what the loop senses if
    `records_sensed`, shape (1, n) or (6, n), else the vehicle's own altitude and climb rate, shape (2, n). Stops early
    above `ceiling_m`, or when a vehicle that `lands` has touched down. `state`, `vehicle` and `past` then hold the
    values after the last step.
    """
    kp, ki, kd, drag = gains[0], gains[1], gains[2], model[DRAG_1_S]
    hover_force = force_at_hover(model[HOVER_THROTTLE], model[QUADRATIC_SHARE])
    response = response_of(model[MOTOR_LAG_S])
    delay, latency, size = model[MEASUREMENT_DELAY_S] * RATE_HZ, model[START_LATENCY_S], past.shape[1]
    altitude, climb, thrust = vehicle[ALTITUDE], vehicle[CLIMB_RATE], vehicle[THRUST]
    command, before, flown = int(vehicle[COMMAND]), int(vehicle[STEPS_FLOWN]), 0
    last_target = len(targets) - 1
    entered = disturbances is None
    for i in range(channels.shape[1]):
        now = before + i
        sensed_altitude, sensed_climb = altitude, climb
        if size > 0:
            past[0, now % size], past[1, now % size] = altitude, climb
            sensed_altitude, sensed_climb = sensed(past[0], now, delay), sensed(past[1], now, delay)
        z, zd = measured(-sensed_altitude, POSITION_BITS), measured(-sensed_climb, SPEED_BITS)
        if disturbances is not None and not entered and disturbances[i, ENTERED] > 0.0:
            start(state, z, zd)
            entered = True
        if entered:
            in_flight = detect_flight(state, command)
            target = targets[min(now, last_target)]
            command = step(state, mode, target, kp, ki, kd, z, zd, LEVEL, in_flight)
        if records_sensed:
            channels[ALTITUDE, i] = sensed_altitude
            if channels.shape[0] > 1:
                _write_detail(channels, i, sensed_climb, command, state)
        else:
            channels[ALTITUDE, i], channels[CLIMB_RATE, i] = altitude, climb
        thrust += response * (command / FULL_THRUST - thrust)
        lift = thrust_to_weight(thrust, altitude, now * STEP_S + latency, model, hover_force)
        altitude, climb = advance(altitude, climb, GRAVITY_M_S2 * (lift - 1.0) - drag * climb)
        if disturbances is not None:
            altitude += disturbances[i, ALTITUDE]
            climb += disturbances[i, CLIMB_RATE]
        flown = i + 1
        if altitude > ceiling_m or (lands and altitude <= 0.0):
            break
    vehicle[ALTITUDE], vehicle[CLIMB_RATE], vehicle[THRUST] = altitude, climb, thrust
    vehicle[COMMAND], vehicle[STEPS_FLOWN] = command, before + flown
    return flown


@kernel
def steps_of_climb(targets: Counts) -> int:
    """Steps until the first change of the targets, shape (t,); t if there is none."""
    for i in range(len(targets)):
        if targets[i] != targets[0]:
            return i
    return len(targets)


@kernel
def delay_start(signal: Samples, targets: Counts, latency_s: float) -> None:
    """Delay the part of a signal before the first change of the targets, all of it if there is none, in place."""
    climb = steps_of_climb(targets)
    delay_by(signal[:climb] if climb < len(targets) else signal, latency_s * RATE_HZ)


@kernel
def rollout(gains: Counts, model: Samples, targets: Counts, disturbances: Samples | None, channels: Samples) -> int:
    """Fly one flight to its `targets` (8 fractional bits, see `SetPoints`); return the largest |product| in the loop.

    `gains` holds kp, ki, kd; `model` the eight parameters; `disturbances` have shape (n, 3). Writes `channels` every
    1/512 s from the command on, in the order of `CHANNELS`: shape (6, n), or (1, n) for the altitude alone.
    """
    state, vehicle = np.zeros(STATE_SIZE, dtype=np.int64), np.zeros(VEHICLE_SIZE)
    start(state, 0, 0)
    fly_steps(state, vehicle, new_past(model), model, ALT, targets, gains, disturbances, True, np.inf, False, channels)
    if model[START_LATENCY_S] > 0.0:
        for channel in range(channels.shape[0]):
            delay_start(channels[channel], targets, model[START_LATENCY_S])
    return int(state[LARGEST_PRODUCT])


def fly(gains: Counts, model: Samples, set_points: SetPoints, samples: int) -> tuple[Samples, int]:
    """One flight with every channel: shape (6, samples) in the order of `CHANNELS`, and the largest |product|."""
    channels = np.empty((len(CHANNELS), samples))
    return channels, rollout(gains, model, set_points.targets, None, channels)


def fly_each(
    gains: Counts, models: Samples, set_points: SetPoints, samples: int, disturbances: Samples | None = None
) -> Samples:
    """Many flights one after another: gains (k, 3), models (k, 8) → altitude (k, samples)."""
    altitude = np.empty((len(gains), 1, samples))
    for run in range(len(gains)):
        rollout(gains[run], models[run], set_points.targets, disturbances, altitude[run])
    return altitude[:, 0]


def fly_disturbed(gains: Counts, models: Samples, set_points: SetPoints, disturbances: Samples) -> Samples:
    """Many disturbed flights: gains (k, 3), models (k, 8), disturbances (n, 3) → altitude (k, n).

    As in `observe`, the model's latency and measurement delay are ignored.
    """
    prompt = models.copy()
    prompt[:, [START_LATENCY_S, MEASUREMENT_DELAY_S]] = 0.0
    return fly_each(gains, prompt, set_points, len(disturbances), disturbances)


def fly_recorded(gains: Counts, model: Samples, set_points: SetPoints, disturbances: Samples) -> Samples:
    """The same for one flight with every channel, shape (6, n): gains (3,), model (8,)."""
    prompt = model.copy()
    prompt[[START_LATENCY_S, MEASUREMENT_DELAY_S]] = 0.0
    channels = np.empty((len(CHANNELS), len(disturbances)))
    rollout(gains, prompt, set_points.targets, disturbances, channels)
    return channels


@kernel
def commanded(gains: Counts, targets: Counts, altitude: Samples, climb: Samples, entered_step: int) -> Samples:
    """Share of full thrust that the loop commands in a flight recorded at 512 Hz, from the step in which it is entered
    on; all of shape (n,), targets as in `rollout`."""
    state, thrust, command = np.zeros(STATE_SIZE, dtype=np.int64), np.zeros(len(altitude)), 0
    for i in range(entered_step, len(altitude)):
        z, zd = measured(-altitude[i], POSITION_BITS), measured(-climb[i], SPEED_BITS)
        if i == entered_step:
            start(state, z, zd)
        in_flight = detect_flight(state, command)
        command = step(state, ALT, targets[i], gains[0], gains[1], gains[2], z, zd, LEVEL, in_flight)
        thrust[i] = command / FULL_THRUST
    return thrust


@kernel
def observe(altitude: Samples, climb: Samples, thrust: Samples, model: Samples) -> Samples:
    """Disturbances of a flight recorded at 512 Hz, channels of shape (n,): (n, 3), see `COLUMNS`.

    The model's latency and measurement delay are ignored: the recorded values are taken as the state.
    """
    found = np.zeros((len(altitude), COLUMNS))
    hover_force = force_at_hover(model[HOVER_THROTTLE], model[QUADRATIC_SHARE])
    response = response_of(model[MOTOR_LAG_S])
    lagged, entered = 0.0, 0.0
    for i in range(len(altitude)):
        if thrust[i] > 0.0:
            entered = 1.0
        found[i, ENTERED] = entered
        if i + 1 == len(altitude):
            break
        lagged += response * (thrust[i] - lagged)
        lift = thrust_to_weight(lagged, altitude[i], i * STEP_S, model, hover_force)
        acceleration = GRAVITY_M_S2 * (lift - 1.0) - model[DRAG_1_S] * climb[i]
        height, speed = advance(altitude[i], climb[i], acceleration)
        found[i, ALTITUDE], found[i, CLIMB_RATE] = altitude[i + 1] - height, climb[i + 1] - speed
    return found
