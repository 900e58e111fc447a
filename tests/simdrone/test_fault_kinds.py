"""Everything that can go wrong with a simulated drone on demand, as a ground station sees it."""

import math
import statistics
from itertools import pairwise
from pathlib import Path

import pytest

from app.core.errors import InputError
from app.simdrone.drone import Drone, PlannedFault, parse_fault
from app.simdrone.fault_kinds import FAULTS
from tests.simdrone import copters
from tests.simdrone.ground import Ground, Heard, LockstepWire, flying
from tests.simdrone.paparazzi import GROUND_M, LAND_HERE, PLAN_M, Pilot, from_vehicle


def positions(messages: list[Heard]) -> list[Heard]:
    return from_vehicle(messages, "LOCAL_POSITION_NED")


def sequence_steps(messages: list[Heard]) -> set[int]:
    """How the packets of the telemetry are numbered, from one to the next."""
    counted = [each.get_seq() for each in messages if not each.get_type().startswith(("SCRIPT_", "MISSION_"))]
    return {(b - a) % 256 for a, b in pairwise(counted)}


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_has_a_description(name: str) -> None:
    assert f"\n| `{name}` | " in (Path(__file__).parents[2] / "docs" / "sim-drone.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "planned"),
    [
        ("link-lost:8@6", PlannedFault("link-lost", 6.0, 8.0)),
        ("reboot@5.5", PlannedFault("reboot", 5.5)),
        ("no-heartbeat@connect", PlannedFault("no-heartbeat", None)),
        ("arm-refused:3@connect", PlannedFault("arm-refused", None, 3.0)),
    ],
)
def test_a_fault_is_written_with_its_time_and_duration(text: str, planned: PlannedFault) -> None:
    assert parse_fault(text) == planned


@pytest.mark.parametrize("text", ["gremlins@5", "reboot", "reboot@soon", "link-lost:-1@5", "reboot@nan", "@5", ""])
def test_a_fault_that_cannot_be_had_is_refused_in_words(text: str) -> None:
    with pytest.raises(InputError) as refusal:
        parse_fault(text)
    assert refusal.value.problems[0].field == "fault"


def test_no_heartbeat_leaves_everything_else() -> None:
    ground = flying("paparazzi", faults=["no-heartbeat@connect"])
    kinds = {each.get_type() for each in ground.listen(5.0)}
    assert "HEARTBEAT" not in kinds
    assert {"LOCAL_POSITION_NED", "SYS_STATUS"} <= kinds


def test_an_unconfirmed_parameter_is_neither_answered_nor_held() -> None:
    ground = flying("paparazzi", faults=["param-unconfirmed@connect"])
    pilot = Pilot(ground)
    pilot.send_setting("gui_v_kp", 400.0)
    assert ground.wait_for("PARAM_VALUE", within_s=2.0) is None
    held = pilot.read("gui_v_kp")
    assert held is not None
    assert held.param_value == 283.0


@pytest.mark.parametrize(("autopilot", "result"), [("ardupilot", 4), ("px4", 1)])
def test_the_others_refuse_to_arm_and_say_why(autopilot: str, result: int) -> None:
    ground = flying(autopilot, faults=["arm-refused@connect"])
    pilot = copters.Pilot(ground)
    ground.listen(4.0)
    assert pilot.command(copters.ARM, 1.0) == result
    assert pilot.command(copters.ARM, 1.0, copters.FORCE) == result
    assert len(pilot.words()) == 2


def test_during_a_lost_link_commands_do_not_arrive() -> None:
    ground = flying("paparazzi", faults=["link-lost:4@2"])
    pilot = Pilot(ground)
    pilot.take_off()
    ground.listen(1.9)
    ground.listen_to_silence(1.2)
    pilot.send_setting("gui_v_kp", 400.0)
    ground.expect("LOCAL_POSITION_NED", within_s=10.0)
    held = pilot.read("gui_v_kp")
    assert held is not None
    assert held.param_value == 283.0


def test_a_frozen_position_repeats_itself_its_time_too_while_packets_arrive() -> None:
    ground = flying("paparazzi", faults=["frozen-position:3@2"])
    Pilot(ground).take_off()
    heard = positions(ground.listen(8.0))
    repeated = [a.time_boot_ms for a, b in pairwise(heard) if a.time_boot_ms == b.time_boot_ms]
    assert len(set(repeated)) == 1
    assert len(repeated) == pytest.approx(3.0 * 51.2, abs=3)


def test_a_jumping_position_jumps_a_metre_up_alone() -> None:
    ground = flying("paparazzi", faults=["jumping-position@0"])
    Pilot(ground).take_off()
    heights = [-each.z for each in positions(ground.listen(8.0))]
    jumps = [index for index, (a, b) in enumerate(pairwise(heights)) if b - a > 0.7]
    falls = [index for index, (a, b) in enumerate(pairwise(heights)) if a - b > 0.7]
    assert len(jumps) > 10
    assert falls == [index + 1 for index in jumps]
    assert {b - a for a, b in pairwise(jumps)} == {25}


@pytest.mark.parametrize("autopilot", ["paparazzi", "ardupilot", "px4"])
def test_a_low_battery_reads_nine_volts(autopilot: str) -> None:
    ground = flying(autopilot, faults=["low-battery@connect"])
    assert ground.expect("SYS_STATUS").voltage_battery == 9000
    assert ground.expect("BATTERY_STATUS").voltages[0] == 9000


def test_a_reboot_in_the_air_stops_the_motors_forgets_the_gains_and_starts_the_clock_anew() -> None:
    ground = flying("paparazzi", faults=["reboot@6"])
    pilot = Pilot(ground)
    pilot.set_gains(1624, 1356, 195)
    pilot.take_off()
    heard = positions(ground.listen(9.0))
    first_after = next(b for a, b in pairwise(heard) if b.time_boot_ms < a.time_boot_ms)
    assert first_after.time_boot_ms < 100
    assert -first_after.z == pytest.approx(GROUND_M + PLAN_M, abs=0.03)
    assert not pilot.is_armed()
    held = pilot.read("gui_v_kp")
    assert held is not None
    assert held.param_value == 283.0


def test_a_reboot_does_not_mend_what_else_is_wrong() -> None:
    ground = flying("paparazzi", faults=["param-unconfirmed@connect", "reboot@1"])
    pilot = Pilot(ground)
    pilot.take_off()
    ground.listen(max(1.2 - ground.elapsed_s, 0.1))
    ground.expect("LOCAL_POSITION_NED", lambda message: message.time_boot_ms < 1000, within_s=10.0)
    ground.listen(1.0)
    pilot.send_setting("gui_v_kp", 400.0)
    assert ground.wait_for("PARAM_VALUE", within_s=1.0) is None


def test_some_packets_arrive_twice() -> None:
    ground = flying("paparazzi", faults=["duplicated-packets@connect"])
    heard = ground.listen(5.0)
    assert sequence_steps(heard) == {0, 1}


def test_some_packets_arrive_late() -> None:
    ground = flying("paparazzi", faults=["reordered-packets@connect"])
    heard = ground.listen(5.0)
    assert sequence_steps(heard) == {1, 2, 255}


def test_packets_may_come_from_another_system() -> None:
    ground = flying("paparazzi", faults=["wrong-system:2@0"])
    Pilot(ground).take_off()
    systems = [each.get_srcSystem() for each in ground.listen(5.0)]
    assert set(systems) == {31, 77}
    assert systems[-1] == 31


def test_a_deaf_drone_ignores_all_commands_and_keeps_sending() -> None:
    ground = flying("paparazzi", faults=["deaf:4@6"])
    pilot = Pilot(ground)
    pilot.hover()
    ground.listen(5.0)
    pilot.block(LAND_HERE)
    assert len(positions(ground.listen(1.0))) > 40
    assert pilot.read("gui_v_kp") is None
    ground.listen(4.0)
    pilot.block(LAND_HERE)
    ground.expect("SCRIPT_CURRENT", lambda message: message.seq > LAND_HERE)


@pytest.mark.parametrize(
    ("autopilot", "by_hand", "automatic"),
    [
        ("paparazzi", (80, 0), (4, 0)),
        pytest.param("px4", (81, 3 << 16), (29, 0x03040000), marks=pytest.mark.complete),
    ],
)
def test_a_pilot_takes_it_over_holds_it_and_hands_it_back(
    autopilot: str, by_hand: tuple[int, int], automatic: tuple[int, int]
) -> None:
    ground = flying(autopilot, faults=["taken-over:4@18"])
    if autopilot == "paparazzi":
        pilot = Pilot(ground)
        pilot.set_gains(1624, 1356, 195)
        pilot.take_off()
    else:
        copters.Px4(ground).hover()
    ground.listen(8.0)
    before_m = ground.expect("LOCAL_POSITION_NED").z
    for base_mode, custom_mode in (by_hand, automatic):

        def is_it(heard: Heard, mode: int = base_mode) -> bool:
            return bool(heard.base_mode & 127 == mode)

        beat = ground.expect("HEARTBEAT", is_it, within_s=16.0)
        assert (beat.custom_mode, beat.base_mode & 128) == (custom_mode, 128)
        ground.listen(2.0)
        assert ground.expect("LOCAL_POSITION_NED").z == pytest.approx(before_m, abs=0.4)


def hovering(autopilot: str) -> Ground:
    """A ground station of a drone that hovers at 3 m."""
    ground = flying(autopilot)
    match autopilot:
        case "paparazzi":
            pilot = Pilot(ground)
            pilot.set_gains(1624, 1356, 195)
            pilot.hover()
        case "ardupilot":
            copters.ArduPilot(ground).hover()
        case _:
            copters.Px4(ground).hover()
    ground.listen(4.0)
    return ground


def drone_of(ground: Ground) -> Drone:
    assert isinstance(ground.wire, LockstepWire)
    return ground.wire.lockstep.drone


def test_in_a_fall_paparazzis_estimated_altitude_steps_as_in_the_recorded_one() -> None:
    """Recorded in a fall from 3.3 m: −0.30, −0.45 and −0.52 m from one sample to the next at −3.7, −5.0 and −6.8 m/s,
    then down to 1.2 m below the ground, which it passed at −6.5 m/s."""
    ground = hovering("paparazzi")
    drone_of(ground).inject_fault("foreign-kill")
    heard = positions(ground.listen(4.0))
    steps_m = [before.z - after.z + 0.02 * after.vz for before, after in pairwise(heard)]
    assert min(steps_m) == pytest.approx(-0.52, abs=0.1)
    assert sum(step_m < -0.25 for step_m in steps_m) >= 3
    assert max(each.vz for each in heard) == pytest.approx(6.5, abs=1.0)
    assert max(each.z for each in heard) == pytest.approx(1.2, abs=0.6)
    assert (-heard[-1].z, heard[-1].vz) == pytest.approx((GROUND_M, 0.0), abs=0.01)


@pytest.mark.parametrize(("fault", "drift_m_s"), [("drifting-altitude", 0.5), ("creeping-altitude", 0.1)])
def test_a_drift_of_the_altitude_is_in_the_telemetry_alone(fault: str, drift_m_s: float) -> None:
    ground = hovering("paparazzi")
    drone_of(ground).inject_fault(fault)
    last = positions(ground.listen(4.0))[-1]
    true_m = drone_of(ground).body.altitude_m
    assert true_m == pytest.approx(2.9, abs=0.1)
    assert last.z + true_m + GROUND_M == pytest.approx(4.0 * drift_m_s, abs=0.03)
    assert last.vz == pytest.approx(drift_m_s, abs=0.1)


@pytest.mark.complete
def test_a_drift_ends_at_the_ground() -> None:
    ground = hovering("paparazzi")
    drone_of(ground).inject_fault("drifting-altitude")
    last = positions(ground.listen(8.0))[-1]
    assert (-last.z, last.vz) == pytest.approx((GROUND_M, 0.0), abs=0.01)
    assert drone_of(ground).body.altitude_m > 2.5


def test_a_stuck_altitude_keeps_its_clock() -> None:
    ground = flying("paparazzi", faults=["stuck-altitude@connect"])
    pilot = Pilot(ground)
    pilot.set_gains(1624, 1356, 195)
    pilot.take_off()
    heard = positions(ground.listen(6.0))
    assert len({(each.z, each.vz) for each in heard}) == 1
    assert len({each.time_boot_ms for each in heard}) == len(heard) > 250
    assert drone_of(ground).body.altitude_m > 2.0


def test_a_lean_oscillation_has_a_standard_deviation_of_28_degrees() -> None:
    ground = flying("paparazzi", faults=["lean-oscillation@connect"])
    rolls = [each.roll for each in ground.listen(20.0) if each.get_type() == "ATTITUDE"]
    assert math.degrees(statistics.pstdev(rolls)) == pytest.approx(28.0, abs=2.0)


@pytest.mark.complete
@pytest.mark.parametrize(("autopilot", "height_m"), [("paparazzi", 0.9), ("ardupilot", 0.0)])
def test_it_flies_home_by_itself(autopilot: str, height_m: float) -> None:
    """Paparazzi to the height of its HOME mode, 1 m in its own frame; a return of the others only lands."""
    ground = hovering(autopilot)
    drone_of(ground).inject_fault("flies-home")
    ground.listen(12.0)
    assert drone_of(ground).body.altitude_m == pytest.approx(height_m, abs=0.1)


@pytest.mark.parametrize(
    ("autopilot", "kind"),
    [("paparazzi", "SCRIPT_CURRENT"), pytest.param("px4", "EXTENDED_SYS_STATE", marks=pytest.mark.complete)],
)
def test_a_silent_witness_does_not_tell_of_the_landing(autopilot: str, kind: str) -> None:
    ground = hovering(autopilot)
    assert any(each.get_type() == kind for each in ground.heard)
    drone_of(ground).inject_fault("silent-witness")
    if autopilot == "paparazzi":
        Pilot(ground).block(LAND_HERE)
    assert all(each.get_type() != kind for each in ground.listen(3.0))


@pytest.mark.parametrize("autopilot", ["paparazzi", "px4"])
def test_on_the_ground_after_arming_the_altitude_drifts_as_recorded_and_comes_back(autopilot: str) -> None:
    """px4_ground_drift_after_arming.tlog: 0.195 m at arming, 0.655 m 3.6 s later, landed_state 1 throughout."""
    ground = flying(autopilot, faults=["ground-drift@connect"])
    before_m = -ground.expect("LOCAL_POSITION_NED").z
    arm = Pilot(ground).start_engine if autopilot == "paparazzi" else copters.Px4(ground).arm
    arm()
    heard = [each for each in ground.listen(8.0) if each.get_type() == "LOCAL_POSITION_NED"]
    highest = min(heard, key=lambda each: each.z)
    assert -highest.z - before_m == pytest.approx(0.45, abs=0.01)
    assert [-each(heard, key=lambda at: at.vz).vz for each in (min, max)] == pytest.approx([0.125, -0.125], abs=0.001)
    assert -heard[-1].z == pytest.approx(before_m, abs=0.01)
    assert {each.landed_state for each in ground.heard if each.get_type() == "EXTENDED_SYS_STATE"} <= {1}
