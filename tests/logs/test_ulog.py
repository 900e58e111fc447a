"""PX4's logs: the sieve loses nothing of what is wanted, and the recorded takeoff is found with its gains."""

import io
import math
import struct

import numpy as np
import pytest
from pyulog import ULog

from app.autopilots.log_readers import read_takeoff, read_takeoffs
from app.autopilots.px4.log import read_px4
from app.core.errors import TrajectoryError
from tests.logs.recorded import ULOG_HEADER as HEADER
from tests.logs.recorded import recorded
from tests.logs.recorded import ulog_message as message

LOG = "px4_takeoff.ulg"


def test_the_recorded_takeoff_is_found_with_its_gains() -> None:
    flown = read_takeoff(io.BytesIO(recorded(LOG)))
    assert flown.gains == pytest.approx(
        {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.2, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0}
    )
    assert flown.begins_with == "the command NAV_TAKEOFF"
    assert flown.trajectory["altitude_m"].max() == pytest.approx(2.80, abs=0.005)
    assert flown.trajectory["climb_rate_m_s"].max() > 0.9
    assert flown.trajectory["battery_v"][0] == pytest.approx(16.2, abs=0.01)
    assert "altitude relative to the ground, which is at 0.58 m in the log" in flown.notes
    assert "ends after 8.9 s with the command NAV_LAND" in flown.notes


def test_the_sieved_log_holds_the_same_altitude_as_the_whole_one() -> None:
    whole = ULog(io.BytesIO(recorded(LOG)), message_name_filter_list=["vehicle_local_position"]).data_list[0].data
    ours = read_px4(io.BytesIO(recorded(LOG))).columns["altitude_m"]
    np.testing.assert_array_equal(ours.time_s, whole["timestamp"] / 1e6)
    np.testing.assert_array_equal(ours.values, -whole["z"].astype(np.float64))


def small_log(*, after: bytes = b"") -> bytes:
    """A takeoff at 50 Hz, with nothing but altitude and one gain set."""
    content = HEADER
    content += message("F", b"vehicle_local_position:uint64_t timestamp;float z;uint8_t[4] _padding0;")
    for name, value in (("Z_P", 1.0), ("Z_VEL_P_ACC", 4.0), ("Z_VEL_I_ACC", 2.0), ("Z_VEL_D_ACC", 0.0)):
        key = f"float MPC_{name}".encode()
        content += message("P", bytes([len(key)]) + key + struct.pack("<f", value))
    content += message("A", b"\0" + struct.pack("<H", 7) + b"vehicle_local_position")
    for step in range(500):
        z = -3.0 * (1.0 - np.exp(-max(step - 100, 0) / 30.0))
        content += message("D", struct.pack("<HQf", 7, step * 20_000, z))
        content += after if step == 300 else b""
    return content


def test_a_gain_that_is_changed_in_flight_ends_the_record() -> None:
    key = b"float MPC_Z_P"
    changed = message("P", bytes([len(key)]) + key + struct.pack("<f", 1.5))
    flown = read_takeoff(io.BytesIO(small_log(after=changed)))
    assert flown.gains["MPC_Z_P"] == 1.0
    assert any("with MPC_Z_P becoming 1.5" in note for note in flown.notes)
    assert flown.begins_with == "lift-off"


def test_dropouts_are_reported() -> None:
    flown = read_takeoff(io.BytesIO(small_log(after=message("O", struct.pack("<H", 300)))))
    assert "the logger dropped data once, 0.30 s in total" in flown.notes


def test_after_damage_reading_goes_on_at_the_next_mark() -> None:
    mark = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
    flown = read_takeoff(io.BytesIO(small_log(after=b"\0\0\0damage" + mark)))
    assert "1 damaged section skipped" in flown.notes
    assert flown.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.01)


def test_a_log_that_was_cut_off_gives_what_is_in_it() -> None:
    whole = small_log()
    assert len(read_takeoff(io.BytesIO(whole[: len(whole) // 2 + 1])).trajectory) > 50


STATUS, LANDED = 8, 9
BOOT_JUMP_S, ARMED_S, COMMAND_S, LIFT_OFF_S, LAND_S, TOUCHDOWN_S = 4.0, 10.0, 11.0, 12.5, 24.0, 27.0
TAKEOFF, HOVER, LAND = 17, 4, 18


def altitude_from_boot(time_s: float) -> float:
    """The estimate settles by 2.6 m a few seconds after boot, and jumps by 0.8 m for a second at the touchdown."""
    settled_m = 0.0 if time_s < BOOT_JUMP_S else 2.6
    if LIFT_OFF_S <= time_s < LAND_S:
        return settled_m + 3.0 * (1.0 - math.exp(-(time_s - LIFT_OFF_S) / 0.5))
    if LAND_S <= time_s < TOUCHDOWN_S:
        return settled_m + 3.0 * (TOUCHDOWN_S - time_s) / (TOUCHDOWN_S - LAND_S)
    return settled_m + (0.8 if TOUCHDOWN_S + 2.5 <= time_s < TOUCHDOWN_S + 3.5 else 0.0)


def three_topics() -> bytes:
    """What precedes the messages of a log of altitude, status and land detector."""
    topics = (
        (7, b"vehicle_local_position", b"float z;"),
        (STATUS, b"vehicle_status", b"uint8_t nav_state;uint8_t arming_state;"),
        (LANDED, b"vehicle_land_detected", b"bool landed;"),
    )
    formats = [message("F", topic + b":uint64_t timestamp;" + fields) for _, topic, fields in topics]
    return HEADER + b"".join(
        (*formats, *(message("A", b"\0" + struct.pack("<H", number) + topic) for number, topic, _ in topics))
    )


def log_from_boot(*, status: bool = True, land_detector: bool = True) -> bytes:
    """A log that PX4 began at boot: 20 s after the command the vehicle is told to land, bounces, and is disarmed."""
    content = three_topics()
    told = [
        *((s, STATUS, struct.pack("<BB", mode, armed)) for s, mode, armed in (
            (0.0, HOVER, 1), (ARMED_S, HOVER, 2), (COMMAND_S, TAKEOFF, 2), (16.0, HOVER, 2), (LAND_S, LAND, 2),
            (TOUCHDOWN_S + 6.0, LAND, 1),
        ) if status),
        *((s, LANDED, struct.pack("<?", landed)) for s, landed in (
            (0.0, True), (LIFT_OFF_S, False), (TOUCHDOWN_S, True), (TOUCHDOWN_S + 2.5, False),
            (TOUCHDOWN_S + 4.0, True),
        ) if land_detector),
        *((s, 7, struct.pack("<f", -altitude_from_boot(s))) for s in (np.arange(2000) * 0.02).tolist()),
    ]  # fmt: skip
    for time_s, number, body in sorted(told):
        content += message("D", struct.pack("<HQ", number, round(time_s * 1e6)) + body)
    return content


def test_an_estimate_that_settles_at_boot_and_the_landings_bounce_are_no_takeoffs() -> None:
    (flown,) = read_takeoffs(io.BytesIO(log_from_boot()))
    assert flown.begins_with == "the takeoff mode"
    assert flown.start_s == pytest.approx(COMMAND_S)
    record = flown.trajectory
    assert record["altitude_m"][record.time_s < LIFT_OFF_S - COMMAND_S] == pytest.approx(0.0, abs=1e-6)
    assert record["altitude_m"].max() == pytest.approx(3.0, abs=0.01)
    assert "ends after 13.0 s with the mode land" in flown.notes


def test_without_an_arming_state_the_land_detector_alone_tells_the_takeoff_and_a_note_says_so() -> None:
    (flown, bounce) = read_takeoffs(io.BytesIO(log_from_boot(status=False)))
    assert flown.start_s == pytest.approx(LIFT_OFF_S, abs=0.021)
    assert bounce.start_s == pytest.approx(TOUCHDOWN_S + 2.5, abs=0.021)
    assert any("no vehicle_status in the log" in note for note in flown.notes)


def test_without_the_land_detector_a_takeoff_is_a_rise_while_armed_and_a_note_says_so() -> None:
    flown = read_takeoffs(io.BytesIO(log_from_boot(land_detector=False)))
    assert flown[0].start_s == pytest.approx(COMMAND_S)
    assert all(any("no vehicle_land_detected in the log" in note for note in each.notes) for each in flown)


def test_without_either_every_rise_is_offered_and_a_note_says_why() -> None:
    flown = read_takeoffs(io.BytesIO(log_from_boot(status=False, land_detector=False)))
    assert flown[0].start_s == pytest.approx(BOOT_JUMP_S, abs=0.05)
    assert any("armed or not: check that it is the right flight" in note for note in flown[0].notes)


def test_a_takeoff_mode_that_was_chosen_before_arming_begins_the_flight_at_the_arming() -> None:
    content = three_topics()
    for time_s, mode, armed in ((0.0, HOVER, 1), (9.0, TAKEOFF, 1), (11.0, TAKEOFF, 2)):
        content += message("D", struct.pack("<HQBB", STATUS, round(time_s * 1e6), mode, armed))
    for time_s, landed in ((0.0, True), (LIFT_OFF_S, False)):
        content += message("D", struct.pack("<HQ?", LANDED, round(time_s * 1e6), landed))
    for step in range(1100):
        content += message("D", struct.pack("<HQf", 7, step * 20_000, -altitude_from_boot(step * 0.02)))
    (flown,) = read_takeoffs(io.BytesIO(content))
    assert flown.begins_with == "the takeoff mode"
    assert flown.start_s == pytest.approx(11.0)


@pytest.mark.parametrize(
    "described",
    [
        b"vehicle_local_position:uint64_t timestamp;float z",
        b"vehicle_local_position:float z;",
        b"vehicle_local_position:uint64_t timestamp;float[999] z;",
        b"vehicle_local_position:uint64_t timestamp;float z;float z;",
        b"vehicle_local_position:uint64_t timestamp;bomb[65535] z;",
        b"bomb:bomb[65535] bomb;vehicle_local_position:",
        b"vehicle_local_position:" + b"float z;" * 400,
    ],
)
def test_formats_that_are_bombs_or_nonsense_cost_nothing_and_are_refused(described: bytes) -> None:
    content = HEADER + message("F", described)
    content += message("A", b"\0" + struct.pack("<H", 7) + b"vehicle_local_position")
    content += message("D", struct.pack("<HQf", 7, 0, 0.0))
    with pytest.raises(TrajectoryError):
        read_takeoffs(io.BytesIO(content))


def instances(*rows: tuple[int, float, float], subscribed: tuple[tuple[int, int], ...]) -> bytes:
    """A log of altitudes: rows of message number, time, s, and altitude, m; the numbers are those of instances in the
    order in which they are subscribed, each before the first row with its number."""
    content = HEADER + message("F", b"vehicle_local_position:uint64_t timestamp;float z;")
    waiting = dict(subscribed)
    for number, time_s, altitude_m in rows:
        for each in [each for each in waiting if each <= number]:
            subscription = bytes([waiting.pop(each)]) + struct.pack("<H", each) + b"vehicle_local_position"
            content += message("A", subscription)
        content += message("D", struct.pack("<HQf", number, round(time_s * 1e6), -altitude_m))
    return content


def altitudes(content: bytes) -> tuple[list[float], list[float]]:
    column = read_px4(io.BytesIO(content)).columns["altitude_m"]
    return column.time_s.tolist(), column.values.tolist()


@pytest.mark.parametrize(
    ("subscribed", "rows", "expected"),
    [
        pytest.param(((7, 1),), [(7, 1.0, 5.0), (7, 2.0, 6.0)], ([1.0, 2.0], [5.0, 6.0]), id="no first instance"),
        pytest.param(
            ((7, 0), (8, 1)), [(8, 0.5, 9.0), (7, 1.0, 5.0), (8, 1.5, 9.0), (7, 2.0, 6.0)], ([1.0, 2.0], [5.0, 6.0]),
            id="two instances in turn",
        ),
        pytest.param(
            ((7, 2), (8, 1), (9, 0)), [(7, 0.5, 9.0), (8, 0.6, 9.0), (9, 1.0, 5.0), (7, 1.5, 9.0), (9, 2.0, 6.0)],
            ([1.0, 2.0], [5.0, 6.0]), id="the first instance is the last",
        ),
        pytest.param(
            ((7, 3), (8, 2)), [(7, 0.5, 9.0), (8, 1.0, 5.0), (8, 2.0, 6.0)], ([1.0, 2.0], [5.0, 6.0]),
            id="the lowest that there is",
        ),
        pytest.param(
            ((7, 0), (8, 1), (9, 0)), [(7, 1.0, 5.0), (8, 1.5, 9.0), (9, 2.0, 6.0), (9, 3.0, 7.0)],
            ([1.0, 2.0, 3.0], [5.0, 6.0, 7.0]), id="subscribed twice",
        ),
        pytest.param(
            ((7, 0), (8, 0)), [(7, 1.0, 5.0), (8, 2.0, 6.0), (7, 3.0, 7.0)], ([1.0, 2.0, 3.0], [5.0, 6.0, 7.0]),
            id="subscribed twice, in turn",
        ),
        pytest.param(
            ((7, 1), (8, 0)), [(7, 1.0, 5.0), (7, 2.0, 6.0)], ([1.0, 2.0], [5.0, 6.0]), id="the first has no row",
        ),
    ],
)  # fmt: skip
def test_one_instance_of_a_topic_is_read_whole(
    subscribed: tuple[tuple[int, int], ...], rows: list[tuple[int, float, float]], expected: tuple[list[float], ...]
) -> None:
    assert altitudes(instances(*rows, subscribed=subscribed)) == expected


@pytest.mark.parametrize(
    "body",
    [
        b"\x17uint32_t ver_sw_release" + b"\xff",
        b"\x17uint32_t ver_sw_release",
        b"\xffuint32_t ver_sw_release\xff\x01\x0f\x01",
        b"\x16int32_t ver_sw_release\xff\xff\xff\xff",
        b"\x14float ver_sw_release\x00\x00\xc0\x7f",
        b"\x17char[4] ver_sw_release1.15",
        b"\x00",
        b"\x03\xff\xfe\xfd",
    ],
)
def test_a_release_that_is_damaged_is_not_known(body: bytes) -> None:
    content = instances((7, 1.0, 5.0), subscribed=((7, 0),)) + message("I", body)
    assert read_px4(io.BytesIO(content)).release == ""


def test_the_release_may_be_told_anywhere_in_the_log() -> None:
    told = message("I", b"\x17uint32_t ver_sw_release" + struct.pack("<I", 0x010F0180))
    assert read_px4(io.BytesIO(instances((7, 1.0, 5.0), subscribed=((7, 0),)) + told)).release == "1.15.1-beta"


def test_a_log_written_in_a_way_that_is_not_known_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="newer PX4"):
        read_takeoffs(io.BytesIO(HEADER + message("B", bytes(8) + b"\x02" + bytes(31))))
