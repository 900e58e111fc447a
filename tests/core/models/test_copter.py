"""The copter under ArduCopter's loop: its physics, step by step, and what the loop makes of it."""

import math

import numpy as np
import pytest

from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters
from app.core.models.copter import (
    ALTITUDE,
    CLIMB_RATE,
    DISTURBANCES,
    FLOWN,
    GRAVITY_M_S2,
    LAGGED,
    REFERENCE,
    SENSED,
    Copter,
    accelerometer_filter,
    filtered,
    motor_filter,
    start_body,
)
from app.core.records.trajectory import Samples

COPTER = Copter(hover_throttle=0.4, thrust_slope=1.2, motor_lag_s=0.05, drag_1_s=0.3)
PARAMETERS = Parameters(hover_throttle=0.4)


def flown(disturbances: Samples, *, parameters: Parameters = PARAMETERS, z_m: float = 0.0) -> Samples:
    """Flight about the altitude 0, shape (n, 6), from hover."""
    packed, copter = loop.packed(parameters), COPTER.packed(filter_hz=20.0, dt_s=STEP_S)
    state, found = np.empty(loop.STATE_SIZE), np.empty((len(disturbances), len(FLOWN)))
    loop.start_hover(state, packed, COPTER.hover_throttle, z_m, 0.0, 0.0)
    body = start_body(COPTER.hover_throttle, z_m, 0.0, 0.0, copter)
    loop.fly(state, body, packed, copter, np.zeros((len(disturbances), len(REFERENCE))), disturbances, found)
    return found


def none(seconds: float) -> Samples:
    return np.zeros((round(seconds / STEP_S), len(DISTURBANCES)))


def test_it_rests_in_hover() -> None:
    found = flown(none(5.0))
    assert np.abs(found[:, :3]).max() < 1e-9
    assert found[:, FLOWN.index("throttle")] == pytest.approx(0.4)


def test_a_lasting_disturbance_is_compensated_by_the_throttle_that_it_takes() -> None:
    """A downdraught of 1 m/s² takes the thrust to (g + 1)/g, and with the slope 1.2 the throttle to its 1.2th root."""
    pushed = none(20.0)
    pushed[:, DISTURBANCES.index("acceleration_m_s2")] = -1.0
    found = flown(pushed)
    assert found[-1, 0] == pytest.approx(0.0, abs=1e-4)
    needed = 0.4 * (1.0 + 1.0 / GRAVITY_M_S2) ** (1.0 / 1.2)
    assert found[-1, FLOWN.index("throttle_filtered")] == pytest.approx(needed, rel=1e-4)


def test_an_offset_at_the_start_is_flown_out() -> None:
    found = flown(none(12.0), z_m=0.5)
    assert found[0, 0] == 0.5
    assert abs(found[-1, 0]) < 1e-3


def test_a_step_without_control_obeys_the_equation_of_motion() -> None:
    """All gains at nothing, the throttle 10 % above hover, at 2 m/s: one step of explicit Euler."""
    idle = Parameters(
        position_p_1_s=1e-9, velocity_p_1_s=0.0, acceleration_p=0.0, acceleration_i_1_s=0.0, hover_throttle=0.44
    )
    copter = COPTER.packed(filter_hz=20.0, dt_s=STEP_S)
    packed, state = loop.packed(idle), np.empty(loop.STATE_SIZE)
    loop.start_hover(state, packed, 0.44, 0.0, 2.0, 0.0)
    body = start_body(0.44, 0.0, 2.0, 0.0, copter)
    loop.step(state, body, packed, copter, np.zeros(3), np.array([0.5, 0.125, 0.0]))
    a = GRAVITY_M_S2 * (1.1**1.2 - 1.0) - 0.3 * 2.0 + 0.5
    v = 2.0 + STEP_S * a
    assert body[LAGGED] == pytest.approx(0.44)
    assert body[CLIMB_RATE] == pytest.approx(v)
    assert body[ALTITUDE] == pytest.approx(STEP_S * (v + 0.125))
    assert body[SENSED] == pytest.approx(accelerometer_filter(20.0, STEP_S)[0][0] * a)


def test_the_accelerometer_s_filter_passes_half_the_power_at_its_cut_off() -> None:
    time_s = np.arange(0.0, 4.0, STEP_S)
    wave = np.sin(2.0 * math.pi * 20.0 * time_s)
    behind = filtered(wave, accelerometer_filter(20.0, STEP_S))
    assert np.ptp(behind[800:]) / np.ptp(wave[800:]) == pytest.approx(math.sqrt(0.5), rel=0.01)


@pytest.mark.parametrize("cutoff_hz", [0.0, 200.0, 250.0])
def test_a_filter_that_is_off_or_beyond_half_the_rate_is_none(cutoff_hz: float) -> None:
    noise = np.random.default_rng(1).standard_normal(100)
    assert filtered(noise, accelerometer_filter(cutoff_hz, STEP_S)) == pytest.approx(noise)


def test_the_motors_reach_63_percent_within_their_lag() -> None:
    rise = filtered(np.concatenate([np.zeros(1), np.ones(400)]), motor_filter(0.1, STEP_S))
    assert rise[round(0.1 / STEP_S)] == pytest.approx(1.0 - math.exp(-1.0), abs=0.01)


def test_filters_begin_at_rest() -> None:
    constant = np.full(50, 3.0)
    assert filtered(constant, motor_filter(0.1, STEP_S), accelerometer_filter(20.0, STEP_S)) == pytest.approx(constant)


def test_a_body_begins_at_rest_behind_its_filter() -> None:
    copter = COPTER.packed(filter_hz=20.0, dt_s=STEP_S)
    body = start_body(0.4, 1.0, 0.0, 0.5, copter)
    state, packed = np.empty(loop.STATE_SIZE), loop.packed(PARAMETERS)
    loop.start_hover(state, packed, 0.4, 1.0, 0.0, 0.5)
    loop.step(state, body, packed, copter, np.array([1.0, 0.0, 0.5]), np.array([0.5, 0.0, 0.0, 0.0]))
    assert body[SENSED] == pytest.approx(0.5)
