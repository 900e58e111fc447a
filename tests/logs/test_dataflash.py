"""ArduPilot's logs: read as pymavlink's own reader reads them, and the recorded takeoff found with its gains."""

import io
from pathlib import Path

import numpy as np
import pytest
from pymavlink import DFReader

from app.autopilots.log_readers import read_takeoff, read_takeoffs
from app.core.errors import TrajectoryError
from app.logs.dataflash import read_tables
from tests.logs.recorded import OnBoardLog, recorded

LOG = "arducopter_takeoff.bin"


def test_the_recorded_takeoff_is_found_with_its_gains() -> None:
    flown = read_takeoff(io.BytesIO(recorded(LOG)))
    assert flown.gains == {
        "PSC_POSZ_P": 1.0,
        "PSC_VELZ_P": 5.0,
        "PSC_ACCZ_P": 0.5,
        "PSC_ACCZ_I": 1.0,
        "PSC_ACCZ_D": 0.0,
    }
    assert flown.begins_with == "the command NAV_TAKEOFF"
    assert set(flown.trajectory.channels) == {"altitude_m", "reference_m", "climb_rate_m_s", "thrust", "battery_v"}
    assert flown.trajectory["altitude_m"].max() == pytest.approx(3.04, abs=0.005)
    assert flown.trajectory["altitude_m"][flown.trajectory.time_s <= 0.0] == pytest.approx(0.0, abs=0.001)
    assert "ends after 10.2 s with the mode LAND" in flown.notes


def test_every_wanted_message_is_what_pymavlink_reads(tmp_path: Path) -> None:
    path = tmp_path / LOG
    path.write_bytes(recorded(LOG))
    reference = DFReader.DFReader_binary(str(path))
    names = ("PSCD", "CTUN", "PARM", "MODE", "MAVC", "EV", "BAT")
    ours = read_tables(path.read_bytes(), names).tables
    rows = dict.fromkeys(names, 0)
    while (message := reference.recv_match(type=list(names))) is not None:
        kind = message.get_type()
        for column, value in message.to_dict().items():
            if column == "mavpackettype":
                continue
            held = ours[kind][column][rows[kind]]
            if isinstance(value, str):
                assert bytes(held).decode() == value
            else:
                assert float(held) == pytest.approx(float(value), nan_ok=True), (kind, column)
        rows[kind] += 1
    reference.data_map.close()
    reference.filehandle.close()
    assert rows == {name: len(ours[name]["TimeUS"]) for name in names}
    assert rows["PARM"] == 1337


def test_a_truncated_log_gives_what_is_in_it() -> None:
    whole = recorded(LOG)
    assert len(read_takeoff(io.BytesIO(whole[: len(whole) // 2])).trajectory) > 30


def test_damage_is_passed_over() -> None:
    damaged = bytearray(recorded(LOG))
    damaged[700_000:700_400] = bytes(400)
    flown = read_takeoff(io.BytesIO(bytes(damaged)))
    assert flown.gains["PSC_VELZ_P"] == 5.0
    assert len(flown.trajectory) >= 110


def test_an_older_log_without_the_controller_s_message_has_its_altitude_from_the_tuning() -> None:
    log = OnBoardLog()
    log.define(10, "CTUN", "Qff", "TimeUS,Alt,DAlt")
    for step in range(400):
        altitude = 3.0 * (1.0 - np.exp(-max(step - 100, 0) / 30.0))
        log.add(10, "<Qff", step * 50_000, altitude, 3.0)
    flown = read_takeoff(io.BytesIO(log.content))
    assert flown.begins_with == "lift-off"
    assert flown.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.01)
    assert "altitude from CTUN.Alt" in flown.trajectory.source


def test_a_log_without_any_altitude_is_refused() -> None:
    log = OnBoardLog()
    log.define(10, "ATT", "Qf", "TimeUS,Roll")
    log.add(10, "<Qf", 1, 2.0)
    with pytest.raises(TrajectoryError, match=r"contains neither PSCD.PD nor CTUN.Alt"):
        read_takeoffs(io.BytesIO(log.content))


@pytest.mark.parametrize(
    ("letters", "columns"),
    [("Qf", "TimeUS"), ("Q?", "TimeUS,PD"), ("QQ", "TimeUS,TimeUS"), ("Zf", "TimeUS,PD"), ("fa", "TimeUS,PD")],
)
def test_descriptions_that_make_no_sense_are_refused_in_words(letters: str, columns: str) -> None:
    log = OnBoardLog()
    log.define(10, "PSCD", letters, columns, length=3 + 68)
    log.content += b"\xa3\x95\x0a" + bytes(68)
    with pytest.raises(TrajectoryError):
        read_takeoffs(io.BytesIO(log.content))
