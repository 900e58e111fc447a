"""PX4's vertical loop (March 2026) in level flight: filters, position and velocity controllers, thrust, and the states
and the ramp of a takeoff; and the copter under it, along a given reference.

A step runs once per estimate of position (125 Hz in PX4's own simulation), in single precision like the firmware.
Altitude, velocity and acceleration are positive DOWN inside the replica, in m, m/s and m/s²; thrust is a share of full
thrust, positive up. A set-point or an estimate that is not given is NaN, as in PX4. The state is an array that the
caller owns. A rollout is one kernel, whose parts take and return scalars, because compiled code with a call that takes
arrays counts references. docs/models.md has the formulas.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.replica.parameters import STEP_S, Parameters, low_pass_gain
from app.core.kernels import kernel
from app.core.models.copter import ALTITUDE, CLIMB_RATE, SENSED, advance
from app.core.records.trajectory import Samples

GRAVITY: Final = np.float32(9.80665)

(
    POSITION_P, VELOCITY_P, VELOCITY_I, VELOCITY_D, CLIMB, DESCENT, THRUST_MIN, THRUST_MAX, HOVER, RAMP_S, SPOOL_S,
    VELOCITY_GAIN, DERIVATIVE_GAIN, LAND_SPEED,
) = range(14)  # fmt: skip
"""Indices in the packed parameters: of the fields of `Parameters`, in their order."""

Packed = NDArray[np.float32]

DISARMED: Final = np.float32(1.0)
SPOOL_UP: Final = np.float32(2.0)
READY: Final = np.float32(3.0)
RAMP_UP: Final = np.float32(4.0)
FLIGHT: Final = np.float32(5.0)
"""States of a takeoff, numbered as PX4's."""

(
    TAKEOFF, VELOCITY_TARGET, ACCELERATION_TARGET, THRUST, RAMP_SPEED, DERIVATIVE, VELOCITY, INTEGRAL, HOVER_THRUST,
    RAMP, ARMED_S, SET_Z, SET_VELOCITY, SET_ACCELERATION, STATE_SIZE,
) = range(15)  # fmt: skip
"""Indices in the state array."""

State = NDArray[np.float32]
Single = np.float32

INPUTS: Final = (
    "dt_s", "z_m", "vz_m_s", "z_derivative_m_s", "set_z_m", "set_vz_m_s", "set_az_m_s2", "set_new",
    "hover_estimate", "armed", "landed", "ground_contact", "want_takeoff", "limit_up_m_s", "limit_down_m_s",
)  # fmt: skip
OUTPUTS: Final = (
    "takeoff_state", "out_vz_m_s", "out_az_m_s2", "out_thrust", "ramp_m_s", "out_vz_derivative",
)  # fmt: skip
"""The first elements of the state array."""

HOVER_MIN: Final = np.float32(0.05)
HOVER_MAX: Final = np.float32(0.9)
_THRUST_ON_THE_GROUND: Final = np.float32(0.001)
_HELD_DOWN_M_S2: Final = np.float32(100.0)
_DT_MIN_S: Final = np.float32(0.002)
_DT_MAX_S: Final = np.float32(0.04)
_NONE: Final = np.float32(0.0)
_WHOLE: Final = np.float32(1.0)
_SUM_ERROR_S: Final = np.float32(1e-4)
"""What the sum of many intervals may lack to the time of the firmware's clock."""


def packed(parameters: Parameters, filter_sample_s: float = STEP_S) -> Packed:
    """Constants for the kernels, shape (14,).

    `filter_sample_s` is the mean interval of the estimates until the filters were set up, s, positive.
    """
    p = parameters.values
    for place in (VELOCITY_GAIN, DERIVATIVE_GAIN):
        p[place] = low_pass_gain(p[place], filter_sample_s)
    return np.array(p, dtype=np.float32)


@kernel
def start(state: State, p: Packed) -> None:
    """Enter the loop disarmed; overwrites the state, shape (STATE_SIZE,)."""
    state[:] = 0.0
    state[TAKEOFF] = DISARMED
    state[HOVER_THRUST] = p[HOVER]
    state[VELOCITY_TARGET] = state[SET_Z] = state[SET_VELOCITY] = np.nan
    state[SET_ACCELERATION] = _HELD_DOWN_M_S2
    state[RAMP_SPEED] = -GRAVITY / p[VELOCITY_P]


@kernel
def start_hover(state: State, p: Packed, hover_estimate: float, thrust: float, vz: float) -> None:
    """Enter the loop in flight with an integral that keeps `thrust`; overwrites the state, shape (STATE_SIZE,).

    `hover_estimate` is the estimator's, 0.05 … 0.9, `vz` the velocity, m/s down.
    """
    start(state, p)
    state[TAKEOFF], state[RAMP], state[RAMP_SPEED] = FLIGHT, 1.0, p[CLIMB]
    state[HOVER_THRUST], state[THRUST], state[VELOCITY] = hover_estimate, thrust, vz
    state[INTEGRAL] = state[ACCELERATION_TARGET] = GRAVITY * (1.0 - thrust / hover_estimate)


@kernel
def blended(vz: Single, z_derivative: Single, set_z: Single, set_vz: Single, land_speed: Single) -> Single:
    """The velocity to be filtered: without a target of altitude, partly or wholly the derivative of z."""
    speed = abs(set_vz)
    if not math.isnan(set_z) or not speed > 0.0:
        return vz
    return vz + min(speed / land_speed, _WHOLE) * (z_derivative - vz)


@kernel
def advanced_takeoff(
    takeoff: Single, armed_s: Single, spool_s: Single, ramp: Single, armed: bool, landed: bool, wanted: bool
) -> Single:
    """The state that follows `takeoff`; several may pass in one step."""
    if not armed:
        return DISARMED
    if takeoff <= SPOOL_UP:
        takeoff = READY if armed_s >= spool_s - _SUM_ERROR_S else SPOOL_UP
    if takeoff == READY and wanted:
        takeoff = RAMP_UP
    elif takeoff == RAMP_UP and ramp >= 1.0:
        takeoff = FLIGHT
    return READY if takeoff == FLIGHT and landed else takeoff


@kernel
def advanced_ramp(takeoff: Single, ramp: Single, dt: Single, ramp_s: Single) -> Single:
    """Progress of the ramp, 0 before a takeoff, done at 1."""
    if takeoff < RAMP_UP:
        return _NONE
    if takeoff == FLIGHT or ramp_s == 0.0:
        return _WHOLE
    return ramp + dt / ramp_s


@kernel
def ramp_speed(ramp: Single, lowest: Single, climb: Single) -> Single:
    """Limit of the climb rate, m/s up, at this progress of the ramp: from `lowest`, which is negative, to `climb`."""
    if ramp == 0.0:
        return lowest
    return lowest + ramp * (climb - lowest) if ramp < 1.0 else climb


@kernel
def waits(error: Single, thrust: Single, least: Single, most: Single) -> bool:
    """Whether the integral waits: the error points beyond the limit that the thrust is at, or is not known."""
    return bool((thrust <= least and error >= 0.0) or (thrust >= most and error <= 0.0) or math.isnan(error))


@kernel
def limited_velocity(target: Single, up: Single, down: Single) -> Single:
    """`target`, m/s down, limited to −`up` … `down`; with `up` below 0 it is −`up`, and NaN stays NaN."""
    if target < -up:
        return -up
    return down if target > down else target


@kernel
def sum_of_given(one: Single, other: Single) -> Single:
    """Sum of two terms; a term that is NaN is left out."""
    if math.isnan(one):
        return other
    return one if math.isnan(other) else one + other


@kernel
def rollout(state: State, p: Packed, inputs: NDArray[np.float32], outputs: NDArray[np.float32]) -> None:
    """One step per row of `inputs`, shape (n, 15) as `INPUTS`; fills `outputs`, shape (n, 6) as `OUTPUTS`.

    The set-points are those in force, `set_new` tells that they arrived since the last step; `hover_estimate` is a new
    valid one, else NaN; the limits are the mode's, m/s, at least 0; conditions are 0 or 1.
    """
    lowest = -GRAVITY / p[VELOCITY_P]
    for row in range(len(inputs)):
        dt, z, vz = min(max(inputs[row, 0], _DT_MIN_S), _DT_MAX_S), inputs[row, 1], inputs[row, 2]
        armed, landed, ground_contact = inputs[row, 9] > 0.0, inputs[row, 10] > 0.0, inputs[row, 11] > 0.0
        if inputs[row, 7] > 0.0:
            state[SET_Z], state[SET_VELOCITY], state[SET_ACCELERATION] = inputs[row, 4], inputs[row, 5], inputs[row, 6]
        vz = blended(vz, inputs[row, 3], state[SET_Z], state[SET_VELOCITY], p[LAND_SPEED])
        before = state[VELOCITY]
        state[VELOCITY] = before + p[VELOCITY_GAIN] * (vz - before)
        state[DERIVATIVE] += p[DERIVATIVE_GAIN] * ((state[VELOCITY] - before) / dt - state[DERIVATIVE])

        state[ARMED_S] = state[ARMED_S] + dt if armed and state[TAKEOFF] != DISARMED else _NONE
        takeoff = advanced_takeoff(
            state[TAKEOFF], state[ARMED_S], p[SPOOL_S], state[RAMP], armed, landed, inputs[row, 12] > 0.0
        )
        flying = takeoff == FLIGHT
        state[TAKEOFF], state[RAMP] = takeoff, advanced_ramp(takeoff, state[RAMP], dt, p[RAMP_S])
        state[RAMP_SPEED] = ramp_speed(state[RAMP], lowest, p[CLIMB])

        if not math.isnan(inputs[row, 8]):
            new, a = min(max(inputs[row, 8], HOVER_MIN), HOVER_MAX), state[ACCELERATION_TARGET]
            state[INTEGRAL] += (a - GRAVITY) * state[HOVER_THRUST] / new + GRAVITY - a
            state[HOVER_THRUST] = new
        if not flying:
            state[HOVER_THRUST] = p[HOVER]

        if takeoff < RAMP_UP or (flying and ground_contact):
            state[INTEGRAL] = 0.0
            state[SET_Z] = state[SET_VELOCITY] = np.nan
            state[SET_ACCELERATION] = _HELD_DOWN_M_S2
        elif not (flying or math.isnan(state[SET_VELOCITY])):
            state[SET_ACCELERATION] = np.nan

        target = sum_of_given(p[POSITION_P] * (state[SET_Z] - z), state[SET_VELOCITY])
        up = min(inputs[row, 13], p[CLIMB]) if flying else state[RAMP_SPEED]
        target = limited_velocity(target, up, max(inputs[row, 14], _NONE))
        error = target - state[VELOCITY]
        integral = min(max(state[INTEGRAL], -GRAVITY), GRAVITY)
        feedback = p[VELOCITY_P] * error + integral - p[VELOCITY_D] * state[DERIVATIVE]
        a = sum_of_given(feedback, state[SET_ACCELERATION])
        hover = state[HOVER_THRUST]
        least = p[THRUST_MIN] if flying else _THRUST_ON_THE_GROUND
        thrust = max(hover - a * hover / GRAVITY, least)
        wait = waits(error, thrust, least, p[THRUST_MAX])
        state[INTEGRAL] = integral if wait else integral + p[VELOCITY_I] * error * dt
        state[VELOCITY_TARGET], state[ACCELERATION_TARGET] = target, a
        state[THRUST] = min(thrust, p[THRUST_MAX])
        for place in range(len(OUTPUTS)):
            outputs[row, place] = state[place]


@kernel
def fly(
    state: State,
    body: Samples,
    p: Packed,
    copter: Samples,
    dt_s: float,
    slow_gain: float,
    inputs: NDArray[np.float32],
    outputs: NDArray[np.float32],
    references: Samples,
    disturbances: Samples,
    flown: Samples,
) -> None:
    """A step of `dt_s` per row of `references`, shape (n, 4) as `REFERENCE`, and `disturbances`, (n, 3); fills `flown`,
    (n, 6) as `FLOWN`.

    `inputs`, shape (1, 15) as the loop's `INPUTS`, has the conditions and the limits of the whole flight, in single
    precision; set-points and estimates are filled in, and `outputs`, (1, 6), too. `slow_gain` is that of the 2 Hz
    low-pass of the throttle.
    """
    slow = float(state[THRUST])
    for row in range(len(references)):
        flown[row, 0] = body[ALTITUDE]
        flown[row, 1] = body[CLIMB_RATE]
        flown[row, 2] = body[SENSED] + disturbances[row, 2]
        inputs[0, 1], inputs[0, 2] = -body[ALTITUDE], -body[CLIMB_RATE]
        inputs[0, 4], inputs[0, 5], inputs[0, 6] = -references[row, 0], -references[row, 1], -references[row, 2]
        inputs[0, 8] = references[row, 3]
        rollout(state, p, inputs, outputs)
        thrust = float(state[THRUST])
        advance(body, copter, dt_s, thrust, disturbances[row, 0], disturbances[row, 1])
        slow += slow_gain * (thrust - slow)
        flown[row, 3] = flown[row, 4] = thrust
        flown[row, 5] = slow
