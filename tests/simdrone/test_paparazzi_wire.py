"""What Paparazzi says on the wire: the simulated one beside two recorded trials of the real one."""

import math
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import common as mavlink_2

from tests.simdrone.ground import Ground, Heard, flying
from tests.simdrone.paparazzi import (
    GROUND_M,
    HOLDING_POINT,
    HOME,
    PLAN_M,
    REAL32,
    START_ENGINE,
    SYSTEM,
    TO,
    Pilot,
    from_vehicle,
    recorded,
)

RECORDINGS = ("paparazzi_283_13_82.tlog", "paparazzi_1624_1356_195.tlog")
SETTINGS = 76


@pytest.fixture(scope="module", autouse=True)
def recordings() -> None:
    """Read before a drone speaks: reading takes a second, in which packets would be lost."""
    for name in RECORDINGS:
        recorded(name)


@pytest.fixture
def ground() -> Ground:
    return flying("paparazzi")


@pytest.fixture
def pilot(ground: Ground) -> Pilot:
    return Pilot(ground)


def names(values: list[Heard]) -> dict[int, str]:
    return {each.param_index: each.param_id for each in values}


def period_s(messages: list[Heard], kind: str, spans_s: float) -> float:
    return spans_s / (len(from_vehicle(messages, kind)) - 1)


@pytest.mark.parametrize("recording", RECORDINGS)
def test_its_blocks_are_those_of_the_recorded_drone(recording: str, ground: Ground) -> None:
    real = [message.name for message in from_vehicle(recorded(recording), "SCRIPT_ITEM")]
    count = ground.ask("SCRIPT_REQUEST_LIST", "SCRIPT_COUNT", **TO).count
    ours = [ground.ask("SCRIPT_REQUEST", "SCRIPT_ITEM", seq=seq, **TO).name for seq in range(count)]
    assert len(real) == 18
    assert ours == real


def test_its_settings_are_those_of_the_recorded_drone(ground: Ground) -> None:
    real = from_vehicle(recorded(RECORDINGS[0]), "PARAM_VALUE")[:SETTINGS]
    ground.send("PARAM_REQUEST_LIST", **TO)
    ours = [message for message in ground.listen(17.0) if message.get_type() == "PARAM_VALUE"]
    assert names(ours) == names(real)
    assert len(ours) == SETTINGS == ours[0].param_count
    assert {each.param_type for each in ours} == {REAL32}
    assert [each.param_value for each in ours] == pytest.approx([each.param_value for each in real], rel=1e-6)


def test_its_telemetry_is_that_of_the_recorded_drone_in_kinds_and_periods(ground: Ground) -> None:
    ours = ground.listen(24.0)
    real = [message for recording in RECORDINGS for message in recorded(recording)]
    kinds = {message.get_type() for message in from_vehicle(real)}
    asked_for = {"PARAM_VALUE", "SCRIPT_COUNT", "SCRIPT_ITEM", "SCRIPT_CURRENT", "MISSION_ACK"}
    assert {message.get_type() for message in ours} == kinds - asked_for
    steps_ms = [b.time_boot_ms - a.time_boot_ms for a, b in pairwise(from_vehicle(ours, "LOCAL_POSITION_NED"))]
    assert set(steps_ms) == {19, 20}
    assert sum(steps_ms) / len(steps_ms) == pytest.approx(1000 / 51.2, abs=0.01)


@pytest.mark.parametrize(
    "kind", ["ATTITUDE", "GLOBAL_POSITION_INT", "ATTITUDE_QUATERNION", "SYSTEM_TIME", "LOCAL_POSITION_NED"]
)
def test_messages_with_a_time_come_as_far_apart_as_the_recorded_ones(kind: str, ground: Ground) -> None:
    def typical_ms(messages: list[Heard]) -> float:
        steps = sorted(b.time_boot_ms - a.time_boot_ms for a, b in pairwise(from_vehicle(messages, kind)))
        return float(steps[len(steps) // 2])

    assert typical_ms(ground.listen(10.0)) == pytest.approx(typical_ms(recorded(RECORDINGS[0])), abs=8.0)


def test_on_the_ground_it_reads_a_tenth_of_a_metre_in_256ths(ground: Ground) -> None:
    position = ground.expect("LOCAL_POSITION_NED")
    assert 0.09 <= -position.z <= 0.11
    assert position.z * 256 == int(position.z * 256)


def test_its_relative_altitude_is_the_recorded_nonsense(ground: Ground) -> None:
    real = from_vehicle(recorded(RECORDINGS[0]), "GLOBAL_POSITION_INT")[0]
    ours = ground.expect("GLOBAL_POSITION_INT")
    assert ours.relative_alt == pytest.approx(real.relative_alt, abs=50)
    assert ours.alt - ours.relative_alt == real.alt - real.relative_alt


def test_without_a_telemetry_file_the_position_comes_at_one_and_a_quarter_hertz() -> None:
    ground = flying("paparazzi-bare")
    times_ms = [each.time_boot_ms for each in from_vehicle(ground.listen(10.0), "LOCAL_POSITION_NED")]
    assert [b - a for a, b in pairwise(times_ms)] == pytest.approx([800] * (len(times_ms) - 1), abs=5)


def test_each_source_file_counts_its_own_packets(ground: Ground) -> None:
    ground.ask("SCRIPT_REQUEST_LIST", "SCRIPT_COUNT", **TO)
    ours = [ground.ask("SCRIPT_REQUEST", "SCRIPT_ITEM", seq=seq, **TO).get_seq() for seq in range(3)]
    assert ours == [1, 2, 3]
    counts = [message.get_seq() for message in ground.heard if not message.get_type().startswith("SCRIPT_")]
    assert {(b - a) % 256 for a, b in pairwise(counts)} == {1}


def test_a_setting_is_cut_to_an_integer_and_never_judged(pilot: Pilot) -> None:
    assert pilot.set("gui_v_kp", 300.7) == 300.0
    assert pilot.set("gui_v_kp", -5.0) == -5.0
    assert pilot.set("gui_v_nom_thr", 0.5) == 0.5
    held = pilot.read("gui_v_kp")
    assert held is not None
    assert held.param_value == -5.0


@pytest.mark.parametrize(
    ("name", "value", "kind", "system"),
    [
        ("gui_v_kp", 400.0, 6, SYSTEM),
        ("gui_v_kp", math.nan, REAL32, SYSTEM),
        ("GUI_V_KP", 400.0, REAL32, SYSTEM),
        ("gui_v_kp", 400.0, REAL32, SYSTEM + 1),
        ("gui_v_ada_thr_en", 1.0, REAL32, SYSTEM),
    ],
    ids=["type", "not a number", "case", "target", "name of 16 characters"],
)
def test_what_it_does_not_take_it_meets_with_silence(
    name: str, value: float, kind: int, system: int, pilot: Pilot
) -> None:
    pilot.send_setting(name, value, kind=kind, system=system)
    assert pilot.ground.wait_for("PARAM_VALUE", within_s=1.0) is None
    held = pilot.read("gui_v_kp")
    assert held is not None
    assert held.param_value == 283.0


def test_a_name_of_16_characters_is_found_by_its_number_alone(ground: Ground, pilot: Pilot) -> None:
    assert pilot.read("gui_v_ada_thr_en") is None
    ground.send("PARAM_REQUEST_READ", param_id="", param_index=10, **TO)
    assert ground.expect("PARAM_VALUE").param_id == "gui_v_ada_thr_en"


def test_a_frame_of_mavlink_2_gets_no_reply(ground: Ground, pilot: Pilot) -> None:
    sender = mavlink_2.MAVLink(None, srcSystem=255, srcComponent=190)
    ground.send_bytes(mavlink_2.MAVLink_param_request_read_message(SYSTEM, 0, b"gui_v_kp", -1).pack(sender))
    assert ground.wait_for("PARAM_VALUE", within_s=1.0) is None
    assert pilot.read("gui_v_kp") is not None


def test_a_burst_of_requests_is_lost_and_the_same_one_by_one_are_all_answered() -> None:
    ground = flying("paparazzi")
    for index in range(40):
        ground.send("PARAM_REQUEST_READ", param_id="", param_index=index, **TO)
    assert from_vehicle(ground.listen(0.5), "PARAM_VALUE") == []
    for index in range(40):
        ground.send("PARAM_REQUEST_READ", param_id="", param_index=index, **TO)
        assert ground.expect("PARAM_VALUE").param_index == index


def test_the_plan_waits_for_a_position_and_then_ten_seconds_before_it_refers_to_the_ground() -> None:
    """As in the stock plans: "Wait GPS", "Geo init" for 10 s, "Holding point", each told once."""
    ground = flying("paparazzi", settled=False)
    entered_s = []
    for seq in (0, 1, 2):
        assert ground.expect("SCRIPT_CURRENT", within_s=12.0).seq == seq
        entered_s.append(ground.elapsed_s)
        height_m = GROUND_M if seq == HOLDING_POINT else GROUND_M + PLAN_M
        assert -ground.expect("LOCAL_POSITION_NED").z == pytest.approx(height_m, abs=0.01)
    assert entered_s == pytest.approx([0.1, 1.1, 11.1], abs=0.1)
    assert {each.altitude for each in from_vehicle(ground.heard, "GPS_GLOBAL_ORIGIN")} == {146_000}
    assert ground.expect("GPS_GLOBAL_ORIGIN", within_s=6.0).altitude == 147_095


def test_a_list_being_read_locks_the_blocks_until_it_is_acknowledged(ground: Ground) -> None:
    ground.ask("SCRIPT_REQUEST_LIST", "SCRIPT_COUNT", **TO)
    ground.send("SCRIPT_ITEM", seq=START_ENGINE, name="", **TO)
    assert ground.wait_for("SCRIPT_CURRENT", within_s=1.0) is None
    ground.send("MISSION_ACK", type=0, **TO)
    ground.send("SCRIPT_ITEM", seq=START_ENGINE, name="", **TO)
    assert ground.expect("SCRIPT_CURRENT").seq == START_ENGINE


def test_an_abandoned_list_locks_the_blocks_for_fifteen_seconds(ground: Ground) -> None:
    started_ms = ground.expect("LOCAL_POSITION_NED").time_boot_ms
    ground.ask("SCRIPT_REQUEST_LIST", "SCRIPT_COUNT", **TO)
    while ground.wait_for("SCRIPT_CURRENT", lambda message: message.seq == START_ENGINE, within_s=0.3) is None:
        ground.send("SCRIPT_ITEM", seq=START_ENGINE, name="", **TO)
    assert 15.0 < (ground.expect("LOCAL_POSITION_NED").time_boot_ms - started_ms) / 1000 < 18.0


def test_the_block_is_told_only_when_it_changes_and_a_number_too_high_means_the_last(
    ground: Ground, pilot: Pilot
) -> None:
    pilot.block(START_ENGINE)
    assert ground.expect("SCRIPT_CURRENT").seq == START_ENGINE
    pilot.block(START_ENGINE)
    assert ground.wait_for("SCRIPT_CURRENT", within_s=1.0) is None
    pilot.block(200)
    assert ground.expect("SCRIPT_CURRENT").seq == HOME


def test_rates_cannot_be_asked_for(ground: Ground, pilot: Pilot) -> None:
    assert pilot.command(511, 32.0) == 3
    stream = {"req_stream_id": 6, "req_message_rate": 50, "start_stop": 1}
    assert ground.ask("REQUEST_DATA_STREAM", "DATA_STREAM", **stream, **TO).on_off == 0
