"""A multicopter's altitude, whatever loop commands its throttle.

    u̇ = (u_f − u)/lag,   a = g·((u/h)^s − 1) − drag·v + disturbance,

where u_f is the throttle that the loop gives the motors, u that after their lag, h the throttle in hover and s the
slope of log thrust over log throttle: a polynomial of the throttle would turn negative at a low hover throttle. The
acceleration is sensed through the accelerometer's filter. The climb rate and the altitude are those that the vehicle's
estimator reports, and the altitude need not be the integral of the climb rate: the difference is a disturbance, too.
Altitude up, SI, explicit Euler at the rate of the loop.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.kernels import kernel
from app.core.records.trajectory import Samples

GRAVITY_M_S2: Final = 9.80665

HOVER_THROTTLE, _SLOPE, _LAG_GAIN, _DRAG, _B0, _B1, _B2, _A1, _A2, _PACKED_SIZE = range(10)
"""Indices in a packed copter."""

LAGGED, ALTITUDE, CLIMB_RATE, SENSED, _MEMORY_1, _MEMORY_2, BODY_SIZE = range(7)
"""Indices in the state array of the body: throttle after the motors' lag, altitude and climb rate as estimated,
acceleration as sensed, and the memory of the accelerometer's filter."""

REFERENCE: Final = ("z_d_m", "v_d_m_s", "a_d_m_s2", "assumed_hover")
"""What a loop is given: the desired motion, and the throttle that it assumes to hover with."""
DISTURBANCES: Final = ("acceleration_m_s2", "altitude_m_s", "sensed_m_s2")
"""Of the acceleration, of the estimated altitude beyond it, and of the sensed acceleration alone."""
FLOWN: Final = ("z_m", "v_m_s", "a_m_s2", "throttle", "throttle_filtered", "throttle_slow")
"""The estimates that a loop used, the throttle that it demanded with them, what of it the motors get, and the slow part
of it: throttle activity is the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Copter:
    """What the model has in place of a vehicle: throttle in hover, 0 … 1, slope of log thrust over log throttle, lag of
    the motors, s, and drag, 1/s. The slope is 1 if the autopilot's thrust curve fits the propellers."""

    hover_throttle: float
    thrust_slope: float = 1.0
    motor_lag_s: float = 0.0
    drag_1_s: float = 0.0

    def packed(self, *, filter_hz: float, dt_s: float) -> Samples:
        """Constants of a step for the kernels; `filter_hz` is the cut-off of the accelerometer's filter."""
        numerator, denominator = accelerometer_filter(filter_hz, dt_s)
        packed = np.empty(_PACKED_SIZE)
        packed[HOVER_THROTTLE] = self.hover_throttle
        packed[_SLOPE] = self.thrust_slope
        packed[_LAG_GAIN] = motor_filter(self.motor_lag_s, dt_s)[0][0]
        packed[_DRAG] = self.drag_1_s
        packed[[_B0, _B1, _B2]] = numerator
        packed[[_A1, _A2]] = denominator[1:]
        return packed


Filter = tuple[Samples, Samples]
"""Numerator and denominator, of the same shape (k,)."""


def accelerometer_filter(cutoff_hz: float, dt_s: float) -> Filter:
    """The second-order Butterworth filter of INS_ACCEL_FILTER; none for a cut-off of 0, or beyond half the rate."""
    if not 0.0 < cutoff_hz < 0.5 / dt_s:
        return np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])

    cutoff = math.tan(math.pi * cutoff_hz * dt_s)
    damping = math.sqrt(2.0) * cutoff
    scale = 1.0 + damping + cutoff * cutoff
    passed = cutoff * cutoff / scale
    return (
        np.array([passed, 2.0 * passed, passed]),
        np.array([1.0, 2.0 * (cutoff * cutoff - 1.0) / scale, (1.0 - damping + cutoff * cutoff) / scale]),
    )


def motor_filter(lag_s: float, dt_s: float) -> Filter:
    """The first-order lag of the motors."""
    return low_pass(dt_s / (dt_s + lag_s))


def low_pass(gain: float) -> Filter:
    """The first-order filter that takes this share of each value."""
    return np.array([gain, 0.0]), np.array([1.0, gain - 1.0])


def filtered(values: Samples, *filters: Filter) -> Samples:
    """Values behind filters that were at rest at the first one, shape (n,)."""
    for numerator, denominator in filters:
        beyond = numerator[1:] - numerator[0] * denominator[1:]
        at_rest = np.cumsum(denominator)[:-1] * beyond.sum() / denominator.sum()
        at_rest[1:] -= np.cumsum(beyond)[:-1]
        values = passed(values, numerator, denominator, at_rest * values[0])
    return values


@kernel
def passed(values: Samples, numerator: Samples, denominator: Samples, memory: Samples) -> Samples:
    """Values behind a filter, shape (n,), in its transposed direct form II with this memory, (k - 1,)."""
    behind, order = np.empty_like(values), len(memory)
    memory = np.append(memory, 0.0)
    for row in range(len(values)):
        behind[row] = memory[0] + numerator[0] * values[row]
        for each in range(order):
            memory[each] = memory[each + 1] + numerator[each + 1] * values[row] - denominator[each + 1] * behind[row]
    return behind


@kernel
def advance(body: Samples, copter: Samples, dt: float, throttle: float, gust: float, beyond_z: float) -> None:
    """One step of `dt` with the `throttle` that the motors get, and with the first two of `DISTURBANCES`."""
    body[LAGGED] += copter[_LAG_GAIN] * (throttle - body[LAGGED])
    thrust = (body[LAGGED] / copter[HOVER_THROTTLE]) ** copter[_SLOPE]
    a = GRAVITY_M_S2 * (thrust - 1.0) - copter[_DRAG] * body[CLIMB_RATE] + gust
    body[CLIMB_RATE] += dt * a
    body[ALTITUDE] += dt * (body[CLIMB_RATE] + beyond_z)
    body[SENSED] = copter[_B0] * a + body[_MEMORY_1]
    body[_MEMORY_1] = copter[_B1] * a - copter[_A1] * body[SENSED] + body[_MEMORY_2]
    body[_MEMORY_2] = copter[_B2] * a - copter[_A2] * body[SENSED]


def start_body(throttle: float, z_m: float, v_m_s: float, a_m_s2: float, copter: Samples) -> NDArray[np.float64]:
    """State of the body, shape (BODY_SIZE,), whose motors and filter have come to rest at these values."""
    body = np.zeros(BODY_SIZE)
    body[[LAGGED, ALTITUDE, CLIMB_RATE, SENSED]] = throttle, z_m, v_m_s, a_m_s2
    body[_MEMORY_1] = (1.0 - copter[_B0]) * a_m_s2
    body[_MEMORY_2] = (copter[_B2] - copter[_A2]) * a_m_s2
    return body
