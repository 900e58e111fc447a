"""The replica of PX4's loop against recorded runs of the original (origin: tests/data/px4_loop/README.md), and branch
by branch against its formulas, evaluated by hand. Velocities and accelerations are positive down."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.px4.replica.parameters import Parameters
from app.autopilots.px4.replica.replay import LoopTrace, replayed
from app.autopilots.px4.replica.vertical import (
    ACCELERATION_TARGET,
    DISARMED,
    FLIGHT,
    HOVER_THRUST,
    INPUTS,
    INTEGRAL,
    OUTPUTS,
    RAMP_SPEED,
    RAMP_UP,
    READY,
    SPOOL_UP,
    STATE_SIZE,
    TAKEOFF,
    THRUST,
    VELOCITY,
    VELOCITY_TARGET,
    Packed,
    State,
    rollout,
    start,
    start_hover,
)
from app.autopilots.px4.replica.vertical import (
    packed as constants_of,
)
from app.autopilots.px4.replica_check import read_px4_trace
from app.core.records.trajectory import Samples

DATA = Path(__file__).parents[3] / "data" / "px4_loop"
FLIGHTS = {
    "default_steps_push.csv.gz": ((1550, 6283, 10354, 10484), False),
    "stiff_steps_push.csv.gz": ((1760, 2596, 5293, 6078, 7999, 8279, 8342), False),
    "soft_steps_push.csv.gz": ((2163, 2714, 3326, 6043, 8649, 8771, 8835), True),
}
"""Recorded flights: the rows of which something was read one row later, and whether the spool-up began before them."""
NAN = math.nan
G = 9.80665


def read(name: str, rows: slice = slice(None)) -> LoopTrace:
    with (DATA / name).open("rb") as stream:
        trace = read_px4_trace(stream, name=name)
    return replace(
        trace,
        time_s=trace.time_s[rows],
        inputs=trace.inputs[rows],
        late_inputs=trace.late_inputs[rows],
        outputs=trace.outputs[rows],
    )


def differences(trace: LoopTrace, computed: Samples) -> Samples:
    """|replica − recording|, shape (n, 6): 0 where neither has a value, infinite where one has."""
    apart = np.abs(computed - trace.outputs)
    apart[np.isnan(computed) & np.isnan(trace.outputs)] = 0.0
    apart[np.isnan(apart)] = np.inf
    return apart


def flying(parameters: Parameters, *, thrust: float = 0.5, vz: float = 0.0) -> tuple[State, Packed]:
    """A loop in hover with a hover thrust of 0.5."""
    state, packed = np.empty(STATE_SIZE, dtype=np.float32), constants_of(parameters)
    start_hover(state, packed, 0.5, thrust, vz)
    return state, packed


def disarmed(parameters: Parameters) -> tuple[State, Packed]:
    state, packed = np.empty(STATE_SIZE, dtype=np.float32), constants_of(parameters)
    start(state, packed)
    return state, packed


def run(state: State, packed: Packed, steps: int = 1, **given: float) -> None:
    """Steps at 0 m and at rest, armed, with a new set-point of nothing but what is `given` by column."""
    usual = dict.fromkeys(INPUTS, 0.0) | {
        "dt_s": 0.008, "set_z_m": NAN, "set_vz_m_s": NAN, "set_az_m_s2": NAN, "set_new": 1.0, "hover_estimate": NAN,
        "armed": 1.0, "limit_up_m_s": 3.0, "limit_down_m_s": 1.5,
    }  # fmt: skip
    rows = np.array([[(usual | given)[name] for name in INPUTS]] * steps, dtype=np.float32)
    rollout(state, packed, rows, np.empty((steps, len(OUTPUTS)), dtype=np.float32))


def test_random_inputs_give_what_the_original_gave() -> None:
    """Rows 0 to 1200 pass through every state of the takeoff."""
    trace = read("wild_inputs.csv.gz", slice(1200))
    assert set(trace.outputs[:, 0]) == {SPOOL_UP, READY, RAMP_UP, FLIGHT}
    assert differences(trace, replayed(trace).outputs).max() < 2e-7


@pytest.mark.complete
def test_all_random_inputs_give_what_the_original_gave() -> None:
    trace = read("wild_inputs.csv.gz")
    replay = replayed(trace)
    assert len(trace.time_s) == 3000
    assert differences(trace, replay.outputs).max() < 2e-7
    assert (replay.late_rows, replay.armed_before) == ((), False)


def follows(name: str, rows: slice) -> None:
    """Every row agrees to the recorded digits, but for the share of a tilted thrust at the limits of thrust."""
    trace, (late_rows, armed_before) = read(name, rows), FLIGHTS[name]
    replay = replayed(trace)
    apart = differences(trace, replay.outputs)[:, :4]
    at_limit = np.isin(replay.outputs[:, THRUST].astype(np.float32), np.array([0.001, 0.12, 1.0], dtype=np.float32))
    assert apart[:, THRUST][at_limit].max() < 2.1e-3
    apart[at_limit, THRUST] = 0.0
    assert (apart.max(axis=0) < [1e-9, 1e-8, 1e-7, 1e-7]).all()
    assert replay.armed_before == armed_before
    assert replay.late_rows == tuple(row for row in late_rows if row < len(trace.time_s))


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_takeoff_follows_the_recorded_flight(name: str) -> None:
    """Takeoff, climb, and hold with a hover estimate; in one flight with the first row of offboard control."""
    follows(name, slice(1600))


@pytest.mark.complete
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_whole_recorded_flight_is_followed(name: str) -> None:
    follows(name, slice(None))


def test_velocity_and_thrust_of_a_position_error() -> None:
    """v = 1.5·(−2 + 1) + 0.1 = −1.4; a = −0.3 + 8·(−1.4) = −11.5; T = 0.5·(1 + 11.5/g), above 1: 1."""
    state, packed = flying(Parameters(position_p_1_s=1.5, velocity_p_1_s=8.0))
    run(state, packed, z_m=-1.0, set_z_m=-2.0, set_vz_m_s=0.1, set_az_m_s2=-0.3)
    assert state[VELOCITY_TARGET] == pytest.approx(-1.4)
    assert state[ACCELERATION_TARGET] == pytest.approx(-11.5)
    assert state[THRUST] == 1.0


def test_derivative_acts_on_the_filtered_measurement() -> None:
    """d = 0.200849·0.08/0.008 = 2.00849; a = 4·(0 − 0.08) − 0.5·d."""
    state, packed = flying(Parameters(velocity_d=0.5))
    run(state, packed, vz_m_s=0.08, set_z_m=0.0)
    assert state[ACCELERATION_TARGET] == pytest.approx(-0.32 - 0.5 * 2.0084864, rel=1e-5)


@pytest.mark.parametrize(("z", "target"), [(-9.0, -2.0), (9.0, 1.5)])
def test_limits_of_the_mode_bound_the_velocity(z: float, target: float) -> None:
    state, packed = flying(Parameters())
    run(state, packed, set_z_m=z, limit_up_m_s=2.0)
    assert state[VELOCITY_TARGET] == target


def test_a_negative_limit_downwards_is_none_at_all() -> None:
    state, packed = flying(Parameters())
    run(state, packed, set_z_m=1.0, limit_down_m_s=-1.0)
    assert state[VELOCITY_TARGET] == 0.0


def test_integral_of_the_velocity_error() -> None:
    """After a step: I = 2·(−0.5)·0.008."""
    state, packed = flying(Parameters())
    run(state, packed, set_z_m=-0.5)
    assert state[INTEGRAL] == pytest.approx(-0.008)


@pytest.mark.parametrize(
    ("thrust", "z", "moves"), [(0.12, 1.0, False), (0.12, -0.3, True), (1.0, -3.0, False), (1.0, 0.3, True)]
)
def test_the_integral_waits_at_a_limit_of_thrust_unless_it_leads_away(thrust: float, z: float, moves: bool) -> None:
    state, packed = flying(Parameters(velocity_p_1_s=0.001), thrust=thrust - 1e-6 if thrust < 0.5 else thrust + 1e-6)
    before = float(state[INTEGRAL])
    run(state, packed, set_z_m=z)
    assert (abs(state[INTEGRAL] - before) > 1e-4) == moves


def test_the_integral_is_bounded_by_gravity() -> None:
    state, packed = flying(Parameters())
    state[INTEGRAL] = -30.0
    run(state, packed, set_z_m=1.0)
    assert state[ACCELERATION_TARGET] == pytest.approx(4.0 - G)


def test_a_new_hover_thrust_leaves_the_thrust_as_it_is() -> None:
    """a' solves 0.6·(1 − a'/g) = 0.5·(1 − a/g); without an error a = I."""
    state, packed = flying(Parameters(), thrust=0.55)
    run(state, packed, set_z_m=0.0, hover_estimate=0.6)
    assert state[HOVER_THRUST] == np.float32(0.6)
    assert state[THRUST] == pytest.approx(0.55)
    assert state[ACCELERATION_TARGET] == pytest.approx(G * (1.0 - 0.55 / 0.6), rel=1e-5)


@pytest.mark.parametrize(("estimate", "adopted"), [(0.01, 0.05), (0.99, 0.9)])
def test_bounds_of_the_hover_thrust(estimate: float, adopted: float) -> None:
    state, packed = flying(Parameters())
    run(state, packed, set_z_m=0.0, hover_estimate=estimate)
    assert state[HOVER_THRUST] == np.float32(adopted)


@pytest.mark.parametrize(("dt", "counted"), [(0.0001, 0.002), (0.2, 0.04)])
def test_intervals_are_bounded(dt: float, counted: float) -> None:
    state, packed = flying(Parameters())
    run(state, packed, dt_s=dt, set_z_m=-0.5)
    assert state[INTEGRAL] == pytest.approx(2.0 * -0.5 * counted)


@pytest.mark.parametrize(("speed", "velocity"), [(0.35, 0.15), (-0.7, 0.3), (2.0, 0.3), (0.0, 0.0)])
def test_without_a_target_of_altitude_the_velocity_is_blended_with_the_slope_of_altitude(
    speed: float, velocity: float
) -> None:
    state, packed = flying(Parameters())
    run(state, packed, z_derivative_m_s=0.3, set_vz_m_s=speed)
    assert state[VELOCITY] == pytest.approx(velocity)
    assert state[VELOCITY_TARGET] == pytest.approx(min(speed, 1.5))


def test_an_acceleration_alone_is_followed_without_feedback() -> None:
    state, packed = flying(Parameters(), thrust=0.6)
    run(state, packed, set_az_m_s2=1.0)
    assert math.isnan(state[VELOCITY_TARGET])
    assert state[THRUST] == pytest.approx(0.5 * (1.0 - 1.0 / G))


def test_ground_contact_in_flight_withdraws_the_set_points_until_new_ones_arrive() -> None:
    state, packed = flying(Parameters(), thrust=0.6)
    run(state, packed, set_z_m=-1.0, ground_contact=1.0)
    assert (state[THRUST], state[ACCELERATION_TARGET], state[INTEGRAL]) == (np.float32(0.12), 100.0, 0.0)
    run(state, packed, set_z_m=-1.0, set_new=0.0)
    assert state[ACCELERATION_TARGET] == 100.0
    run(state, packed, set_z_m=-1.0)
    assert state[VELOCITY_TARGET] == -1.0


def test_states_of_a_takeoff_in_their_order() -> None:
    state, packed = disarmed(Parameters(ramp_s=0.08))
    run(state, packed, armed=0.0)
    assert (state[TAKEOFF], state[THRUST]) == (DISARMED, np.float32(0.001))
    run(state, packed, 125)
    assert state[TAKEOFF] == SPOOL_UP
    run(state, packed)
    assert state[TAKEOFF] == READY
    assert state[RAMP_SPEED] == pytest.approx(-G / 4.0)
    run(state, packed, want_takeoff=1.0, set_z_m=-1.0)
    assert state[TAKEOFF] == RAMP_UP
    assert state[RAMP_SPEED] == pytest.approx(-G / 4.0 + 0.1 * (3.0 + G / 4.0))
    assert state[VELOCITY_TARGET] == -state[RAMP_SPEED]
    run(state, packed, 10, set_z_m=-1.0)
    assert state[TAKEOFF] == FLIGHT
    run(state, packed, landed=1.0, want_takeoff=1.0)
    assert state[TAKEOFF] == READY
    run(state, packed, armed=0.0)
    assert state[TAKEOFF] == DISARMED


def test_several_states_pass_in_one_step() -> None:
    state, packed = disarmed(Parameters(spool_s=0.0, ramp_s=0.0))
    run(state, packed, want_takeoff=1.0, set_z_m=-1.0)
    assert (state[TAKEOFF], state[RAMP_SPEED]) == (RAMP_UP, 3.0)
    run(state, packed, set_z_m=-1.0)
    assert state[TAKEOFF] == FLIGHT


def test_during_the_ramp_hover_thrust_is_the_parameter_and_accelerations_beside_a_velocity_are_dropped() -> None:
    state, packed = disarmed(Parameters(spool_s=0.0, ramp_s=1e9, velocity_p_1_s=4.0))
    run(state, packed, want_takeoff=1.0, set_vz_m_s=G / 4.0, set_z_m=0.0, limit_down_m_s=9.0)
    dropped = float(state[ACCELERATION_TARGET])
    run(state, packed, set_vz_m_s=G / 4.0, set_z_m=0.0, set_az_m_s2=-3.0, limit_down_m_s=9.0, hover_estimate=0.6)
    assert dropped == pytest.approx(G)
    assert state[HOVER_THRUST] == 0.5
    before = float(state[ACCELERATION_TARGET])
    run(state, packed, set_z_m=9.0, set_az_m_s2=-3.0, limit_down_m_s=G / 4.0)
    assert state[ACCELERATION_TARGET] < before - 2.9


def test_a_rollout_continues_where_the_one_before_ended() -> None:
    trace = read("default_steps_push.csv.gz", slice(200, 203))
    inputs, outputs = trace.inputs.astype(np.float32), np.empty((3, len(OUTPUTS)), dtype=np.float32)
    state, packed = flying(trace.parameters)
    rollout(state, packed, inputs, outputs)
    interrupted, one = np.empty_like(state), np.empty((1, len(OUTPUTS)), dtype=np.float32)
    start_hover(interrupted, packed, 0.5, 0.5, 0.0)
    for row, expected in enumerate(outputs):
        rollout(interrupted, packed, inputs[row : row + 1], one)
        np.testing.assert_array_equal(one[0], expected)
