"""Telemetry logs: the recorded flights score as their CSVs do, and what is built frame by frame is understood."""

import io
from typing import Any

import numpy as np
import pytest
from pymavlink.dialects.v10 import paparazzi
from pymavlink.dialects.v20 import ardupilotmega, common

from app.autopilots.log_readers import read_takeoff, read_takeoffs
from app.autopilots.takeoffs import NOT_COMMANDED
from app.core.errors import TrajectoryError
from app.logs.takeoff_csv import read_takeoff_csv
from tests.logs.recorded import SCRIPT_CURRENT_4, TAKEOFFS, TLOGS, Telemetry, recorded
from tests.vehicles.flying import TAKEOFF


@pytest.mark.parametrize("name", TLOGS)
def test_a_recorded_flight_scores_as_its_csv_and_has_its_gains(name: str) -> None:
    flown = read_takeoff(io.BytesIO(recorded(f"{name}.tlog")))
    from_csv = TAKEOFF.error(read_takeoff_csv((TAKEOFFS / f"{name}.csv").read_bytes()))
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(from_csv, rel=1e-5)
    assert flown.gains == TLOGS[name]
    assert flown.begins_with == "the block Takeoff"
    assert set(flown.trajectory.channels) == {"altitude_m", "climb_rate_m_s", "battery_v", "throttle"}
    assert np.median(flown.trajectory["throttle"][flown.trajectory.time_s > 5.0]) == pytest.approx(0.62, abs=0.02)
    assert flown.trajectory.clock == "vehicle"


def test_the_record_begins_a_second_before_the_command_and_ends_with_the_landing() -> None:
    flown = read_takeoff(io.BytesIO(recorded("paparazzi_283_13_82.tlog")))
    assert flown.trajectory.time_s[[0, -1]].tolist() == pytest.approx([-0.996, 33.042], abs=1e-6)
    assert 0.0 in flown.trajectory.time_s
    assert flown.notes == ("ends after 33.0 s with the block land here",)


def test_without_the_names_of_the_blocks_the_one_in_which_it_lifted_off_was_the_command() -> None:
    """Recorded; the campaign had 0.3240 m. From its lift-off on, the same flight is 0.3123 m."""
    flown = read_takeoff(io.BytesIO(recorded("paparazzi_takeoff_no_block_list.tlog")))
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(0.3240, abs=0.0001)
    assert (flown.is_commanded, flown.begins_with) == (True, "the block in which it lifted off")
    assert flown.trajectory.time_s[[0, -1]].tolist() == pytest.approx([-0.98, 33.0], abs=0.03)


def test_a_block_that_the_vehicle_did_not_say_to_have_entered_is_no_command() -> None:
    silent = recorded("paparazzi_takeoff_no_block_list.tlog").replace(SCRIPT_CURRENT_4, bytes(5))
    flown = read_takeoff(io.BytesIO(silent))
    assert (flown.is_commanded, flown.begins_with) == (False, "lift-off")
    assert TAKEOFF.error(flown.trajectory) == pytest.approx(0.3123, abs=0.0001)


@pytest.mark.parametrize(("entered", "is_commanded"), [((4,), True), ((4, 6), False), ((6,), False), ((), False)])
def test_the_vehicle_must_lift_off_in_the_very_block_that_was_commanded(
    entered: tuple[int, ...], is_commanded: bool
) -> None:
    log = paparazzi_log()
    log.fly(1.0, to_m=0.0)
    log.ground("script_item", 31, 0, 4, b"")
    for block in entered:
        log.fly(0.1, to_m=0.0)
        log.vehicle("script_current", block)
    log.fly(0.5, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.is_commanded is is_commanded
    assert flown.start_s == pytest.approx(0.98 if is_commanded else 1.5, abs=0.25)


def test_motors_stopped_in_the_air_end_the_only_takeoff_and_the_fall_is_none() -> None:
    """Recorded: the estimate jumps and rises again by more than half a metre once the vehicle lies on the ground."""
    flown = read_takeoff(io.BytesIO(recorded("paparazzi_motors_stopped_in_the_air.tlog")))
    assert "ends after 8.0 s with motors off" in flown.notes
    assert flown.trajectory["altitude_m"][-1] == pytest.approx(3.352, abs=0.001)


def test_heartbeats_of_other_components_neither_disarm_the_vehicle_nor_change_its_mode() -> None:
    log = Telemetry(ardupilotmega, autopilot=3)
    log.heartbeat(mode=4)
    log.ground("command_long", 31, 1, 22, 0, 0, 0, 0, 0, 0, 0, 3.0)
    for _ in range(10):
        log.fly(1.0, to_m=3.0)
        log.component("heartbeat", 18, 8, 0, 0, 4)
    assert read_takeoff(io.BytesIO(log.content)).trajectory.time_s[-1] == pytest.approx(10.0, abs=0.05)


def test_two_flights_in_one_log_are_listed_to_choose_from() -> None:
    both = recorded("paparazzi_283_13_82.tlog") + recorded("paparazzi_1624_1356_195.tlog")
    with pytest.raises(TrajectoryError) as refusal:
        read_takeoff(io.BytesIO(both))
    assert [problem.field for problem in refusal.value.problems] == ["takeoff", "takeoff"]
    assert "1: 18.4 s into the log, at the block Takeoff" in refusal.value.problems[0].reason
    assert "kp 1624, ki 1356, kd 195" in refusal.value.problems[1].reason
    assert read_takeoff(io.BytesIO(both), number=2).gains["kp"] == 1624.0
    with pytest.raises(TrajectoryError, match="there is no takeoff 3"):
        read_takeoff(io.BytesIO(both), number=3)


def paparazzi_log() -> Telemetry:
    log = Telemetry(paparazzi, autopilot=9)
    log.heartbeat(armed=False)
    for number, name in enumerate((b"Standby", b"Take off", b"land here")):
        log.vehicle("script_item", 255, 190, number, name)
    return log


def set_gain(log: Telemetry, name: str, value: float, *, answers: float | None) -> None:
    log.ground("param_set", 31, 0, name.encode(), value, 9)
    if answers is not None:
        log.parameter(name, answers)


def test_a_gain_is_what_the_vehicle_answered_not_what_it_was_asked() -> None:
    log = paparazzi_log()
    log.fly(1.0, to_m=0.0)
    set_gain(log, "gui_v_kp", 300.7, answers=300.0)
    set_gain(log, "gui_v_ki", 40.0, answers=13.0)
    set_gain(log, "gui_v_kd", 82.0, answers=82.0)
    log.ground("script_item", 31, 0, 1, b"")
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.gains == {"kp": 300.0, "ki": 13.0, "kd": 82.0}
    assert "ki was set to 40, but the vehicle never confirmed it" in flown.notes


def test_another_gain_in_flight_ends_the_record_because_it_is_another_flight() -> None:
    log = paparazzi_log()
    for name in ("gui_v_kp", "gui_v_ki", "gui_v_kd"):
        log.parameter(name, 100.0)
    log.fly(1.0, to_m=0.0)
    log.ground("script_item", 31, 0, 1, b"")
    log.fly(5.0, to_m=3.0)
    log.parameter("gui_v_kd", 90.0)
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.trajectory.time_s[-1] == pytest.approx(5.0)
    assert "ends after 5.0 s with kd becoming 90" in flown.notes


def test_without_a_command_time_counts_from_lift_off_which_is_said() -> None:
    log = paparazzi_log()
    log.fly(3.0, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.begins_with == "lift-off"
    assert flown.gains == {}
    assert not flown.is_commanded
    assert NOT_COMMANDED in flown.notes
    assert abs(flown.trajectory["altitude_m"][flown.trajectory.time_s == 0.0][0]) <= 0.05


def test_a_vehicle_that_restarts_goes_on_in_the_ground_s_time() -> None:
    log = paparazzi_log()
    log.fly(20.0, to_m=0.0)
    log.now_s += 4.0
    log.booted_s = log.now_s
    log.fly(2.0, to_m=0.0)
    log.ground("script_item", 31, 0, 1, b"")
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.start_s == pytest.approx(26.0, abs=0.05)
    assert "the vehicle restarted and reset its clock (1×)" in flown.notes


def test_a_vehicle_that_restarts_right_after_it_booted_is_noticed() -> None:
    log = paparazzi_log()
    log.booted_s = log.now_s - 1.0
    log.fly(5.0, to_m=0.0)
    log.now_s += 3.0
    log.booted_s = log.now_s - 2.0
    log.fly(2.0, to_m=0.0)
    log.ground("script_item", 31, 0, 1, b"")
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.start_s == pytest.approx(10.0, abs=0.05)
    assert "the vehicle restarted and reset its clock (1×)" in flown.notes


def test_late_messages_are_no_restart() -> None:
    log = paparazzi_log()
    log.fly(5.0, to_m=0.0)
    log.booted_s += 3.0
    log.fly(0.1, to_m=0.0)
    log.booted_s -= 3.0
    log.fly(2.0, to_m=0.0)
    log.ground("script_item", 31, 0, 1, b"")
    log.fly(5.0, to_m=3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.start_s == pytest.approx(7.1, abs=0.05)
    assert not any("restarted" in note for note in flown.notes)


def test_of_two_vehicles_the_one_that_reports_its_position_more_often_is_read() -> None:
    idle, log = Telemetry(ardupilotmega, autopilot=3, system=2), Telemetry(ardupilotmega, autopilot=3, system=1)
    idle.heartbeat()
    idle.fly(1.0, to_m=0.0)
    log.heartbeat()
    log.fly(1.0, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    assert read_takeoff(io.BytesIO(idle.content + log.content)).trajectory["altitude_m"].max() > 2.9


@pytest.mark.parametrize(
    ("dialect", "autopilot", "command", "parameters", "begins_with"),
    [
        (ardupilotmega, 3, 22, (0, 0, 0, 0, 0, 0, 3.0), "the command NAV_TAKEOFF"),
        (common, 12, 176, (1, 4, 2, 0, 0, 0, 0), "the command DO_SET_MODE"),
    ],
    ids=["ArduPilot", "PX4"],
)
def test_other_autopilots_begin_with_the_command_that_they_accepted(
    dialect: Any, autopilot: int, command: int, parameters: tuple[float, ...], begins_with: str
) -> None:
    log = Telemetry(dialect, autopilot=autopilot)
    log.heartbeat(mode=4)
    log.fly(1.0, to_m=0.5)  # what the ground measures
    log.fly(3.0, to_m=0.5)
    for result in (4, 0):
        log.fly(1.0, to_m=0.5)
        log.ground("command_long", 31, 1, command, 0, *parameters)
        log.vehicle("command_ack", command, result)
    log.fly(4.0, to_m=3.5)
    log.ground("command_long", 31, 1, 21, 0, 0, 0, 0, 0, 0, 0, 0)
    log.vehicle("command_ack", 21, 0)
    log.fly(4.0, to_m=0.5)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.begins_with == begins_with
    assert flown.start_s == pytest.approx(5.98, abs=0.03)
    assert flown.trajectory.time_s[-1] == pytest.approx(4.0, abs=0.03)
    assert flown.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.02)
    assert any("altitude relative to the ground" in note for note in flown.notes)


def test_a_mode_in_a_heartbeat_right_after_the_command_does_not_end_the_flight() -> None:
    log = Telemetry(ardupilotmega, autopilot=3)
    log.heartbeat(mode=0)
    log.fly(1.0, to_m=0.0)
    log.ground("command_long", 31, 1, 176, 0, 1, 4, 0, 0, 0, 0, 0)
    log.ground("command_long", 31, 1, 22, 0, 0, 0, 0, 0, 0, 0, 3.0)
    log.fly(0.5, to_m=0.0)
    log.heartbeat(mode=4)
    log.fly(2.0, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    log.heartbeat(mode=9)
    log.fly(5.0, to_m=0.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.trajectory.time_s[-1] == pytest.approx(7.5, abs=0.03)
    assert "ends after 7.5 s with mode 9" in flown.notes


def test_gains_of_an_ardupilot_of_either_age_are_those_of_the_experiment() -> None:
    """Since release 4.7 they have other names, and those of the acceleration loop a tenth of the value."""
    gains = {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.1, "PSC_ACCZ_D": 0.02}
    newer = {"PSC_D_POS_P": 1.0, "PSC_D_VEL_P": 5.0, "PSC_D_ACC_P": 0.05, "PSC_D_ACC_I": 0.11, "PSC_D_ACC_D": 0.002}
    for logged in (gains, newer):
        log = Telemetry(ardupilotmega, autopilot=3)
        log.heartbeat()
        log.fly(1.0, to_m=0.0)
        for name, value in logged.items():
            log.parameter(name, value)
        log.fly(5.0, to_m=3.0)
        assert read_takeoff(io.BytesIO(log.content)).gains == pytest.approx(gains, rel=1e-6)


def test_damage_in_the_middle_costs_the_frames_it_hits_and_nothing_else() -> None:
    whole = recorded("paparazzi_283_13_82.tlog")
    damaged = bytearray(whole)
    damaged[120_000:120_090] = bytes(90)
    flown = read_takeoff(io.BytesIO(bytes(damaged)))
    reference = read_takeoff(io.BytesIO(whole))
    assert 0 < len(reference.trajectory) - len(flown.trajectory) <= 6
    assert np.isin(flown.trajectory.time_s, reference.trajectory.time_s).all()


def test_a_flipped_bit_in_a_position_is_noticed_by_its_checksum() -> None:
    whole = recorded("paparazzi_283_13_82.tlog")
    place = whole.index(bytes([0xFE, 28]), 120_000)
    damaged = whole[: place + 20] + bytes([whole[place + 20] ^ 0x40]) + whole[place + 21 :]
    assert len(read_takeoff(io.BytesIO(damaged)).trajectory) == len(read_takeoff(io.BytesIO(whole)).trajectory) - 1


def test_a_log_without_a_vehicle_that_is_known_is_refused() -> None:
    log = Telemetry(common, autopilot=0)
    log.heartbeat()
    with pytest.raises(TrajectoryError, match="no MAVLink heartbeat of Paparazzi, ArduPilot, PX4"):
        read_takeoffs(io.BytesIO(log.content))


def test_a_log_without_positions_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="contains neither LOCAL_POSITION_NED nor GLOBAL_POSITION_INT"):
        read_takeoffs(io.BytesIO(paparazzi_log().content))


def test_a_flight_that_never_left_the_ground_is_refused() -> None:
    log = paparazzi_log()
    log.fly(30.0, to_m=0.2)
    with pytest.raises(TrajectoryError, match="The log contains no takeoff"):
        read_takeoffs(io.BytesIO(log.content))


def test_a_throttle_that_is_impossible_of_another_vehicle_or_too_old_is_left_out() -> None:
    def flown_with(*percents: int | None) -> set[str]:
        log = paparazzi_log()
        for name in ("gui_v_kp", "gui_v_ki", "gui_v_kd"):
            log.parameter(name, 100.0)
        for second, percent in enumerate(percents):
            if percent is not None:
                log.vehicle("vfr_hud", 0.0, 0.0, 0, percent, 0.0, 0.0)
            log.ground("vfr_hud", 0.0, 0.0, 0, 100, 0.0, 0.0)
            log.fly(1.0, to_m=0.0 if second < 2 else 3.0)
            if second == 1:
                log.ground("script_item", 31, 0, 1, b"")
        return set(read_takeoff(io.BytesIO(log.content)).trajectory.channels)

    assert "throttle" in flown_with(0, 0, 60, 62, 62, 62, 62, 62)
    assert "throttle" not in flown_with(*[None] * 8)
    assert "throttle" not in flown_with(*[0xFFFF] * 8)
    assert "throttle" not in flown_with(0, 0, 60, *[None] * 6)
