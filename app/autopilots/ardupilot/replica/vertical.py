"""ArduCopter's vertical loop (4.7, October 2025): shaped altitude target, position, velocity and acceleration
controllers, throttle filter, and the takeoff before them; and the copter under it, along a given reference.

The loop runs at 400 Hz. Altitude, climb rate and acceleration are positive up, in m, m/s and m/s²; inside the velocity
controller they are cm/s, inside the acceleration controller cm/s² and per mille of throttle, as the gains are. A step
is `take_off` or, in flight, `shape` and `control`, on a state array that the caller owns: two kernels, because compiled
code that calls what is not inlined counts references, which takes as long as the step. docs/models.md has the formulas.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters, low_pass_gain
from app.autopilots.ardupilot.replica.shaping import (
    LARGEST_DESCENT_ACCELERATION_M_S2,
    approach_rate,
    clip,
    extrapolated,
    inverse_square_root,
    overspeed_factor,
    square_root,
)
from app.core.kernels import kernel
from app.core.models.copter import ALTITUDE, CLIMB_RATE, SENSED, advance
from app.core.records.trajectory import Samples

HOVER_MIN: Final = 0.125
HOVER_MAX: Final = 0.6875
THROTTLE_FILTER_HZ: Final = 2.0

(
    POSITION_P, VELOCITY_P, VELOCITY_I, VELOCITY_D, VELOCITY_FF, VELOCITY_IMAX, VELOCITY_ERROR_GAIN,
    VELOCITY_DERIVATIVE_GAIN, ACCELERATION_P, ACCELERATION_I, ACCELERATION_D, ACCELERATION_FF, ACCELERATION_D_FF,
    ACCELERATION_IMAX, TARGET_GAIN, ACCELERATION_ERROR_GAIN, ACCELERATION_DERIVATIVE_GAIN, JERK, CLIMB, DESCENT,
    ACCELERATION, HOVER, RAMP_STEP, RAMP_END, DT, THROTTLE_GAIN, RELAXATION_GAIN, DIFFERENTIATES,
) = range(28)  # fmt: skip
"""Indices in the packed parameters: of the fields of `Parameters`, in their order, then of what follows from the step
alone."""

Packed = NDArray[np.float64]

SPOOL: Final = 0.0
RAMP: Final = 1.0
FLIGHT: Final = 2.0
"""Phases: motors spooling up, throttle rising on the ground, the controllers in control."""

(
    Z_D, V_D, A_D, V_T, A_T, ACCELERATION_SUM, THROTTLE, THROTTLE_FILTERED, POSITION_ERROR, POSITION_ERROR_MIN,
    POSITION_ERROR_MAX, VELOCITY_ERROR, VELOCITY_DERIVATIVE, VELOCITY_SUM, FILTERED_TARGET, ACCELERATION_ERROR,
    ACCELERATION_DERIVATIVE, SATURATED, RESET, PHASE, SPOOL_LEFT_S, UNFILTERED, STATE_SIZE,
) = range(23)  # fmt: skip
"""Indices in the state array."""

State = NDArray[np.float32 | np.float64]
"""What the loop remembers: in single precision, as in the firmware, it follows a recording; in double precision it is
smooth enough for differences."""

INPUTS: Final = ("target_m", "z_m", "v_m_s", "a_m_s2", "limit_lower", "limit_upper")
OUTPUTS: Final = (
    "z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "a_t_m_s2", "i_term_permille", "throttle", "throttle_filtered",
)  # fmt: skip
"""The first elements of the state array."""

_RELAXATION_S: Final = 0.16
_RAMP_END: Final = 0.9
_FILTERS: Final = (
    VELOCITY_ERROR_GAIN, VELOCITY_DERIVATIVE_GAIN, TARGET_GAIN, ACCELERATION_ERROR_GAIN, ACCELERATION_DERIVATIVE_GAIN,
)  # fmt: skip
_RAMP_END_ACCELERATION: Final = 0.5
_RAMP_END_CLIMB: Final = 0.1


def packed(parameters: Parameters, dt_s: float = STEP_S, *, differentiates: bool = False) -> Packed:
    """Constants of a step of `dt_s`, shape (28,), for the kernels. A loop that `differentiates` is that of releases 3.3
    to 4.0: the change of the climb rate target is in place of the desired acceleration."""
    p = [*parameters.values, dt_s, low_pass_gain(THROTTLE_FILTER_HZ, dt_s), dt_s / (dt_s + _RELAXATION_S)]
    p.append(float(differentiates))
    for place in _FILTERS:
        p[place] = low_pass_gain(p[place], dt_s)
    p[JERK] = parameters.shaping_jerk_m_s3
    p[HOVER] = min(max(p[HOVER], HOVER_MIN), HOVER_MAX)
    p[ACCELERATION_IMAX] = max(p[ACCELERATION_IMAX], 1000.0 * p[HOVER])
    p[RAMP_STEP] = dt_s / p[RAMP_STEP]
    p[RAMP_END] = min(p[RAMP_END], _RAMP_END)
    return np.array(p)


@kernel
def enter_position_mode(state: State, p: Packed, z: float, v: float, a: float) -> None:
    """What the first position target does: hold the present altitude, with limits from the gain of this moment."""
    state[POSITION_ERROR_MIN] = inverse_square_root(-p[DESCENT], p[POSITION_P], p[ACCELERATION])
    state[POSITION_ERROR_MAX] = inverse_square_root(p[CLIMB], p[POSITION_P], p[ACCELERATION])
    _initialise(state, p, z, v, a)


@kernel
def start_hover(state: State, p: Packed, throttle: float, z: float, v: float, a: float) -> None:
    """Enter the loop in flight with `throttle`, demanded and filtered; overwrites the state, shape (STATE_SIZE,)."""
    state[:] = 0.0
    state[THROTTLE] = state[THROTTLE_FILTERED] = throttle
    state[PHASE] = FLIGHT
    enter_position_mode(state, p, z, v, a)


@kernel
def start_takeoff(state: State, p: Packed, spool_s: float) -> None:
    """Enter the loop on the ground with the takeoff command; overwrites the state, shape (STATE_SIZE,).

    The throttle begins to rise after `spool_s`: 0.17 s from arming idle, else 2 s after arming and MOT_SPOOL_TIME.
    """
    state[:] = 0.0
    state[PHASE] = SPOOL if spool_s > 0.0 else RAMP
    state[SPOOL_LEFT_S] = spool_s
    state[UNFILTERED] = 1.0
    enter_position_mode(state, p, 0.0, 0.0, 0.0)


@kernel
def shape(state: State, p: Packed, target: float) -> None:
    """The first half of a step in flight: advance the desired motion on the way to `target`, within its limits."""
    factor = overspeed_factor(state[V_D], p[CLIMB], p[DESCENT])
    acceleration, jerk, dt = factor * p[ACCELERATION], factor * p[JERK], p[DT]
    downward = clip(acceleration, 0.0, LARGEST_DESCENT_ACCELERATION_M_S2)
    z, v = extrapolated(
        state[Z_D], state[V_D], state[A_D], state[SATURATED], state[POSITION_ERROR], state[VELOCITY_ERROR], dt
    )
    change = approach_rate(target - z, p[CLIMB], p[DESCENT], acceleration, downward, jerk, dt) - v
    slope = jerk / (acceleration if change > 0.0 else downward)
    wanted = clip(square_root(change, slope, jerk, dt), -downward, acceleration)
    state[Z_D], state[V_D] = z, v
    state[A_D] += clip(wanted - state[A_D], -jerk * dt, jerk * dt)


@kernel
def control(state: State, p: Packed, z: float, v: float, a: float, lower: bool, upper: bool) -> None:
    """The second half of a step in flight: the throttle of its motor step, and the demand for the next one.

    `z`, `v` and `a` are the estimates; `lower` and `upper` tell whether this motor step was at a throttle limit.
    """
    _filter_throttle(state, p)
    state[UNFILTERED] = 0.0
    _control_position(state, p, z)
    _control_velocity(state, p, state[V_T], v, lower, upper)
    _control_acceleration(state, p, state[A_T], a, lower, upper)


@kernel
def take_off(state: State, p: Packed, z: float, v: float, a: float) -> None:
    """One step of the phases before flight, in which the controllers start anew in every step."""
    _filter_throttle(state, p)
    if state[PHASE] == RAMP:
        state[THROTTLE] += p[RAMP_STEP]
    _initialise(state, p, z, v, a)
    if state[PHASE] == SPOOL:
        state[ACCELERATION_SUM] += p[RELAXATION_GAIN] * (-1000.0 * p[HOVER] - state[ACCELERATION_SUM])
        state[THROTTLE] = p[HOVER] + (state[ACCELERATION_SUM] + _bump(state, p, a)) / 1000.0
        state[SPOOL_LEFT_S] -= p[DT]
        if state[SPOOL_LEFT_S] <= 0.0:
            state[PHASE] = RAMP
    elif (
        state[THROTTLE] >= p[RAMP_END]
        or a >= _RAMP_END_ACCELERATION * p[ACCELERATION]
        or state[V_D] >= _RAMP_END_CLIMB * p[CLIMB]
    ):
        state[PHASE] = FLIGHT


@kernel
def _filter_throttle(state: State, p: Packed) -> None:
    """Throttle of level flight, 0 … 1, from the demand of the last step; unfiltered on the ground."""
    gain = 1.0 if state[UNFILTERED] > 0.0 else p[THROTTLE_GAIN]
    filtered = state[THROTTLE_FILTERED]
    state[THROTTLE_FILTERED] = clip(filtered + gain * (state[THROTTLE] - filtered), 0.0, 1.0)


@kernel
def follow(
    state: State, p: Packed, recorded: NDArray[np.float64], z: float, v: float, a: float, lower: bool, upper: bool
) -> None:
    """Put the loop in the state that the recorded row `recorded`, shape (8,) as `OUTPUTS`, left, in flight.

    What the row lacks, the filters and the velocity integrator, advances from the state of the row before.
    """
    _control_velocity(state, p, recorded[V_T], v, lower, upper)
    _control_acceleration(state, p, recorded[A_T], a, lower, upper)
    for place in range(len(OUTPUTS)):
        state[place] = recorded[place]
    state[POSITION_ERROR] = recorded[Z_D] - z
    state[UNFILTERED] = 0.0


@kernel
def _initialise(state: State, p: Packed, z: float, v: float, a: float) -> None:
    """Desired motion = the present one, filters reset, and an integrator that keeps the throttle where it is."""
    state[Z_D], state[V_D] = z, v
    state[A_D] = clip(a, -p[ACCELERATION], p[ACCELERATION])
    state[V_T], state[A_T] = state[V_D], state[A_D]
    state[RESET] = 1.0
    state[VELOCITY_SUM] = 0.0
    state[ACCELERATION_SUM] = 1000.0 * (state[THROTTLE] - p[HOVER]) - _bump(state, p, a)


@kernel
def _bump(state: State, p: Packed, a: float) -> float:
    """Throttle that the acceleration controller adds to its integrator in the step after a reset, per mille."""
    bump: float = p[ACCELERATION_P] * 100.0 * (state[A_D] - a) + p[ACCELERATION_FF] * 100.0 * state[A_D]
    return bump


@kernel
def _control_position(state: State, p: Packed, z: float) -> None:
    """Sets the climb rate target; a desired altitude further away than its limit is pulled along."""
    error = state[Z_D] - z
    limited = clip(error, state[POSITION_ERROR_MIN], state[POSITION_ERROR_MAX])
    if limited != error:
        state[Z_D] = z + limited
    state[POSITION_ERROR] = limited
    state[V_T] = square_root(limited, p[POSITION_P], p[ACCELERATION], 0.0) + state[V_D]


@kernel
def _control_velocity(state: State, p: Packed, v_t: float, v: float, lower: bool, upper: bool) -> None:
    """Sets the acceleration target from the climb rate target `v_t`."""
    difference, before = 100.0 * (v_t - v), state[VELOCITY_ERROR]
    if state[RESET] > 0.0:
        error, derivative = difference, 0.0
    else:
        error = before + p[VELOCITY_ERROR_GAIN] * (difference - before)
        derivative = state[VELOCITY_DERIVATIVE]
        derivative += p[VELOCITY_DERIVATIVE_GAIN] * ((error - before) / p[DT] - derivative)
    state[VELOCITY_ERROR], state[VELOCITY_DERIVATIVE] = error, derivative
    if p[VELOCITY_I] == 0.0:
        state[VELOCITY_SUM] = 0.0
    elif not ((lower and error < 0.0) or (upper and error > 0.0)):
        total = state[VELOCITY_SUM] + p[VELOCITY_I] * error * p[DT]
        state[VELOCITY_SUM] = clip(total, -p[VELOCITY_IMAX], p[VELOCITY_IMAX])
    feedback = p[VELOCITY_P] * error + state[VELOCITY_SUM] + p[VELOCITY_D] * derivative
    state[A_T] = (feedback + p[VELOCITY_FF] * 100.0 * v_t) / 100.0 + state[A_D]


@kernel
def _control_acceleration(state: State, p: Packed, a_t: float, a: float, lower: bool, upper: bool) -> None:
    """Sets the throttle demand, which may be negative or above 1, from the acceleration target `a_t`."""
    target, error, derivative = state[FILTERED_TARGET], state[ACCELERATION_ERROR], state[ACCELERATION_DERIVATIVE]
    if state[RESET] > 0.0:
        target, target_rate, derivative = 100.0 * a_t, 0.0, 0.0
        error = target - 100.0 * a
    else:
        change = p[TARGET_GAIN] * (100.0 * a_t - target)
        target, target_rate = target + change, change / p[DT]
        change = p[ACCELERATION_ERROR_GAIN] * (target - 100.0 * a - error)
        error += change
        derivative += p[ACCELERATION_DERIVATIVE_GAIN] * (change / p[DT] - derivative)
    state[FILTERED_TARGET], state[ACCELERATION_ERROR], state[ACCELERATION_DERIVATIVE] = target, error, derivative
    state[RESET] = 0.0
    total = state[ACCELERATION_SUM]
    if p[ACCELERATION_I] == 0.0:
        total = 0.0
    elif not (lower or upper) or total * error < 0.0:
        total = clip(total + p[ACCELERATION_I] * error * p[DT], -p[ACCELERATION_IMAX], p[ACCELERATION_IMAX])
    state[ACCELERATION_SUM] = total
    feedback = p[ACCELERATION_P] * error + p[ACCELERATION_D] * derivative + total
    feed_forward = p[ACCELERATION_FF] * target + p[ACCELERATION_D_FF] * target_rate
    state[THROTTLE] = p[HOVER] + (feedback + feed_forward) / 1000.0
    state[SATURATED] = 1.0 if upper else -1.0 if lower else 0.0


@kernel
def rollout(
    state: State,
    p: Packed,
    inputs: NDArray[np.float64],
    recorded: NDArray[np.float64],
    followed: NDArray[np.bool_],
    outputs: NDArray[np.float64],
) -> None:
    """One step per row of `inputs`, shape (n, 6) as `INPUTS`; fills `outputs`, shape (n, 8) as `OUTPUTS`.

    After a row that is marked in `followed`, shape (n,), the loop continues from that row of `recorded`, shape (n, 8),
    instead of its own result.
    """
    before = np.empty_like(state)
    for row in range(len(inputs)):
        target, z, v, a = inputs[row, 0], inputs[row, 1], inputs[row, 2], inputs[row, 3]
        lower, upper = inputs[row, 4] > 0.0, inputs[row, 5] > 0.0
        follows = followed[row] and state[PHASE] == FLIGHT
        if follows:
            for place in range(STATE_SIZE):
                before[place] = state[place]
        if state[PHASE] == FLIGHT:
            shape(state, p, target)
            control(state, p, z, v, a, lower, upper)
        else:
            take_off(state, p, z, v, a)
        for place in range(len(OUTPUTS)):
            outputs[row, place] = state[place]
        if follows:
            for place in range(STATE_SIZE):
                state[place] = before[place]
            follow(state, p, recorded[row], z, v, a, lower, upper)


@kernel
def step(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    reference: Samples,
    disturbance: Samples,
) -> None:
    """One step of loop and body. `reference` has shape (4,) as `REFERENCE`, of which the assumed hover throttle is not
    used: it is a parameter of the loop. `disturbance` has shape (3,) as `DISTURBANCES`."""
    state[Z_D], state[V_D], state[A_D] = reference[0], reference[1], reference[2]
    if p[DIFFERENTIATES] > 0.0:
        before = state[V_T]
        _control_position(state, p, body[ALTITUDE])
        state[A_D] = (state[V_T] - before) / p[DT] if state[RESET] == 0.0 else 0.0
    filtered = state[THROTTLE_FILTERED]
    filtered += p[THROTTLE_GAIN] * (state[THROTTLE] - filtered)
    sensed = body[SENSED] + disturbance[2]
    control(state, p, body[ALTITUDE], body[CLIMB_RATE], sensed, filtered <= 0.0, filtered >= 1.0)
    advance(body, copter, p[DT], state[THROTTLE_FILTERED], disturbance[0], disturbance[1])


@kernel
def fly(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    references: Samples,
    disturbances: Samples,
    flown: Samples,
) -> None:
    """A step per row of `references`, shape (n, 4), and `disturbances`, (n, 3); fills `flown`, (n, 6) as `FLOWN`.

    The loop gives the motors the 2 Hz low-pass of its throttle.
    """
    for row in range(len(references)):
        flown[row, 0] = body[ALTITUDE]
        flown[row, 1] = body[CLIMB_RATE]
        flown[row, 2] = body[SENSED] + disturbances[row, 2]
        step(state, body, p, copter, references[row], disturbances[row])
        flown[row, 3] = state[THROTTLE]
        flown[row, 4] = flown[row, 5] = state[THROTTLE_FILTERED]


@kernel
def shaped(p: Packed, altitude_m: float, targets: Samples, references: Samples) -> None:
    """The reference on its way along `targets`, shape (n,), from rest at an altitude; fills the first three columns of
    `references`, shape (n, 4) as `REFERENCE`: the desired motion at each step. The throttle is never at a limit."""
    state = np.empty(STATE_SIZE)
    start_hover(state, p, 0.0, altitude_m, 0.0, 0.0)
    for row in range(len(targets)):
        shape(state, p, targets[row])
        references[row, 0], references[row, 1], references[row, 2] = state[Z_D], state[V_D], state[A_D]
