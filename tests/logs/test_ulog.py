"""PX4's logs: the sieve loses nothing of what is wanted, and the recorded takeoff is found with its gains."""

import io
import struct

import numpy as np
import pytest
from pyulog import ULog

from app.core.errors import TrajectoryError
from app.logs.readers import read_takeoff, read_takeoffs
from app.logs.ulog import read_ulog
from tests.logs.recorded import recorded

LOG = "px4_takeoff.ulg"
HEADER = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1)


def test_the_recorded_takeoff_is_found_with_its_gains() -> None:
    flown = read_takeoff(io.BytesIO(recorded(LOG)))
    assert flown.gains == pytest.approx(
        {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.2, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0}
    )
    assert flown.begins_with == "the command NAV_TAKEOFF"
    assert flown.trajectory["altitude_m"].max() == pytest.approx(2.80, abs=0.005)
    assert flown.trajectory["climb_rate_m_s"].max() > 0.9
    assert flown.trajectory["battery_v"][0] == pytest.approx(16.2, abs=0.01)
    assert "altitude counted from the ground, where the log has 0.58 m" in flown.notes
    assert "ends after 8.9 s with the command NAV_LAND" in flown.notes


def test_the_sieved_log_holds_the_same_altitude_as_the_whole_one() -> None:
    whole = ULog(io.BytesIO(recorded(LOG)), message_name_filter_list=["vehicle_local_position"]).data_list[0].data
    ours = read_ulog(io.BytesIO(recorded(LOG)))
    np.testing.assert_array_equal(ours.time_s, whole["timestamp"] / 1e6)
    np.testing.assert_array_equal(ours.channels["altitude_m"], -whole["z"].astype(np.float64))


def message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


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


def test_dropouts_are_told() -> None:
    flown = read_takeoff(io.BytesIO(small_log(after=message("O", struct.pack("<H", 300)))))
    assert "the logger dropped data 1 times, 0.30 s in all" in flown.notes


def test_after_damage_reading_goes_on_at_the_next_mark() -> None:
    mark = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
    flown = read_takeoff(io.BytesIO(small_log(after=b"\0\0\0damage" + mark)))
    assert "1 damaged stretches passed over" in flown.notes
    assert flown.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.01)


def test_a_log_that_was_cut_off_gives_what_is_in_it() -> None:
    whole = small_log()
    assert len(read_takeoff(io.BytesIO(whole[: len(whole) // 2 + 1])).trajectory) > 50


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


def test_a_log_written_in_a_way_that_is_not_known_is_refused() -> None:
    with pytest.raises(TrajectoryError, match="newer PX4"):
        read_takeoffs(io.BytesIO(HEADER + message("B", bytes(8) + b"\x02" + bytes(31))))
