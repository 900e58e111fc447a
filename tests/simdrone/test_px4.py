"""How the simulated PX4 answers and flies."""

from itertools import pairwise

import pytest

from tests.simdrone.copters import (
    ARM,
    ARMED,
    FORCE,
    INT32,
    POSITION,
    REAL32,
    SET_INTERVAL,
    SET_MODE,
    TAKE_OFF,
    Px4,
    bytewise,
    integer,
)
from tests.simdrone.ground import flying

TAKING_OFF, LOITER, LANDING = (4 << 16 | sub << 24 for sub in (2, 3, 6))
OFFBOARD = 6 << 16
PREARM_CHECK = 1 << 28


@pytest.fixture
def pilot() -> Px4:
    ground = flying("px4")
    return Px4(ground)


def test_it_is_a_copter_of_px4_half_a_metre_above_its_own_origin(pilot: Px4) -> None:
    beat = pilot.ground.expect("HEARTBEAT")
    assert (beat.type, beat.autopilot, beat.base_mode & ARMED) == (2, 12, 0)
    assert -pilot.ground.expect("LOCAL_POSITION_NED").z == pytest.approx(0.51, abs=0.01)


@pytest.mark.parametrize(("interval_us", "steps_ms"), [(0.0, {19, 20}), (8000.0, {7, 8})])
def test_the_position_comes_at_50_hz_and_faster_when_asked(interval_us: float, steps_ms: set[int], pilot: Px4) -> None:
    assert pilot.command(SET_INTERVAL, POSITION, interval_us) == 0
    pilot.ground.listen(0.5)
    heard = [each for each in pilot.ground.listen(2.0) if each.get_type() == "LOCAL_POSITION_NED"][-60:]
    assert {b.time_boot_ms - a.time_boot_ms for a, b in pairwise(heard)} <= steps_ms


def test_an_integer_travels_as_its_bytes(pilot: Px4) -> None:
    held = pilot.read("COM_DL_LOSS_T")
    assert held is not None
    assert (integer(held.param_value), held.param_type) == (10, INT32)
    assert integer(pilot.set("NAV_DLL_ACT", bytewise(3), INT32)) == 3


def test_a_wrong_type_changes_nothing_and_is_answered_with_the_old_value(pilot: Px4) -> None:
    assert integer(pilot.set("NAV_DLL_ACT", 3.0, REAL32)) == 0
    assert pilot.set("MPC_Z_P", bytewise(3), INT32) == 1.0


def test_a_value_out_of_range_is_taken(pilot: Px4) -> None:
    assert pilot.set("MPC_Z_VEL_P_ACC", 400.0) == 400.0


def test_every_failsafe_is_off_until_it_is_switched_on(pilot: Px4) -> None:
    action, fence = pilot.read("NAV_DLL_ACT"), pilot.read("GF_MAX_VER_DIST")
    assert action is not None
    assert fence is not None
    assert (integer(action.param_value), fence.param_value) == (0, 0.0)


def test_without_a_position_it_refuses_to_arm_and_gives_the_reason(pilot: Px4) -> None:
    assert pilot.command(ARM, 1.0) == 1
    assert pilot.words() == ["Arming denied: resolve system health failures first"]


@pytest.mark.complete
def test_it_takes_off_above_its_place_waits_there_lands_and_disarms(pilot: Px4) -> None:
    pilot.hover()
    pilot.ground.expect("HEARTBEAT", lambda message: message.custom_mode == LOITER, within_s=8.0)
    pilot.ground.listen(5.0)
    assert pilot.height_m() == pytest.approx(3.0, abs=0.1)
    assert -pilot.ground.expect("LOCAL_POSITION_NED").z == pytest.approx(3.51, abs=0.1)
    assert pilot.ground.expect("EXTENDED_SYS_STATE").landed_state == 2
    assert pilot.command(SET_MODE, 1, 4, 6) == 0
    pilot.ground.expect("HEARTBEAT", lambda message: message.custom_mode == LANDING)
    pilot.ground.expect("HEARTBEAT", lambda message: not message.base_mode & ARMED, within_s=20.0)
    assert pilot.height_m() == pytest.approx(0.0, abs=0.05)


def test_it_reports_that_it_may_arm_in_its_health_alone(pilot: Px4) -> None:
    """As recorded: present 33570863, health 320915519, and 52480063 where it refuses to arm."""
    statuses = [each for each in pilot.ground.listen(5.0) if each.get_type() == "SYS_STATUS"]
    assert not any(each.onboard_control_sensors_present & PREARM_CHECK for each in statuses)
    ready = [bool(each.onboard_control_sensors_health & PREARM_CHECK) for each in statuses]
    assert (ready[0], ready[-1]) == (False, True)


@pytest.mark.complete
def test_after_a_flight_with_targets_it_is_in_offboard_again_and_does_not_arm(pilot: Px4) -> None:
    """px4_refused_in_offboard.tlog: custom_mode 0x60000, result 1."""
    pilot.hover()
    pilot.ground.listen(4.0)
    for _ in range(15):
        pilot.go_to(3.0)
        pilot.ground.listen(0.1)
    assert pilot.command(SET_MODE, 1.0, 6.0, 0.0) == 0
    assert pilot.command(SET_MODE, 1.0, 4.0, 6.0) == 0
    pilot.ground.expect("HEARTBEAT", lambda message: not message.base_mode & ARMED, within_s=20.0)
    assert pilot.ground.expect("HEARTBEAT").custom_mode == OFFBOARD
    assert not pilot.ground.expect("SYS_STATUS").onboard_control_sensors_health & PREARM_CHECK
    assert pilot.command(ARM, 1.0) == 1
    assert pilot.command(SET_MODE, 1.0, 4.0, 3.0) == 0
    assert pilot.command(ARM, 1.0) == 0


@pytest.mark.complete
def test_the_height_of_the_takeoff_command_counts_from_the_sea(pilot: Px4) -> None:
    """Three metres above the sea are far below the ground here, 488 m above it. It may wait armed on the ground for
    longer than it takes a busy machine to ask again."""
    pilot.set("COM_DISARM_PRFLT", 600.0)
    pilot.arm()
    assert pilot.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 3.0) == 0
    pilot.ground.listen(5.0)
    assert pilot.height_m() == 0.0
    assert pilot.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 490.0) == 0
    pilot.ground.listen(12.0)
    assert pilot.height_m() == pytest.approx(2.0, abs=0.1)


@pytest.mark.complete
def test_disarming_in_the_air_is_refused_unless_it_is_forced(pilot: Px4) -> None:
    pilot.hover()
    assert pilot.command(ARM, 0.0) == 1
    assert pilot.command(ARM, 0.0, FORCE) == 0
    pilot.ground.listen(2.0)
    assert pilot.height_m() == pytest.approx(0.0, abs=0.05)


@pytest.mark.complete
def test_with_its_failsafe_it_lands_ten_seconds_after_the_last_heartbeat(pilot: Px4) -> None:
    pilot.set("NAV_DLL_ACT", bytewise(3), INT32)
    pilot.hover()
    pilot.beat()
    silent_from_s = pilot.ground.elapsed_s
    pilot.ground.expect("HEARTBEAT", lambda message: message.custom_mode == LANDING, within_s=15.0)
    assert 9.5 < pilot.ground.elapsed_s - silent_from_s < 12.5


@pytest.mark.complete
def test_heartbeats_of_no_ground_station_do_not_keep_it_in_the_air(pilot: Px4) -> None:
    pilot.set("NAV_DLL_ACT", bytewise(3), INT32)
    pilot.hover()
    pilot.beat()
    for _ in range(12):
        pilot.beat(kind=18)
        pilot.ground.listen(1.0)
    pilot.ground.expect("HEARTBEAT", lambda message: message.custom_mode == LANDING)


@pytest.mark.complete
@pytest.mark.parametrize(("action", "mode"), [(5, LANDING), (2, LOITER)])
def test_a_breached_fence_triggers_its_action(action: int, mode: int, pilot: Px4) -> None:
    pilot.set("GF_ACTION", bytewise(action), INT32)
    pilot.set("GF_MAX_VER_DIST", 2.0)
    pilot.set("MIS_TAKEOFF_ALT", 4.0)
    pilot.arm()
    pilot.command(SET_MODE, 1, 4, 2)
    pilot.ground.expect("HEARTBEAT", lambda message: message.custom_mode == mode, within_s=10.0)
    assert pilot.words() == ["Geofence violated: maximum altitude exceeded"]


@pytest.mark.complete
def test_its_gains_act_without_its_integral_gain_it_floats_too_low(pilot: Px4) -> None:
    """It believes to hover on 0.6 of its thrust, without another estimate, and hovers on 0.61: 0.16 m/s² that the other
    gains must make up."""
    for name, value in (("MPC_THR_HOVER", 0.6), ("HTE_THR_RANGE", 0.0), ("MPC_Z_VEL_I_ACC", 0.0)):
        assert pilot.set(name, value) == pytest.approx(value)
    pilot.hover()
    pilot.ground.listen(10.0)
    assert pilot.height_m() == pytest.approx(3.0 - 9.80665 * (0.61 / 0.6 - 1.0) / (1.0 * 4.0), abs=0.005)
