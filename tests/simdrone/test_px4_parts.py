"""PX4's trajectory and its estimator of the hover thrust: against a recorded flight of its binary, an automatic takeoff
to 3 m and steps (tests/data/px4_loop/README.md), and within their limits."""

import csv
import gzip
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.px4.simulated_control import LOOP_S, estimate_hover, estimator_settings, started_estimate
from app.autopilots.px4.simulated_trajectory import Limits, Trajectory
from app.core.records.trajectory import Samples

FLIGHT = Path(__file__).parents[1] / "data" / "px4_loop" / "default_steps_push.csv.gz"
SETTINGS = {
    "MPC_THR_HOVER": 0.5,
    "HTE_HT_ERR_INIT": 0.1,
    "HTE_HT_NOISE": 0.0036,
    "HTE_ACC_GATE": 3.0,
    "HTE_THR_RANGE": 0.2,
    "HTE_VZ_THR": 2.0,
}
"""The flight's."""
TAKEOFF = Limits(1.5, 0.5, 4.0)
RAMP_UP, FLYING = 4.0, 5.0


@pytest.fixture(scope="module")
def flight() -> dict[str, Samples]:
    """Its columns, positive down; NaN where nothing was given."""
    with gzip.open(FLIGHT, "rt") as file:
        file.readline()
        names, *rows = csv.reader(file)
    values = np.array([[float(cell or "nan") for cell in row] for row in rows])
    return dict(zip(names, values.T, strict=True))


def test_the_estimated_hover_thrust_is_that_of_the_binary(flight: dict[str, Samples]) -> None:
    """From 1 m above the ground on, which the flight's altitude shows as 1.24 m."""
    begins = np.flatnonzero((flight["takeoff_state"] == FLYING) & (flight["z_m"] < -1.24))[0]
    a, v, dt = -flight["az_m_s2"], -flight["vz_m_s"], flight["dt_s"]
    thrust = np.roll(flight["out_thrust"], 1)
    state, packed = started_estimate(SETTINGS), estimator_settings(SETTINGS)
    found = np.array(
        [estimate_hover(state, packed, a[row], thrust[row], v[row], dt[row]) for row in range(begins, len(a))]
    )
    told = flight["hover_estimate"][begins:]
    both = ~np.isnan(found) & ~np.isnan(told)
    assert both.sum() > 9000
    assert np.abs(found - told)[both].max() < 0.0015


def test_the_trajectory_of_a_takeoff_is_that_of_the_binary(flight: dict[str, Samples]) -> None:
    """In the first 4 s of the ramp, before the target changes. A step may fall 8 ms earlier or later."""
    first = int(np.flatnonzero(flight["takeoff_state"] == RAMP_UP)[0])
    time_s, set_v = np.cumsum(flight["dt_s"]), -flight["set_vz_m_s"]
    renewed = first + np.flatnonzero(np.diff(set_v[first - 1 : first + 500]))
    trajectory = Trajectory()
    trajectory.start(-flight["z_m"][first], set_v[first])
    last_s = time_s[first - 1]
    for row in renewed:
        trajectory.altitude_m = -flight["z_m"][row]
        trajectory.step(TAKEOFF.approach_speed(3.28 - trajectory.altitude_m), TAKEOFF, time_s[row] - last_s)
        last_s = time_s[row]
        assert trajectory.altitude_m == pytest.approx(-flight["set_z_m"][row], abs=0.002)
        assert trajectory.climb_m_s == pytest.approx(set_v[row], abs=0.03)


@pytest.mark.parametrize("goal_m", [0.5, 3.0, 30.0, -3.0])
def test_a_trajectory_stays_within_its_limits_and_arrives(goal_m: float) -> None:
    limits, trajectory = Limits(3.0, 4.0, 4.0), Trajectory()
    trajectory.start(0.0, 0.0)
    motion = []
    for _ in range(round(25.0 / LOOP_S)):
        trajectory.step(limits.approach_speed(goal_m - trajectory.altitude_m), limits, LOOP_S)
        motion.append((trajectory.altitude_m, trajectory.climb_m_s, trajectory.acceleration_m_s2))
    altitude, climb, acceleration = np.array(motion).T
    assert altitude[-1] == pytest.approx(goal_m, abs=0.005)
    assert np.abs(altitude).max() < abs(goal_m) + 0.001
    assert np.abs(climb).max() < 3.0 + 1e-9
    assert np.abs(np.diff(altitude) / LOOP_S - climb[:-1]).max() < 0.02
    assert np.abs(acceleration).max() < 4.0 + 1e-9
    assert np.abs(np.diff(acceleration)).max() < 4.0 * LOOP_S + 1e-9


def test_a_trajectory_stops_where_its_limits_allow() -> None:
    limits, trajectory = Limits(3.0, 4.0, 4.0), Trajectory()
    trajectory.start(0.0, 2.0)
    goal_m = limits.stopping_distance(2.0)
    assert limits.approach_speed(goal_m) == pytest.approx(2.0)
    for _ in range(round(25.0 / LOOP_S)):
        trajectory.step(limits.approach_speed(goal_m - trajectory.altitude_m), limits, LOOP_S)
    assert trajectory.altitude_m == pytest.approx(goal_m, abs=0.001)
