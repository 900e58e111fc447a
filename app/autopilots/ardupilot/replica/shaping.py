"""ArduCopter's square-root controller, and the parts of its jerk-limited trajectory to an altitude target.

Altitude, climb rate and acceleration are positive up, in m, m/s and m/s². Gains do not enter: the trajectory depends on
the target and its limits alone, except while the throttle is at a limit. The parts are small, so that the compiler puts
them into the loop.
"""

import math
from typing import Final

from app.core.kernels import kernel

LARGEST_DESCENT_ACCELERATION_M_S2: Final = 7.5
OVERSPEED_GAIN: Final = 2.0


@kernel
def clip(value: float, low: float, high: float) -> float:
    """`value` limited to `low` … `high`."""
    return max(low, min(high, value))


@kernel
def square_root(error: float, p: float, limit: float, dt: float) -> float:
    """Rate that corrects `error`: proportional near zero, and beyond such that its change does not exceed `limit`.

    `p` ≥ 0 is the slope at zero, 1/s, and 0 means none; `limit` ≤ 0 means no limit. With `dt` > 0, s, the rate does not
    overshoot zero within one step.
    """
    linear = limit / (p * p) if p > 0.0 else 0.0
    if limit <= 0.0 or abs(error) <= linear:
        rate = p * error
    else:
        rate = math.sqrt(2.0 * limit * (abs(error) - 0.5 * linear))
        rate = rate if error > 0.0 else -rate
    if dt > 0.0:
        largest = abs(error) / dt
        rate = clip(rate, -largest, largest)
    return rate


@kernel
def inverse_square_root(rate: float, p: float, limit: float) -> float:
    """Error for which `square_root` gives `rate`; `p` and `limit` are positive."""
    if abs(rate) < limit / p:
        return rate / p
    error = 0.5 * limit / (p * p) + rate * rate / (2.0 * limit)
    return error if rate > 0.0 else -error


@kernel
def overspeed_factor(v: float, climb: float, descent: float) -> float:
    """Factor on the limits of acceleration and jerk at the desired climb rate `v`; 1 within −`descent` … `climb`."""
    if v > climb:
        return OVERSPEED_GAIN * v / climb
    return OVERSPEED_GAIN * v / -descent if v < -descent else 1.0


@kernel
def extrapolated(
    z: float, v: float, a: float, saturated: float, position_error: float, velocity_error: float, dt: float
) -> tuple[float, float]:
    """Desired altitude and climb rate one step later.

    `saturated` is the throttle limit of the last step: −1 lower, +1 upper, 0 none. Towards it, `z` and `v` advance only
    as long as they do not add to the errors of the last step, of which the sign alone counts.
    """
    change = v * dt + 0.5 * a * dt * dt
    if not (change * saturated > 0.0 and position_error * saturated > 0.0):
        z += change
    change = a * dt
    if change * saturated > 0.0 and velocity_error * saturated > 0.0:
        change = clip(change, -abs(v), abs(v)) if v * saturated < 0.0 else 0.0
    return z, v + change


@kernel
def approach_rate(
    error: float, climb: float, descent: float, acceleration: float, downward: float, jerk: float, dt: float
) -> float:
    """Climb rate, −`descent` … `climb`, from which the distance `error` to the target suffices to come to rest.

    `acceleration` and `downward` are the largest accelerations up and down.
    """
    braking = downward if error > 0.0 else acceleration
    return clip(square_root(error, 0.5 * jerk / braking, 0.5 * braking, dt), -descent, climb)
