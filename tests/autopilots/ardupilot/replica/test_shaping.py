"""The square-root controller and the shaped trajectory against their formulas, evaluated by hand."""

import math

import numpy as np
import pytest

from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.ardupilot.replica.shaping import inverse_square_root, square_root
from app.autopilots.ardupilot.replica.vertical import (
    A_D,
    POSITION_ERROR,
    SATURATED,
    STATE_SIZE,
    V_D,
    VELOCITY_ERROR,
    Z_D,
    packed,
    shape,
)

DT = 0.0025
CLIMB, DESCENT, ACCELERATION, JERK = 2.5, 1.5, 1.0, 5.0

Motion = tuple[float, float, float]
LIMITS = Parameters(climb_m_s=CLIMB, descent_m_s=DESCENT, acceleration_m_s2=ACCELERATION, jerk_m_s3=JERK)


def advanced(
    motion: Motion,
    target: float,
    *,
    limits: Parameters = LIMITS,
    saturated: float = 0.0,
    position_error: float = 0.0,
    velocity_error: float = 0.0,
) -> Motion:
    state = np.zeros(STATE_SIZE)
    state[[Z_D, V_D, A_D]] = motion
    state[[SATURATED, POSITION_ERROR, VELOCITY_ERROR]] = saturated, position_error, velocity_error
    shape(state, packed(limits, DT), target)
    return float(state[Z_D]), float(state[V_D]), float(state[A_D])


@pytest.mark.parametrize(
    ("error", "p", "limit", "dt", "rate"),
    [
        (0.5, 1.0, 1.0, 0.0, 0.5),
        (1.0, 1.0, 1.0, 0.0, 1.0),
        (3.0, 1.0, 1.0, 0.0, math.sqrt(5.0)),
        (-3.0, 1.0, 1.0, 0.0, -math.sqrt(5.0)),
        (4.0, 0.0, 2.0, 0.0, 4.0),
        (-4.0, 0.0, 2.0, 0.0, -4.0),
        (4.0, 3.0, 0.0, 0.0, 12.0),
        (0.001, 1000.0, 0.0, DT, 0.4),
        (-0.001, 1000.0, 0.0, DT, -0.4),
        (0.001, 1.0, 1.0, DT, 0.001),
        (0.0, 0.0, 1.0, DT, 0.0),
    ],
)
def test_square_root_controller(error: float, p: float, limit: float, dt: float, rate: float) -> None:
    assert square_root(error, p, limit, dt) == pytest.approx(rate, rel=1e-12)


@pytest.mark.parametrize(
    ("rate", "p", "limit", "error"), [(0.5, 1.0, 1.0, 0.5), (2.5, 1.0, 1.0, 3.625), (-1.5, 3.0, 1.0, -1.18055555555556)]
)
def test_its_inverse(rate: float, p: float, limit: float, error: float) -> None:
    assert inverse_square_root(rate, p, limit) == pytest.approx(error, rel=1e-12)
    assert square_root(error, p, limit, 0.0) == pytest.approx(rate, rel=1e-12)


def test_at_rest_on_the_target_nothing_moves() -> None:
    assert advanced((3.0, 0.0, 0.0), 3.0) == (3.0, 0.0, 0.0)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_a_far_target_is_approached_with_the_jerk_at_its_limit_first(up: float) -> None:
    motion = (0.0, 0.0, 0.0)
    for _ in range(20):
        motion = advanced(motion, up * 100.0)
    accelerations = [up * JERK * DT * k for k in range(20)]
    speeds = [sum(accelerations[:k]) * DT for k in range(20)]
    z = sum(v * DT + 0.5 * a * DT * DT for v, a in zip(speeds, accelerations, strict=True))
    assert motion == pytest.approx((z, sum(accelerations) * DT, up * JERK * DT * 20), rel=1e-9)


@pytest.mark.parametrize(("target", "speed"), [(20.0, CLIMB), (-20.0, -DESCENT)])
def test_speed_and_acceleration_stay_within_their_limits_and_the_target_is_met(target: float, speed: float) -> None:
    motion, speeds, accelerations = (0.0, 0.0, 0.0), [], []
    for _ in range(8000):
        motion = advanced(motion, target)
        speeds.append(motion[1])
        accelerations.append(motion[2])
    assert max(speeds, key=abs) == pytest.approx(speed, rel=1e-3)
    assert max(accelerations, key=abs) == pytest.approx(math.copysign(ACCELERATION, target), rel=1e-6)
    assert max(map(abs, accelerations)) <= ACCELERATION
    assert motion == pytest.approx((target, 0.0, 0.0), abs=1e-4)


def test_a_descent_accelerates_at_7_5_m_s2_at_most_and_a_climb_as_set() -> None:
    down = up = (0.0, 0.0, 0.0)
    limits = Parameters(climb_m_s=50.0, descent_m_s=50.0, acceleration_m_s2=10.0, jerk_m_s3=100.0)
    for _ in range(200):
        down, up = advanced(down, -1000.0, limits=limits), advanced(up, 1000.0, limits=limits)
    assert (down[2], up[2]) == pytest.approx((-7.5, 10.0))


@pytest.mark.parametrize(("v", "change"), [(3.0, -2.0 * 3.0 / 2.5), (-2.0, 2.0 * 2.0 / 1.5), (2.5, -1.0)])
def test_beyond_its_speed_limit_it_brakes_with_more_jerk(v: float, change: float) -> None:
    """Twice the ratio of speed and limit; at the limit itself the plain jerk, towards a target below."""
    _, _, a = advanced((0.0, v, 0.0), 0.0)
    assert a == pytest.approx(change * JERK * DT)


@pytest.mark.parametrize("limit", [1.0, -1.0])
def test_towards_a_throttle_limit_it_advances_only_if_that_does_not_add_to_the_errors(limit: float) -> None:
    motion = (5.0, limit * 0.5, limit * 0.8)
    free = advanced(motion, 5.0)
    held = advanced(motion, 5.0, saturated=limit, position_error=limit * 0.1, velocity_error=limit * 0.1)
    assert held[:2] == motion[:2]
    z_only = advanced(motion, 5.0, saturated=limit, position_error=limit * 0.1, velocity_error=-limit * 0.1)
    assert z_only[:2] == (motion[0], free[1])
    v_only = advanced(motion, 5.0, saturated=limit, position_error=-limit * 0.1, velocity_error=limit * 0.1)
    assert v_only[:2] == (free[0], motion[1])
    away = advanced(motion, 5.0, saturated=-limit, position_error=-limit * 0.1, velocity_error=-limit * 0.1)
    assert away == free


@pytest.mark.parametrize("limit", [1.0, -1.0])
def test_at_a_throttle_limit_it_may_still_come_to_rest(limit: float) -> None:
    """A change of speed against the motion is taken, but not beyond zero."""
    slow = advanced((5.0, -limit * 0.001, limit), 5.0, saturated=limit, velocity_error=limit)
    assert slow[1] == 0.0
    fast = advanced((5.0, -limit, limit), 5.0, saturated=limit, velocity_error=limit)
    assert fast[1] == pytest.approx(-limit * (1.0 - DT))
