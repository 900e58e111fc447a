"""PX4's vertical loop (March 2026) in level flight: filters, position and velocity controllers, thrust, and the states
and the ramp of a takeoff.

A step runs once per estimate of position (125 Hz in PX4's own simulation), in single precision like the firmware.
Altitude, velocity and acceleration are positive DOWN inside the replica, in m, m/s and m/s²; thrust is a share of full
thrust, positive up. A set-point or an estimate that is not given is NaN, as in PX4. The state is an array that the
caller owns. docs/models.md has the formulas.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.px4_parameters import (
    CLIMB,
    DERIVATIVE_GAIN,
    HOVER,
    LAND_SPEED,
    POSITION_P,
    RAMP_S,
    SPOOL_S,
    THRUST_MAX,
    THRUST_MIN,
    VELOCITY_D,
    VELOCITY_GAIN,
    VELOCITY_I,
    VELOCITY_P,
    Packed,
)
from app.core.kernels import kernel

GRAVITY: Final = np.float32(9.80665)

DISARMED: Final = 1.0
SPOOL_UP: Final = 2.0
READY: Final = 3.0
RAMP_UP: Final = 4.0
FLIGHT: Final = 5.0
"""States of a takeoff, numbered as PX4's."""

# Indices in the state array.
TAKEOFF: Final = 0
VELOCITY_TARGET: Final = 1
ACCELERATION_TARGET: Final = 2
THRUST: Final = 3
RAMP_SPEED: Final = 4
DERIVATIVE: Final = 5
VELOCITY: Final = 6
INTEGRAL: Final = 7
HOVER_THRUST: Final = 8
RAMP: Final = 9
ARMED_S: Final = 10
SET_Z: Final = 11
SET_VELOCITY: Final = 12
SET_ACCELERATION: Final = 13
STATE_SIZE: Final = 14

State = NDArray[np.float32]

INPUTS: Final = (
    "dt_s", "z_m", "vz_m_s", "z_derivative_m_s", "set_z_m", "set_vz_m_s", "set_az_m_s2", "set_new",
    "hover_estimate", "armed", "landed", "ground_contact", "want_takeoff", "limit_up_m_s", "limit_down_m_s",
)  # fmt: skip
OUTPUTS: Final = (
    "takeoff_state", "out_vz_m_s", "out_az_m_s2", "out_thrust", "ramp_m_s", "out_vz_derivative",
)  # fmt: skip
"""The first elements of the state array."""

_HOVER_MIN: Final = np.float32(0.05)
_HOVER_MAX: Final = np.float32(0.9)
_THRUST_ON_THE_GROUND: Final = np.float32(0.001)
_HELD_DOWN_M_S2: Final = np.float32(100.0)
_DT_MIN_S: Final = np.float32(0.002)
_DT_MAX_S: Final = np.float32(0.04)
_NONE: Final = np.float32(0.0)
_WHOLE: Final = np.float32(1.0)
_SUM_ERROR_S: Final = np.float32(1e-4)
"""What the sum of many intervals may lack to the time of the firmware's clock."""


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
def wants_takeoff(z: float, set_z: float, set_vz: float, set_az: float, offboard: bool) -> bool:
    """Whether set-points ask for a takeoff; those of offboard control must be younger than 1 s."""
    if offboard:
        return set_z < z or set_vz < 0.0 or set_az < 0.0
    return set_z < z - 0.2 or set_vz < -0.3


@kernel
def reset_velocity(state: State, change: float) -> None:
    """The estimator has shifted its velocity by `change`, m/s down: so does the filter, which sees no acceleration."""
    state[VELOCITY] += change


@kernel
def advance_takeoff(state: State, p: Packed, dt: np.float32, armed: bool, landed: bool, wanted: bool) -> None:
    """The first part of a step: state of the takeoff, then its ramp. Several states may pass in one step."""
    takeoff = state[TAKEOFF]
    state[ARMED_S] = state[ARMED_S] + dt if armed and takeoff != DISARMED else 0.0
    if takeoff == DISARMED and armed:
        takeoff = SPOOL_UP
    if takeoff == SPOOL_UP and state[ARMED_S] >= p[SPOOL_S] - _SUM_ERROR_S:
        takeoff = READY
    if takeoff == READY and wanted:
        takeoff = RAMP_UP
        state[RAMP] = 0.0
    if takeoff == RAMP_UP and state[RAMP] >= 1.0:
        takeoff = FLIGHT
    if takeoff == FLIGHT and landed:
        takeoff = READY
    if not armed:
        takeoff = DISARMED
    state[TAKEOFF] = takeoff
    lowest = -GRAVITY / p[VELOCITY_P]
    if takeoff < RAMP_UP:
        state[RAMP_SPEED] = lowest
    elif takeoff == RAMP_UP:
        ramp = state[RAMP] + dt / p[RAMP_S] if p[RAMP_S] > 0.0 else _WHOLE
        state[RAMP] = ramp
        state[RAMP_SPEED] = lowest + ramp * (p[CLIMB] - lowest) if ramp < 1.0 else p[CLIMB]
    else:
        state[RAMP_SPEED] = p[CLIMB]


@kernel
def adopt_hover_thrust(state: State, estimate: np.float32) -> None:
    """Replace the hover thrust by a new valid `estimate`, 0.05 … 0.9, and adapt the integral: thrust does not jump."""
    new = min(max(estimate, _HOVER_MIN), _HOVER_MAX)
    a = state[ACCELERATION_TARGET]
    state[INTEGRAL] += (a - GRAVITY) * state[HOVER_THRUST] / new + GRAVITY - a
    state[HOVER_THRUST] = new


@kernel
def filter_velocity(state: State, p: Packed, vz: np.float32, dt: np.float32) -> None:
    """Low-pass of the measured velocity, m/s down, and of its derivative."""
    before = state[VELOCITY]
    state[VELOCITY] = before + p[VELOCITY_GAIN] * (vz - before)
    state[DERIVATIVE] += p[DERIVATIVE_GAIN] * ((state[VELOCITY] - before) / dt - state[DERIVATIVE])


@kernel
def choose_setpoints(state: State, ground_contact: bool) -> None:
    """Withdraw what must not act in this state of the takeoff, until new set-points replace those in force."""
    flying = state[TAKEOFF] == FLIGHT
    if state[TAKEOFF] < RAMP_UP or (flying and ground_contact):
        state[INTEGRAL] = 0.0
        state[SET_Z] = state[SET_VELOCITY] = np.nan
        state[SET_ACCELERATION] = _HELD_DOWN_M_S2
    elif not (flying or math.isnan(state[SET_VELOCITY])):
        state[SET_ACCELERATION] = np.nan


@kernel
def control(state: State, p: Packed, dt: np.float32, z: np.float32, up: np.float32, down: np.float32) -> None:
    """The last part of a step: targets of velocity and acceleration, thrust, and the integral for the next step.

    `up` and `down` limit the target of velocity, m/s; with `up` below 0 the vehicle is held down.
    """
    set_velocity, set_acceleration = state[SET_VELOCITY], state[SET_ACCELERATION]
    target = p[POSITION_P] * (state[SET_Z] - z)
    if math.isnan(target):
        target = set_velocity
    elif not math.isnan(set_velocity):
        target += set_velocity
    if target < -up:
        target = -up
    elif target > down:
        target = down
    integral = min(max(state[INTEGRAL], -GRAVITY), GRAVITY)
    error = target - state[VELOCITY]
    a = p[VELOCITY_P] * error + integral - p[VELOCITY_D] * state[DERIVATIVE]
    if math.isnan(a):
        a = set_acceleration
    elif not math.isnan(set_acceleration):
        a += set_acceleration
    hover = state[HOVER_THRUST]
    thrust = hover - a * hover / GRAVITY
    least = p[THRUST_MIN] if state[TAKEOFF] == FLIGHT else _THRUST_ON_THE_GROUND
    thrust = max(thrust, least)
    held = (thrust <= least and error >= 0.0) or (thrust >= p[THRUST_MAX] and error <= 0.0)
    if not (held or math.isnan(error)):
        integral += p[VELOCITY_I] * error * dt
    state[INTEGRAL] = integral
    state[VELOCITY_TARGET], state[ACCELERATION_TARGET] = target, a
    state[THRUST] = p[THRUST_MAX] if thrust > p[THRUST_MAX] else thrust


@kernel
def step(state: State, p: Packed, inputs: NDArray[np.float32]) -> None:
    """One run of position control from `inputs`, shape (15,) as `INPUTS`, single precision.

    The set-points are those in force, `set_new` tells that they arrived since the last step; `hover_estimate` is a new
    valid one, else NaN; the limits are the mode's, m/s, at least 0; conditions are 0 or 1. The results are the first
    elements of `state`, in the order of `OUTPUTS`.
    """
    dt, z, vz = min(max(inputs[0], _DT_MIN_S), _DT_MAX_S), inputs[1], inputs[2]
    if inputs[7] > 0.0:
        state[SET_Z], state[SET_VELOCITY], state[SET_ACCELERATION] = inputs[4], inputs[5], inputs[6]
    filter_velocity(state, p, _blended(state, p, vz, inputs[3]), dt)
    advance_takeoff(state, p, dt, inputs[9] > 0.0, inputs[10] > 0.0, inputs[12] > 0.0)
    if not math.isnan(inputs[8]):
        adopt_hover_thrust(state, inputs[8])
    flying = state[TAKEOFF] == FLIGHT
    if not flying:
        state[HOVER_THRUST] = p[HOVER]
    choose_setpoints(state, inputs[11] > 0.0)
    up = min(inputs[13], p[CLIMB]) if flying else state[RAMP_SPEED]
    control(state, p, dt, z, up, inputs[14] if inputs[14] > 0.0 else _NONE)


@kernel
def _blended(state: State, p: Packed, vz: np.float32, z_derivative: np.float32) -> np.float32:
    """The velocity to be filtered: without a target of altitude, partly or wholly the derivative of z."""
    speed = abs(state[SET_VELOCITY])
    if not math.isnan(state[SET_Z]) or not speed > 0.0:
        return vz
    blended: np.float32 = vz + min(speed / p[LAND_SPEED], _WHOLE) * (z_derivative - vz)
    return blended


@kernel
def rollout(state: State, p: Packed, inputs: NDArray[np.float32], outputs: NDArray[np.float32]) -> None:
    """One step per row of `inputs`, shape (n, 15) as `INPUTS`; fills `outputs`, shape (n, 6) as `OUTPUTS`."""
    for row in range(len(inputs)):
        step(state, p, inputs[row])
        for place in range(len(OUTPUTS)):
            outputs[row, place] = state[place]
