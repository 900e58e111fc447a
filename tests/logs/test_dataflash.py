"""ArduPilot's logs: read as pymavlink's own reader reads them, and the recorded takeoff found with its gains."""

import io
import random
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from pymavlink import DFReader
from pymavlink.dialects.v20 import ardupilotmega

from app.autopilots.log_readers import read_takeoff, read_takeoffs
from app.core.errors import TrajectoryError
from app.log_library.content import analyze_content
from app.logs.base import HEAD_BYTES
from app.logs.dataflash import DataflashTables, read_tables
from app.logs.formats import Format, recognise
from tests.logs.recorded import SIZES, OnBoardLog, Telemetry, recorded

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


CTUN, EV, MODE = 10, 11, 12
US = 1_000_000


def flown(*, rows: int = 20, begin_s: float = 100.0, alt_m: float = 0.0, step_s: float = 0.1) -> OnBoardLog:
    """CTUN with rising altitude, and an event without a clock after every fifth row."""
    log = OnBoardLog()
    log.define(CTUN, "CTUN", "Qf", "TimeUS,Alt")
    log.define(EV, "EV", "B", "Id")
    for row in range(rows):
        log.add(CTUN, "<Qf", round((begin_s + step_s * row) * US), alt_m + row)
        if row % 5 == 4:
            log.add(EV, "<B", row % 256)
    return log


def read(content: bytes, *names: str) -> DataflashTables:
    return read_tables(content, names or ("CTUN", "EV", "MODE"))


def values(log: DataflashTables, name: str, column: str) -> list[float]:
    return [float(each) for each in log.tables[name][column].tolist()]


def times_s(log: DataflashTables, name: str) -> list[float]:
    return [each / US for each in values(log, name, "TimeUS")]


def test_rows_before_their_description_are_read_by_it() -> None:
    log = OnBoardLog()
    row = b"\xa3\x95\x0a" + struct.pack("<Qf", 1 * US, 1.0)
    log.define(CTUN, "CTUN", "Qf", "TimeUS,Alt")
    found = read(row + log.content + row)
    assert values(found, "CTUN", "Alt") == [1.0, 1.0]
    assert (found.skipped_bytes, found.odd_rows) == (0, 0)


def test_a_description_that_comes_again_changes_nothing_and_another_one_what_comes_after_it() -> None:
    log = OnBoardLog()
    for letters, columns, layout, row in (
        ("Qf", "TimeUS,Alt", "<Qf", (1.0,)),
        ("Qf", "TimeUS,Alt", "<Qf", (2.0,)),
        ("Qhf", "TimeUS,DAlt,Alt", "<Qhf", (7, 3.0)),
        ("Qd", "TimeUS,DAlt", "<Qd", (8.0,)),
        ("Qf", "TimeUS,Alt", "<Qf", (4.0,)),
    ):
        log.define(CTUN, "CTUN", letters, columns)
        log.add(CTUN, layout, 1 * US, *row)
    found = read(log.content)
    assert values(found, "CTUN", "Alt") == pytest.approx([1.0, 2.0, 3.0, np.nan, 4.0], nan_ok=True)
    assert values(found, "CTUN", "DAlt") == pytest.approx([np.nan, np.nan, 7.0, 8.0, np.nan], nan_ok=True)


def test_two_types_that_change_their_numbers_are_told_apart() -> None:
    log = OnBoardLog()
    for at_s, (ctun, mode) in enumerate(((CTUN, MODE), (MODE, CTUN), (CTUN, MODE))):
        log.define(ctun, "CTUN", "Qf", "TimeUS,Alt")
        log.define(mode, "MODE", "QB", "TimeUS,ModeNum")
        log.add(ctun, "<Qf", at_s * US, ctun)
        log.add(mode, "<QB", at_s * US, mode)
    found = read(log.content)
    assert (values(found, "CTUN", "Alt"), values(found, "MODE", "ModeNum")) == ([10, 12, 10], [12, 10, 12])


@pytest.mark.parametrize("length", [4, 14, 16, 40, 255])
def test_a_description_with_a_wrong_length_costs_its_type_only(length: int) -> None:
    wrong = flown().content.replace(b"\xa3\x95\x80\x0a\x0f", b"\xa3\x95\x80\x0a" + bytes([length]))
    found = read(wrong)
    assert (values(found, "EV", "Id"), set(found.tables)) == ([4, 9, 14, 19], {"EV"})
    assert found.skipped_bytes == 20 * 15


@pytest.mark.parametrize("letters", [b"Qd", b"Qh", b"QZ", b"Q?", b"??", b"Q\0", b"Qff"])
def test_a_description_with_wrong_letters_gives_no_wrong_rows(letters: bytes) -> None:
    log = flown().content.replace(b"CTUNQf\0", b"CTUN" + letters.ljust(3, b"\0"))
    found = read(log)
    assert len(values(found, "EV", "Id")) == 4
    assert "Alt" not in found.tables.get("CTUN", {})


def test_an_unknown_letter_costs_its_column_and_those_after_it() -> None:
    log = OnBoardLog()
    log.define(CTUN, "CTUN", "Qf?f", "TimeUS,Alt,New,DAlt", length=3 + 8 + 4 + 7 + 4)
    log.define(EV, "OTHR", "?", "New", length=3 + 5)
    for row in range(3):
        log.add(EV, "5s", b"\xa3\x95\x0a\0\0")
        log.add(CTUN, "<Qf7sf", row * US, row, b"", 0.0)
    found = read(log.content)
    assert (values(found, "CTUN", "Alt"), set(found.tables["CTUN"])) == ([0, 1, 2], {"TimeUS", "Alt"})


def test_a_log_that_ends_anywhere_has_the_rows_that_are_whole() -> None:
    whole = flown().content
    rows = values(read(whole), "CTUN", "Alt")
    for end in range(len(whole)):
        found = read(whole[:end])
        before = values(found, "CTUN", "Alt") if "CTUN" in found.tables else []
        assert before == rows[: len(before)]
        assert len(before) == whole[:end].count(b"\xa3\x95\x0a", 2 * 89) - (
            end < len(whole) and not _at_end(whole, end)
        )
        assert (found.skipped_bytes, found.odd_rows) == (0, 0)


def _at_end(whole: bytes, end: int) -> bool:
    """Whether the last row of CTUN before this end is whole, or none of it is there."""
    begun = whole.rfind(b"\xa3\x95\x0a", 2 * 89, end)
    return begun < 0 or end - begun >= 3 + 12


@pytest.mark.parametrize("lost", [1, 3, 11, 12])
def test_a_message_that_lacks_bytes_costs_only_itself(lost: int) -> None:
    whole = flown().content
    at = [place for place in range(len(whole)) if whole.startswith(b"\xa3\x95\x0a", place)][7]
    found = read(whole[: at + 15 - lost] + whole[at + 15 :])
    assert values(found, "CTUN", "Alt") == [row for row in range(20) if row != 7]
    assert (found.skipped_bytes, found.odd_rows) == (15 - lost, 0)


@pytest.mark.parametrize("junk", [bytes(700), b"\xff" * 700, b"\xa3\x95" * 350, b"PK junk \xa3\x95\x0a" + bytes(30)])
def test_what_is_no_message_is_passed_over_and_counted(junk: bytes) -> None:
    """The message before it, which no other one follows, may be damaged too."""
    whole = flown().content
    middle = whole.index(b"\xa3\x95\x0b")
    before, within = read(junk + whole), read(whole[:middle] + junk + whole[middle:])
    assert (values(before, "CTUN", "Alt"), before.skipped_bytes) == (list(range(20)), len(junk))
    is_left_out = len(junk) != within.skipped_bytes
    assert within.skipped_bytes == len(junk) + 15 * is_left_out
    assert values(within, "CTUN", "Alt") == [row for row in range(20) if row != 4 or not is_left_out]


def test_the_unused_end_of_a_file_is_no_damage() -> None:
    assert read(flown().content + bytes(5000) + b"\xff" * 5000).skipped_bytes == 0


def test_a_log_is_recognised_by_what_is_near_its_beginning() -> None:
    log = flown(rows=1000).content
    assert recognise(log) is Format.DATAFLASH
    for before in (b"\0", bytes(512), b"\xff" * 4000, b"end of another log", log[5000:9000]):
        assert recognise((before + log)[:HEAD_BYTES]) is Format.DATAFLASH, before[:20]
    assert recognise(log[400 : 400 + HEAD_BYTES]) is Format.DATAFLASH
    assert recognise(log[:125]) is Format.DATAFLASH


def test_nothing_else_is_taken_for_a_log() -> None:
    log = flown().content
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("flight.bin", log)
    told = Telemetry(ardupilotmega, autopilot=3)
    for place in range(0, 900, 90):
        told.vehicle("log_data", 1, place, 90, log[place : place + 90].ljust(90, b"\0"))
    assert recognise(packed.getvalue()) is Format.ZIP
    assert recognise(recorded("px4_steps.ulg")[:200] + log) is Format.ULOG
    assert recognise(told.content) is Format.TLOG
    assert recognise(told.content[1:]) is Format.TLOG
    assert recognise(random.Random(1).randbytes(HEAD_BYTES)) is None
    assert recognise(bytes(HEAD_BYTES)) is Format.ZEROS
    assert recognise(b"time_s,altitude_m\n0,0\n") is None


def test_a_log_of_px4_s_before_1_5_is_named() -> None:
    log = OnBoardLog()
    for number, name, letters, columns in ((2, "ATT", "ff", "Roll,Pitch"), (129, "TIME", "Q", "StartTime")):
        log.define(number, name, letters, columns)
    content = log.content[89:] + b"\xa3\x95\x81" + bytes(8)
    assert recognise(content) is Format.SDLOG2
    with pytest.raises(TrajectoryError, match=r"is a log of PX4 1\.4 or older"):
        analyze_content(content, None, "flight.px4log")


def test_milliseconds_since_the_start_are_a_clock_and_those_of_the_week_are_none() -> None:
    """Release 3.1.3: modes and events have no clock; GPS has the time of the week, and that of the vehicle last."""
    log = OnBoardLog()
    log.define(CTUN, "CTUN", "If", "TimeMS,Alt")
    log.define(MODE, "MODE", "Mh", "Mode,ThrCrs")
    log.define(EV, "GPS", "BIBfI", "Status,TimeMS,NSats,Alt,T")
    log.define(13, "IMU", "If", "TimeMS,GyrX")
    log.add(MODE, "<Bh", 0, 500)
    for row in range(3):
        log.add(CTUN, "<If", 5000 + 100 * row, row)
        log.add(EV, "<BIBfI", 3, 400_000_000, 9, 0.0, 5010 + 100 * row)
        log.add(13, "<If", 5050 + 100 * row, 0.0)
        log.add(MODE, "<Bh", row, 500)
    found = read(log.content, "CTUN", "MODE", "GPS")
    assert set(found.tables) == {"CTUN", "MODE", "GPS"}
    assert times_s(found, "CTUN") == pytest.approx([5.0, 5.1, 5.2])
    assert times_s(found, "GPS") == pytest.approx([5.0, 5.1, 5.2])
    assert times_s(found, "MODE") == pytest.approx([5.0, 5.05, 5.15, 5.25])


def test_a_log_without_any_clock_says_so() -> None:
    log = OnBoardLog()
    log.define(CTUN, "CTUN", "f", "BarAlt")
    log.add(CTUN, "<f", 1.0)
    assert set(read(log.content).tables["CTUN"]) == {"BarAlt"}
    with pytest.raises(TrajectoryError, match="has no message with the time"):
        read_takeoffs(io.BytesIO(log.content))


def test_what_has_no_clock_after_a_restart_belongs_to_the_boot_after_it() -> None:
    first, second = flown(), flown(begin_s=50.0, alt_m=100.0)
    mode = OnBoardLog()
    mode.define(MODE, "MODE", "B", "ModeNum")
    mode.add(MODE, "<B", 4)
    found = read(first.content + mode.content + second.content[89:])
    assert found.boots_s == pytest.approx([121.9])
    assert times_s(found, "MODE") == pytest.approx([121.9])
    assert max(times_s(found, "EV")[:4]) < 102.0


def test_a_boot_whose_clock_is_later_begins_anew_too() -> None:
    """Its log began a while after it started; within one log a gap is none."""
    first, second = flown(), flown(begin_s=300.0)
    assert read(first.content + second.content).boots_s == [300.0]
    assert read(first.content + second.content[3 * 89 :]).boots_s == []
    going_on = flown(begin_s=102.0)
    assert read(first.content + going_on.content).boots_s == []


def test_a_ring_is_put_in_order() -> None:
    whole = flown(rows=400).content
    alone = read(whole)
    for cut in (len(whole) // 3, len(whole) // 2 + 1, len(whole) - 400):
        found = read(whole[cut:] + whole[:cut])
        assert found.boots_s == []
        lost = 400 - len(values(found, "CTUN", "Alt"))
        assert lost <= 1
        assert np.all(np.diff(values(found, "CTUN", "Alt")) > 0.0)
        assert times_s(found, "CTUN")[0] == times_s(alone, "CTUN")[0]


def test_a_ring_of_two_boots_begins_with_the_older_one() -> None:
    older, newer = flown(alt_m=1000.0).content, flown(begin_s=10.0, rows=100).content
    cut = len(newer) // 2
    found = read(newer[cut:] + older + newer[:cut])
    assert len(found.boots_s) == 1
    altitude = values(found, "CTUN", "Alt")
    assert altitude[:20] == [1000.0 + row for row in range(20)]
    assert np.all(np.diff(altitude[20:]) > 0.0)


@pytest.mark.parametrize("rows", [1, 2, 9])
@pytest.mark.parametrize("at_us", [3, 10**15])
def test_rows_with_a_damaged_clock_are_left_out_and_counted(rows: int, at_us: int) -> None:
    log = flown()
    for row in range(rows):
        log.add(CTUN, "<Qf", at_us + row, -1.0)
    log.content += flown(begin_s=102.0, alt_m=20.0).content[3 * 89 :]
    found = read(log.content)
    assert values(found, "CTUN", "Alt") == list(range(40))
    assert (found.boots_s, found.skipped_bytes, found.odd_rows) == ([], 0, rows)


def test_scaled_integers_have_their_unit() -> None:
    log = OnBoardLog()
    log.define(CTUN, "CTUN", "QcCeEL", "TimeUS,a,b,c,d,Lat")
    log.add(CTUN, "<QhHiIi", 1, -150, 36000, -70000, 12, 473_000_000)
    (row,) = zip(*(values(read(log.content), "CTUN", each) for each in ("a", "b", "c", "d", "Lat")), strict=True)
    assert row == pytest.approx((-1.5, 360.0, -700.0, 0.12, 47.3))


def test_the_factor_to_si_of_a_column_is_told_and_not_that_of_a_scaled_letter() -> None:
    """Release 3.6: PSC in cm, cm/s; a share as a percentage; a multiplier of 0 is none, and one that is not described
    is not known."""
    log = OnBoardLog()
    log.define(CTUN, "PSC", "QfcffB", "TimeUS,PX,VX,None,Odd,ThO")
    log.define(1, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    log.define(2, "MULT", "Qbd", "TimeUS,Id,Mult")
    for letter, factor in (("F", 1e-6), ("B", 1e-2), ("-", 0.0), ("2", 100.0)):
        log.add(2, "<Qbd", 1, ord(letter), factor)
    log.add(1, "<QB16s16s", 1, CTUN, b"smnmm%", b"FBB-!2")
    log.add(CTUN, "<QfhffB", 1, 250.0, 300, 1.0, 1.0, 40)
    found = read(log.content, "PSC")
    assert found.factors == {"PSC": {"TimeUS": 1e-6, "PX": 0.01, "VX": 1.0, "None": 1.0, "ThO": 1.0}}
    assert values(found, "PSC", "VX") == [3.0]
    assert read(flown().content).factors == {}


@pytest.mark.parametrize(
    ("letters", "columns"),
    [
        ("QBff", "TimeUS,FmtType,UnitIds,MultIds"),
        ("QNNN", "TimeUS,FmtType,UnitIds,MultIds"),
        ("QBNN", "TimeUS,FmtType,Units,Mults"),
        ("QNN", "TimeUS,UnitIds,MultIds"),
    ],
)
def test_damaged_descriptions_of_units_are_none(letters: str, columns: str) -> None:
    log = OnBoardLog()
    log.define(ord("A"), "CTUN", "Qf", "TimeUS,Alt")
    log.define(1, "FMTU", letters, columns)
    log.define(2, "MULT", "Qbd", "TimeUS,Id,Mult")
    log.add(ord("A"), "<Qf", 1, 1.0)
    log.add(2, "<Qbd", 1, ord("B"), 0.01)
    log.content += b"\xa3\x95\x01" + b"A" * sum(SIZES[each] for each in letters)
    assert read(log.content).factors.get("CTUN", {}) == {}
