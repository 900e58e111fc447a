import gzip
from pathlib import Path

import pytest

from app.autopilots.paparazzi.replica_check import COLUMNS, read_loop_trace
from app.core.errors import InputError

HEADER = ",".join(COLUMNS)
ROW = "0,alt,768,283,13,82,0,0,0,16384,0,0,0,0,0,7588,0,7588"


def trace(folder: Path, *lines: str) -> Path:
    path = folder / "trace.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_plain_and_gzipped_files_read_alike(tmp_path: Path) -> None:
    plain = trace(tmp_path, HEADER, ROW, ROW.replace("alt", "throttle"))
    zipped = tmp_path / "trace.csv.gz"
    zipped.write_bytes(gzip.compress(plain.read_bytes()))
    one, other = read_loop_trace(plain), read_loop_trace(zipped)
    assert len(one) == 2
    assert (
        one.inputs.tolist()
        == other.inputs.tolist()
        == [[1, 768, 283, 13, 82, 0, 0, 16384, 0], [0, 768, 283, 13, 82, 0, 0, 16384, 0]]
    )
    assert one.outputs[0].tolist() == [0, 0, 0, 0, 7588, 0, 7588]


def test_columns_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    reversed_lines = [",".join(reversed(line.split(","))) for line in (HEADER, ROW)]
    assert read_loop_trace(trace(tmp_path, *reversed_lines)).inputs.tolist() == [[1, 768, 283, 13, 82, 0, 0, 16384, 0]]


@pytest.mark.parametrize(
    ("lines", "where"),
    [
        ((HEADER.replace("r33", "r34"), ROW), "line 1, r33: column is missing"),
        ((HEADER + ",extra", ROW + ",0"), "line 1, extra: column is unknown"),
        ((HEADER, ROW, ROW.replace("283", "28.3")), "line 3, kp: must be a whole number, got '28.3'"),
        ((HEADER, ROW.replace("768", "")), "line 2, target: must be a whole number, got ''"),
        ((HEADER, ROW.replace("768", "7_68")), "line 2, target: must be a whole number, got '7_68'"),
        ((HEADER, ROW.replace("alt", "hover")), "line 2, mode: must be one of throttle, alt, climb, got 'hover'"),
        ((HEADER, ROW.replace("16384,0", "16384,2")), "line 2, in_flight: must be between 0 and 1, got 2"),
        ((HEADER, ROW.replace("283", "2147483648")), "line 2, kp: must be between -2147483648 and 2147483647"),
        ((HEADER, ROW, "1,alt,768"), "line 3, kp: the row has 3 values, the header 18"),
        ((HEADER, ROW + ",5"), "line 2, thrust: the row has 19 values, the header 18"),
        ((HEADER,), "has a header and no rows"),
        ((), "line 1, step: column is missing"),
    ],
)
def test_malformed_files_are_refused_naming_line_and_column(tmp_path: Path, lines: tuple[str, ...], where: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_loop_trace(trace(tmp_path, *lines))
    assert where in str(refusal.value)


def test_traces_beyond_the_limit_are_refused_while_reading(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.logs.trace_table.MAX_ROWS", 2)
    with pytest.raises(InputError, match=r"line 4, step: a trace may have at most 2 rows"):
        read_loop_trace(trace(tmp_path, HEADER, *[ROW] * 3))


def test_missing_and_damaged_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="could not be read: No such file"):
        read_loop_trace(tmp_path / "absent.csv")
    damaged = tmp_path / "damaged.csv.gz"
    damaged.write_bytes(gzip.compress(f"{HEADER}\n{ROW}\n".encode())[:40])
    with pytest.raises(InputError, match="damaged or not a text file"):
        read_loop_trace(damaged)
    damaged.write_bytes(b"not gzip at all")
    with pytest.raises(InputError, match="is not a trace"):
        read_loop_trace(damaged)
    binary = tmp_path / "binary.csv"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="damaged or not a text file"):
        read_loop_trace(binary)
