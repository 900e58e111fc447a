import io
from pathlib import Path

import numpy as np
import pytest

from app.core.errors import TrajectoryError
from app.core.records.metrics import require_scorable
from app.logs.takeoff_csv import MAX_ROWS, read_takeoff_csv
from tests.vehicles.flying import TAKEOFF

RECORDED = Path(__file__).parent.parent / "data" / "takeoffs"
ROWS = 1700


def csv_of(*, start: int = 0, rows: int = ROWS, header: str = "time_s,altitude_m") -> str:
    """A takeoff at 50 Hz; row i stands on line i + 2."""
    return "\n".join([header, *(f"{i * 0.02:.3f},{min(i * 0.01, 3.0):.3f}" for i in range(start, rows)), ""])


def replace_line(text: str, line: int, by: str) -> str:
    lines = text.split("\n")
    lines[line - 1] = by
    return "\n".join(lines)


def refusal_of(data: bytes | str) -> TrajectoryError:
    with pytest.raises(TrajectoryError) as refusal:
        read_takeoff_csv(data.encode() if isinstance(data, str) else data)
    assert refusal.value.hint
    return refusal.value


@pytest.mark.parametrize(("name", "error_m"), [("paparazzi_283_13_82", 0.3297), ("paparazzi_1624_1356_195", 0.0987)])
def test_flights_of_the_real_autopilot_score_as_measured(name: str, error_m: float) -> None:
    """Paparazzi's own simulation of the AR.Drone 2 on its own datum, over 32.6 s (tests/data/takeoffs)."""
    with (RECORDED / f"{name}.csv").open("rb") as stream:
        flight = read_takeoff_csv(stream)
    assert len(flight) == 1691
    assert set(flight.channels) == {"altitude_m", "climb_rate_m_s"}
    assert TAKEOFF.error(flight) == pytest.approx(error_m, abs=0.00005)
    assert TAKEOFF.error(flight.as_stored()) == pytest.approx(error_m, abs=0.00005)


def test_values_arrive_as_written() -> None:
    flight = read_takeoff_csv(csv_of().encode())
    np.testing.assert_allclose(flight.time_s, np.arange(ROWS) * 0.02, atol=1e-9)
    assert flight["altitude_m"][100] == 1.0
    assert (flight.source, flight.clock) == ("csv", "vehicle")


@pytest.mark.parametrize(
    "data",
    [
        b"\xef\xbb\xbf" + csv_of().encode(),
        csv_of().replace("\n", "\r\n").encode(),
        csv_of().rstrip("\n").encode(),
        csv_of().replace(",", " , ").encode(),
        csv_of(header='"time_s","altitude_m"').encode(),
        (csv_of() + "\n\n").encode(),
    ],
    ids=["byte order mark", "CRLF", "no last line end", "spaces", "quoted header", "empty lines at the end"],
)
def test_harmless_variants_read_alike(data: bytes) -> None:
    flight, plain = read_takeoff_csv(data), read_takeoff_csv(csv_of().encode())
    np.testing.assert_array_equal(flight.time_s, plain.time_s)
    np.testing.assert_array_equal(flight["altitude_m"], plain["altitude_m"])


def test_known_columns_are_kept_in_any_order_and_others_left_in_the_file() -> None:
    rows = "\n".join(f"x{i},{i},{-i},{i * 0.1:.1f}" for i in range(30))
    flight = read_takeoff_csv(f"note,altitude_m,climb_rate_m_s,time_s\n{rows}\n".encode())
    assert set(flight.channels) == {"altitude_m", "climb_rate_m_s"}
    assert flight["climb_rate_m_s"][3] == -3.0
    assert flight.time_s[3] == pytest.approx(0.3)


@pytest.mark.parametrize("hole", ["", " ", "nan", "NaN"])
def test_an_optional_column_with_a_hole_is_left_out_and_the_flight_says_so(hole: str) -> None:
    rows = "\n".join(f"{i * 0.1:.1f},{i},{hole if i == 7 else 11.1},{i * 2}" for i in range(30))
    flight = read_takeoff_csv(f"time_s,altitude_m,battery_v,climb_rate_m_s\n{rows}\n".encode())
    assert set(flight.channels) == {"altitude_m", "climb_rate_m_s"}
    assert len(flight) == 30
    assert flight["climb_rate_m_s"][8] == 16.0
    assert flight.source == "csv; left out, with its first missing value: battery_v (line 9)"


def test_every_column_with_holes_is_named() -> None:
    rows = "\n".join(f"{i * 0.1:.1f},{i},,{i if i else ''}" for i in range(30))
    flight = read_takeoff_csv(f"time_s,altitude_m,battery_v,thrust\n{rows}\n".encode())
    assert set(flight.channels) == {"altitude_m"}
    assert flight.source == "csv; left out, with its first missing value: thrust (line 2), battery_v (line 2)"


@pytest.mark.parametrize(
    ("cell", "reason"), [("low", "is not a number: 'low'"), ("inf", "is not a finite number: 'inf'")]
)
def test_an_optional_value_that_is_there_but_wrong_is_refused(cell: str, reason: str) -> None:
    """It is no hole: the columns may have slipped, and then nothing in the file can be believed."""
    rows = "\n".join(f"{i * 0.1:.1f},{i},{cell if i == 7 else 11.1}" for i in range(30))
    problem = refusal_of(f"time_s,altitude_m,battery_v\n{rows}\n").problems[0]
    assert (problem.field, problem.reason) == ("line 9, column battery_v", reason)


def test_samples_before_the_command_are_read() -> None:
    assert read_takeoff_csv(csv_of(start=-50).encode()).time_s[0] == -1.0


@pytest.mark.parametrize(
    ("line", "text", "field", "reason"),
    [
        (7, "0.1,nan", "line 7, column altitude_m", "is not a finite number: 'nan'"),
        (7, "0.1,-inf", "line 7, column altitude_m", "is not a finite number: '-inf'"),
        (7, "NaN,0.05", "line 7, column time_s", "is not a finite number: 'NaN'"),
        (7, "0.1,high", "line 7, column altitude_m", "is not a number: 'high'"),
        (7, "0.1,", "line 7, column altitude_m", "is not a number: ''"),
        (7, "0.1,1_0", "line 7, column altitude_m", "is not a finite number: '1_0'"),
        (7, "0.1,1e30", "line 7, column altitude_m", "is outside the range of a takeoff: 1e+30"),
        (7, "0.04,0.05", "line 7, column time_s", "must increase, but 0.04 s follows 0.08 s"),
        (7, "0.08,0.05", "line 7, column time_s", "must increase, but 0.08 s follows 0.08 s"),
        (7, "0.1,0,05", "line 7", "has 3 values where the header names 2 columns"),
        (7, "0.1", "line 7", "has 1 values where the header names 2 columns"),
        (1, "t,alt", "line 1, column time_s", "is missing"),
        (1, "time_s,height", "line 1, column altitude_m", "is missing"),
        (1, "0.0,0.0", "line 1, column time_s", "is missing"),
        (1, "time_s;altitude_m", "line 1", "has its columns separated by semicolons, not commas"),
        (1, "time_s\taltitude_m", "line 1", "has its columns separated by tabs, not commas"),
        (1, "time_s,altitude_m,altitude_m", "line 1, column altitude_m", "appears twice"),
        (1, "x" * 5000, "line 1", "is longer than 4096 bytes"),
    ],
)
def test_the_first_wrong_thing_is_named_by_line_and_column(line: int, text: str, field: str, reason: str) -> None:
    problem = refusal_of(replace_line(csv_of(), line, text)).problems[0]
    assert (problem.field, problem.reason) == (field, reason)


def test_lines_are_counted_as_an_editor_shows_them() -> None:
    """Empty lines are skipped, and counted."""
    text = replace_line(csv_of(), 4, "")
    assert refusal_of(replace_line(text, 9, "0.2,oops")).problems[0].field == "line 9, column altitude_m"


@pytest.mark.parametrize("text", ["", "\n\n"])
def test_an_empty_file_is_called_empty(text: str) -> None:
    assert "empty" in refusal_of(text).message


def test_two_rows_are_too_few_for_a_flight() -> None:
    refusal = refusal_of(csv_of(rows=2))
    assert "2 samples" in refusal.message
    assert refusal.problems[0].reason == "has too few rows"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "latin-1"])
def test_another_encoding_than_utf_8_is_named(encoding: str) -> None:
    data = replace_line(csv_of(), 3, "0.02,0.01,Höhe").encode(encoding)
    assert "UTF-8" in refusal_of(data).hint


def test_a_picture_is_not_a_flight() -> None:
    assert refusal_of(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR").problems[0].field == "line 1"


def test_an_open_quote_is_refused() -> None:
    assert "not a line of CSV" in refusal_of(replace_line(csv_of(), 7, '"0.1,0.05')).problems[0].reason


def test_times_that_single_precision_cannot_tell_apart_are_refused() -> None:
    rows = "\n".join(f"{700_000 + i * 0.001:.3f},1.0" for i in range(30))
    problem = refusal_of(f"time_s,altitude_m\n{rows}\n").problems[0]
    assert problem.field == "line 3, column time_s"


def test_a_flight_with_a_gap_is_read_and_then_judged_by_whoever_scores_it() -> None:
    lines = csv_of().split("\n")
    flight = read_takeoff_csv("\n".join(lines[:500] + lines[520:]).encode())
    with pytest.raises(TrajectoryError, match="gap"):
        require_scorable(flight, "altitude_m", 0.0, 32.6)


class TenMillionRows(io.RawIOBase):
    """A file that is written while it is read, so that only what is read exists."""

    lines_read = 0

    def readline(self, _size: int | None = -1, /) -> bytes:
        self.lines_read += 1
        if self.lines_read > 10_000_001:
            return b""
        return b"time_s,altitude_m\n" if self.lines_read == 1 else b"%.3f,1.0\n" % (self.lines_read * 0.001)


@pytest.mark.complete
def test_ten_million_rows_are_refused_without_being_read() -> None:
    stream = TenMillionRows()
    with pytest.raises(TrajectoryError) as refusal:
        read_takeoff_csv(stream)  # type: ignore[arg-type]
    assert refusal.value.problems[0].field == f"line {MAX_ROWS + 2}"
    assert stream.lines_read == MAX_ROWS + 2


@pytest.mark.complete
def test_the_largest_file_that_may_be_read_is_read() -> None:
    rows = "\n".join(f"{i * 0.001:.3f},1" for i in range(MAX_ROWS))
    assert len(read_takeoff_csv(f"time_s,altitude_m\n{rows}\n".encode())) == MAX_ROWS
