"""The replica of ArduCopter's loop against recorded runs of the original (origin: tests/data/ardupilot_loop/README.md),
and branch by branch against its formulas, evaluated by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.ardupilot.replica.parameters import STEP_S, Parameters
from app.autopilots.ardupilot.replica.replay import LoopTrace, replayed
from app.autopilots.ardupilot.replica.vertical import (
    A_D,
    A_T,
    ACCELERATION_SUM,
    FLIGHT,
    OUTPUTS,
    PHASE,
    POSITION_P,
    RAMP,
    SPOOL,
    STATE_SIZE,
    THROTTLE,
    THROTTLE_FILTERED,
    V_D,
    V_T,
    VELOCITY_SUM,
    Z_D,
    Packed,
    State,
    control,
    enter_position_mode,
    rollout,
    shape,
    start_hover,
    start_takeoff,
    take_off,
)
from app.autopilots.ardupilot.replica.vertical import (
    packed as constants_of,
)
from app.autopilots.ardupilot.replica.vertical import step as step_with_body
from app.autopilots.ardupilot.replica_check import read_ardupilot_trace
from app.core.models.copter import Copter, start_body

TRACES = sorted((Path(__file__).parents[3] / "data" / "ardupilot_loop").glob("*.csv.gz"))
TOLERANCES = np.array([1e-5, 2e-6, 1.2e-5, 4e-5, 1e-4, 0.01, 5e-5, 2e-5])
"""Of each output, over whole recordings, whose seven digits are 10 µm from 10 m on: asked are 1e-4 of z_d and v_t and
5e-4 of the throttle, which a replica in double precision does not reach in `steps_limits`."""
ROWS = 1500
THROTTLE_GAIN = STEP_S / (STEP_S + 1.0 / (2.0 * np.pi * 2.0))


def read(path: Path, rows: slice = slice(None)) -> LoopTrace:
    with path.open("rb") as stream:
        trace = read_ardupilot_trace(stream, name=path.name)
    return replace(trace, time_s=trace.time_s[rows], inputs=trace.inputs[rows], outputs=trace.outputs[rows])


def trace_named(name: str) -> LoopTrace:
    return read(next(path for path in TRACES if path.name.startswith(name)), slice(ROWS))


def largest_differences(trace: LoopTrace) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(np.abs(replayed(trace) - trace.outputs).max(axis=0))


def hovering(parameters: Parameters, *, throttle: float = 0.35, a: float = 0.0) -> tuple[State, Packed]:
    """A loop that was entered at rest at 5 m."""
    state, packed = np.empty(STATE_SIZE), constants_of(parameters)
    start_hover(state, packed, throttle, 5.0, 0.0, a)
    return state, packed


def on_the_ground(parameters: Parameters, spool_s: float = 0.0) -> tuple[State, Packed]:
    state, packed = np.empty(STATE_SIZE), constants_of(parameters)
    start_takeoff(state, packed, spool_s)
    return state, packed


def step(
    state: State, p: Packed, *, z: float = 5.0, v: float = 0.0, a: float = 0.0, lower: bool = False, upper: bool = False
) -> None:
    """A step towards a target of 5 m."""
    shape(state, p, 5.0)
    control(state, p, z, v, a, lower, upper)


def test_all_recorded_traces_are_here() -> None:
    assert [path.name for path in TRACES] == [
        "steps_all_terms.csv.gz", "steps_default.csv.gz", "steps_limits.csv.gz", "takeoff_heavy.csv.gz",
    ]  # fmt: skip


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.name)
def test_the_replica_runs_beside_the_recording_from_its_start(path: Path) -> None:
    assert (largest_differences(read(path, slice(ROWS))) < TOLERANCES).all()


@pytest.mark.complete
@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.name)
def test_the_replica_runs_beside_the_whole_recording(path: Path) -> None:
    trace = read(path)
    assert len(trace.time_s) >= 4800
    assert (largest_differences(trace) < TOLERANCES).all()


def largest_differences_beside(trace: LoopTrace, *, follow: bool) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Of the loop itself, which continues from every recorded row, or from none."""
    state, packed = np.empty(STATE_SIZE, dtype=np.float32), constants_of(trace.parameters, trace.dt_s)
    if trace.hover is None:
        start_takeoff(state, packed, 0.0)
    else:
        start_hover(state, packed, *trace.hover)
    computed, followed = np.empty_like(trace.outputs), np.full(len(trace.time_s), follow)
    rollout(state, packed, trace.inputs, trace.outputs, followed, computed)
    return np.asarray(np.abs(computed - trace.outputs).max(axis=0))


@pytest.mark.parametrize("path", TRACES, ids=lambda path: path.name)
def test_each_row_follows_from_the_recorded_one_before(path: Path) -> None:
    """The recording has seven digits: what one step leaves of that is far below the tolerances of a whole run."""
    allowed = np.array([1e-5, 5e-6, 6e-5, 4e-5, 6e-5, 3e-3, 2e-5, 3e-6])
    assert (largest_differences_beside(read(path, slice(ROWS)), follow=True) < allowed).all()


def test_in_single_precision_the_loop_decides_at_throttle_limits_as_the_firmware_does() -> None:
    """In double precision the run parts from the recording by 0.16 m/s² and 0.17 of the throttle."""
    trace = trace_named("steps_limits")
    assert trace.inputs[:, -2:].any(axis=1).sum() > 900
    assert (largest_differences_beside(trace, follow=False) < TOLERANCES).all()


@pytest.mark.parametrize("limit", ["lower", "upper"])
def test_around_an_active_throttle_limit_the_replay_continues_from_the_recording(limit: str) -> None:
    """The recording jumps by 0.5 m, with target and measurement, in a row at a limit: only that row can differ."""
    trace, jump = trace_named("steps_default"), 200
    inputs, outputs = trace.inputs.copy(), trace.outputs.copy()
    inputs[jump:, :2] += 0.5
    outputs[jump:, 0] += 0.5
    limited = inputs.copy()
    limited[jump, {"lower": -2, "upper": -1}[limit]] = 1.0
    moved = replace(trace, inputs=inputs, outputs=outputs)
    assert largest_differences(moved)[0] == pytest.approx(0.5, abs=1e-3)
    followed = replace(moved, inputs=limited)
    assert followed.followed.nonzero()[0].tolist() == [jump - 1, jump, jump + 1]
    differs = np.abs(replayed(followed) - outputs)[:, 0] > 1e-4
    assert differs.nonzero()[0].tolist() == [jump]


def test_a_trace_without_active_limits_runs_free() -> None:
    assert not trace_named("steps_default").followed.any()


def test_the_demand_is_the_same_after_the_controllers_start_anew() -> None:
    """I = 1000·(throttle − h) − P·100·(a_d − a) − FF·100·a_d, with a_d = a limited to ±1 m/s²."""
    parameters = Parameters(acceleration_ff=0.3)
    for a, a_d in ((0.4, 0.4), (2.0, 1.0), (-2.0, -1.0)):
        state, _ = hovering(parameters, throttle=0.5, a=a)
        integral = 1000.0 * (0.5 - 0.35) - 0.5 * 100.0 * (a_d - a) - 0.3 * 100.0 * a_d
        assert state[ACCELERATION_SUM] == pytest.approx(integral)


@pytest.mark.parametrize(("z", "error", "rate"), [(-5.0, 3.625, 2.5), (15.0, -1.625, -1.5)])
def test_a_desired_altitude_too_far_away_is_pulled_along(z: float, error: float, rate: float) -> None:
    """For P = 1 and 1 m/s² the errors that ask for 2.5 m/s up and 1.5 m/s down are 3.625 and −1.625 m."""
    state, p = hovering(Parameters())
    step(state, p, z=z)
    assert state[Z_D] == pytest.approx(z + error)
    assert state[V_T] == pytest.approx(rate + state[V_D])


def test_the_limits_of_the_position_error_are_those_of_the_gain_when_the_mode_was_entered() -> None:
    """With P = 3 the error for 2.5 m/s is 1/18 + 3.125 m; P = 1 asks for √(2·(3.18056 − 0.5)) m/s there."""
    state, p = hovering(Parameters(position_p_1_s=3.0))
    p[POSITION_P] = 1.0
    step(state, p, z=-5.0)
    assert state[Z_D] == pytest.approx(-5.0 + 1.0 / 18.0 + 3.125)
    assert state[V_T] == pytest.approx(np.sqrt(2.0 * (1.0 / 18.0 + 3.125 - 0.5)))
    enter_position_mode(state, p, 4.0, 0.0, 0.0)
    assert state[Z_D] == 4.0
    step(state, p, z=-5.0)
    assert state[Z_D] == pytest.approx(-5.0 + 3.625)


@pytest.mark.parametrize(
    ("v", "lower", "upper", "summed"),
    [
        (-0.1, False, False, True),
        (-0.1, True, False, True),
        (-0.1, False, True, False),
        (0.1, False, False, True),
        (0.1, True, False, False),
        (0.1, False, True, True),
    ],
)
def test_the_velocity_integrator_does_not_sum_towards_a_throttle_limit(
    v: float, lower: bool, upper: bool, summed: bool
) -> None:
    """The first error is (v_t − v)·100 unfiltered: ∓10 cm/s at rest."""
    state, p = hovering(Parameters(velocity_i_1_s2=2.0))
    step(state, p, v=v, lower=lower, upper=upper)
    assert state[VELOCITY_SUM] == pytest.approx(2.0 * -100.0 * v * STEP_S if summed else 0.0)


def test_the_velocity_integrator_is_limited_and_without_gain_zero() -> None:
    state, p = hovering(Parameters(velocity_i_1_s2=2.0, velocity_imax_cm_s2=0.01))
    step(state, p, v=-1.0)
    assert state[VELOCITY_SUM] == 0.01
    assert state[A_T] == pytest.approx((5.0 * 100.0 + 0.01) / 100.0)
    state, p = hovering(Parameters())
    step(state, p, v=-1.0)
    assert state[VELOCITY_SUM] == 0.0


@pytest.mark.parametrize("limit", ["lower", "upper"])
@pytest.mark.parametrize(("throttle", "a", "summed"), [(0.4, 0.2, True), (0.4, -0.2, False), (0.3, 0.2, False)])
def test_at_a_throttle_limit_the_acceleration_integrator_only_shrinks(
    limit: str, throttle: float, a: float, summed: bool
) -> None:
    """At rest the first error is −100·a; the integrator starts at 1000·(throttle − 0.35)."""
    state, p = hovering(Parameters(), throttle=throttle)
    step(state, p, a=a, lower=limit == "lower", upper=limit == "upper")
    begun = 1000.0 * (throttle - 0.35)
    assert state[ACCELERATION_SUM] == pytest.approx(begun - 100.0 * a * STEP_S if summed else begun)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_acceleration_integrator_is_limited_to_the_hover_throttle_at_least(up: float) -> None:
    state, p = hovering(Parameters(acceleration_imax_per_mille=10.0), throttle=0.35 + up * 0.5)
    step(state, p)
    assert state[ACCELERATION_SUM] == pytest.approx(up * 350.0)


def test_without_gain_the_acceleration_integrator_is_zero() -> None:
    state, p = hovering(Parameters(acceleration_i_1_s=0.0), throttle=0.5)
    step(state, p)
    assert state[ACCELERATION_SUM] == 0.0
    assert state[THROTTLE] == pytest.approx(0.35)


def test_the_rate_of_the_acceleration_target_is_fed_forward_from_the_second_step_on() -> None:
    """Per mille for cm/s³; unfiltered, the target's rate is its change over the step."""
    plain, p = hovering(Parameters())
    fed, q = hovering(Parameters(acceleration_d_ff_s=0.02))
    step(plain, p)
    step(fed, q)
    assert fed[THROTTLE] == plain[THROTTLE]
    before = plain[A_T]
    step(plain, p, v=-0.1)
    step(fed, q, v=-0.1)
    change = 0.02 * 100.0 * (plain[A_T] - before) / STEP_S / 1000.0
    assert abs(change) > 0.01
    assert fed[THROTTLE] - plain[THROTTLE] == pytest.approx(change)


@pytest.mark.parametrize(("demand", "end"), [(0.6, 0.6), (1.5, 1.0), (-0.2, 0.0)])
def test_the_motors_get_the_last_demand_through_a_2_hz_filter_within_0_and_1(demand: float, end: float) -> None:
    state, p = hovering(Parameters(), throttle=0.5)
    state[THROTTLE] = demand
    step(state, p)
    assert state[THROTTLE_FILTERED] == pytest.approx(0.5 + THROTTLE_GAIN * (demand - 0.5))
    for _ in range(400):
        state[THROTTLE] = demand
        step(state, p)
    assert state[THROTTLE_FILTERED] == pytest.approx(end, abs=1e-4)


def test_while_the_motors_spool_up_the_demand_decays_and_then_rises() -> None:
    """With a time constant of 0.16 s, for 0.17 s after the command; then by 1 in 2 s, without the filter."""
    state, p = on_the_ground(Parameters(), 0.17)
    assert (state[PHASE], state[THROTTLE]) == (SPOOL, 0.0)
    state[THROTTLE] = 0.3
    for _ in range(67):
        take_off(state, p, 0.0, 0.0, 0.0)
    assert state[PHASE] == SPOOL
    assert state[THROTTLE] == pytest.approx(0.3 * (0.16 / (0.16 + STEP_S)) ** 67)
    take_off(state, p, 0.0, 0.0, 0.0)
    assert state[PHASE] == RAMP
    reached = state[THROTTLE]
    for _ in range(2):
        take_off(state, p, 0.0, 0.0, 0.0)
    assert state[THROTTLE] == pytest.approx(reached + 2.0 * STEP_S / 2.0)
    assert state[THROTTLE_FILTERED] == pytest.approx(reached + STEP_S / 2.0)


@pytest.mark.parametrize(
    ("v", "a", "steps"), [(0.0, 0.5, 1), (0.0, 0.49, 320), (0.25, 0.0, 1), (0.24, 0.0, 320), (-1.0, -1.0, 320)]
)
def test_the_ramp_ends_with_lift_off_or_at_the_largest_throttle(v: float, a: float, steps: int) -> None:
    """At half of 1 m/s², at a tenth of 2.5 m/s, or here at a throttle of 0.4, after 320 steps of 1/800."""
    state, p = on_the_ground(Parameters(takeoff_throttle=0.4 - 1e-9))
    taken = 0
    while state[PHASE] == RAMP:
        take_off(state, p, 0.0, v, a)
        taken += 1
    assert (state[PHASE], taken) == (FLIGHT, steps)


def test_a_rollout_takes_off_and_flies_on() -> None:
    """The recorded takeoff leaves the ramp after 506 rows; the motors see the last of its demands unfiltered."""
    trace = trace_named("takeoff_heavy")
    computed = replayed(trace)
    demand, filtered = (computed[:, OUTPUTS.index(name)] for name in ("throttle", "throttle_filtered"))
    assert np.diff(demand[:506]) == pytest.approx(0.00125, abs=6e-8)
    assert filtered[506] == demand[505]
    assert filtered[507] != demand[506]


def test_a_loop_until_4_0_demands_the_change_of_its_climb_rate_target_as_acceleration() -> None:
    """0.02 m below its target at rest: P·e = 1/s · 0.02 m, changed within a step; nothing in the step of a reset."""
    parameters = Parameters(position_p_1_s=1.0)
    state, packed = np.empty(STATE_SIZE), constants_of(parameters, differentiates=True)
    start_hover(state, packed, 0.35, 5.0, 0.0, 0.0)
    copter = Copter(hover_throttle=0.35, thrust_slope=1.0, motor_lag_s=0.0, drag_1_s=0.0)
    constants = copter.packed(filter_hz=0.0, dt_s=STEP_S)
    for altitude_m, demanded_m_s2 in ((4.98, 0.0), (4.96, 0.02 / STEP_S)):
        body = start_body(0.35, altitude_m, 0.0, 0.0, constants)
        step_with_body(state, body, packed, constants, np.array([5.0, 0.0, 0.0, 0.35]), np.zeros(3))
        assert state[A_D] == pytest.approx(demanded_m_s2)
