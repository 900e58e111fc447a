"""ArduPilot's logs as text: printed by old releases, or converted, with damaged lines."""

import io

import pytest

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.log_readers import read_takeoffs
from app.core.errors import TrajectoryError
from app.logs.dataflash import DataflashTables, read_tables
from app.logs.formats import Format, recognise

PREAMBLE = """12

ArduCopter V3.1.3 (0a1b2c3d)
Free RAM: 1234
APM 2
FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 129, 23, PARM, Nf, Name,Value
FMT, 4, 15, CTUN, Icf, TimeMS,ThrIn,Alt
FMT, 3, 6, MODE, Mh, Mode,ThrCrs
FMT, 10, 4, EV, B, Id
FMT, 34, 67, MSG, Z, Message
FMT, 5, 11, IMU, If, TimeMS,GyrX
PARM, THR_ALT_P, 1.0
MODE, STABILIZE, 269
"""
NAMES = ("PARM", "CTUN", "MODE", "EV", "MSG")


def read(text: str) -> DataflashTables:
    return read_tables(text.encode(), NAMES)


def column(log: DataflashTables, name: str, column: str) -> list[object]:
    return list(log.tables[name][column].tolist())


def test_rows_are_read_with_their_values_as_printed() -> None:
    """What has no clock has that of the line before it, of whatever message, or of the first one after."""
    log = read(
        PREAMBLE
        + "CTUN, 5000, 1.50, 0.25\r\nEV, 28\nIMU, 5050, 0.0\nMODE, ALT_HOLD, 402\nMSG, Hello, world\n"
        + "CTUN, 5100, -2, nan\n"
    )
    assert column(log, "CTUN", "ThrIn") == [1.5, -2.0]
    assert column(log, "CTUN", "TimeUS") == [5e6, 5.1e6]
    assert (column(log, "EV", "TimeUS"), column(log, "MODE", "TimeUS")) == ([5e6], [5e6, 5.05e6])
    assert column(log, "MODE", "Mode") == [b"STABILIZE", b"ALT_HOLD"]
    assert column(log, "MSG", "Message") == [b"Hello, world"]
    assert (column(log, "PARM", "Name"), column(log, "PARM", "Value")) == ([b"THR_ALT_P"], [1.0])
    assert log.skipped_bytes == 0
    assert set(log.tables) == set(NAMES)


@pytest.mark.parametrize(
    "line", ["CTUN", "CTUN,", "CTUN, 5100, 1.0", "CTUN, 5100, 1.0, 2.0, 3.0", "CTUN, 5100, x, 1", "CTUN, , ,"]
)
def test_a_damaged_line_is_left_out_and_counted(line: str) -> None:
    log = read(f"{PREAMBLE}CTUN, 5000, 1, 2\n\n{line}\n\nCTUN, 5200, 1, 3\n")
    assert column(log, "CTUN", "Alt") == [2.0, 3.0]
    assert log.skipped_bytes == len(line)


@pytest.mark.parametrize("line", ["UN, 5100, 1.0, 2.0", "\x00\x00\x00", ", 1, 2", "CTUN 5100 1 2"])
def test_a_line_that_is_no_message_is_passed_over_and_counted(line: str) -> None:
    log = read(f"{PREAMBLE}CTUN, 5000, 1, 2\n{line}\nCTUN, 5200, 1, 3\n")
    assert column(log, "CTUN", "Alt") == [2.0, 3.0]
    assert log.skipped_bytes == len(line)


def test_a_log_that_ends_anywhere_is_read_so_far() -> None:
    whole = PREAMBLE + "".join(f"CTUN, {5000 + 100 * row}, 1, {row}.5\n" for row in range(9))
    for end in range(len(PREAMBLE), len(whole)):
        found = read(whole[:end]).tables.get("CTUN", {"Alt": read(whole).tables["CTUN"]["Alt"][:0]})["Alt"].tolist()
        assert found == [row + 0.5 for row in range(whole[:end].count("\nCTUN, 5"))][: len(found)]
        assert len(found) == whole[:end].count("\n") - PREAMBLE.count("\n")


def test_a_description_that_comes_again_or_changes_is_in_force_after_it() -> None:
    log = read(
        PREAMBLE
        + "CTUN, 5000, 1, 2\nFMT, 4, 15, CTUN, Icf, TimeMS,ThrIn,Alt\nCTUN, 5100, 1, 3\n"
        + "FMT, 4, 15, CTUN, Qff, TimeUS,Alt,DAlt\nCTUN, 5200000, 4, 5\nFMT, 4, x\nFMT, 4, 15, CTUN\n"
    )
    assert column(log, "CTUN", "Alt") == [2.0, 3.0, 4.0]
    assert column(log, "CTUN", "TimeUS") == [5e6, 5.1e6, 5.2e6]
    assert str(column(log, "CTUN", "DAlt")) == "[nan, nan, 5.0]"


def test_it_is_recognised_with_what_was_printed_before_it() -> None:
    assert recognise(PREAMBLE.encode()) is Format.DATAFLASH_TEXT
    assert recognise(PREAMBLE[PREAMBLE.index("FMT") :].encode()) is Format.DATAFLASH_TEXT
    for other in (
        "FMT\n",
        "time_s,altitude_m\nFMT, 0\n",
        "<configuration>\n FMT, 1, 2, A, B, C\n",
        "say FMT, 1, 2, A, B, C",
    ):
        assert recognise(other.encode()) is None


def test_modes_are_numbers_by_name_whoever_converted_the_log() -> None:
    """Of those at the same time the last one counts."""
    names = ("AltHold", "ALT_HOLD", "GUIDED", "2", "Mode(77)", "UNKNOWN", "SMART_RTL")
    log = PREAMBLE + "".join(f"CTUN, {5000 + 100 * row}, 1, 0\nMODE, {name}, 0\n" for row, name in enumerate(names))
    mode = read_ardupilot(io.BytesIO(log.encode())).columns["mode"]
    assert str(mode.values.tolist()) == "[2.0, 2.0, 4.0, 2.0, nan, nan, 21.0]"


def test_a_takeoff_is_found_in_it() -> None:
    climb = (0.0,) * 20 + tuple(min(0.1 * row, 3.0) for row in range(300))
    log = PREAMBLE + "".join(f"CTUN, {5000 + 50 * row}, 1, {altitude:.2f}\n" for row, altitude in enumerate(climb))
    (takeoff,) = read_takeoffs(io.BytesIO(log.encode()), name="flight.log")
    assert takeoff.trajectory["altitude_m"].max() == pytest.approx(3.0, abs=0.01)


def test_a_release_that_logs_no_time_is_refused_as_such() -> None:
    log = (
        PREAMBLE.replace("Icf, TimeMS,ThrIn", "ccf, ThrIn,NavThr").replace("If, TimeMS,GyrX", "ff, GyrX,GyrY")
        + "CTUN, 1, 2, 3\n"
    )
    assert set(read(log).tables["CTUN"]) == {"ThrIn", "NavThr", "Alt"}
    with pytest.raises(TrajectoryError, match=r"has no message with the time.*before 3\.1"):
        read_takeoffs(io.BytesIO(log.encode()))
