import gzip
import io
import math

import pytest

from app.core.errors import InputError
from app.logs.trace_table import TraceTable, has_columns, read_trace_table

DESCRIPTION = '# {"dt_s": 0.0025}'
HEADER = "t_s,z_m,thrust"


def read(*lines: str, zipped: bool = False, may_be_empty: tuple[str, ...] = ()) -> TraceTable:
    content = ("\n".join(lines) + "\n").encode()
    stream = io.BytesIO(gzip.compress(content) if zipped else content)
    return read_trace_table(stream, name="run.csv", columns=("z_m", "thrust"), may_be_empty=may_be_empty)


@pytest.mark.parametrize("zipped", [False, True])
def test_description_and_columns_are_read_plain_or_gzipped(zipped: bool) -> None:
    table = read(DESCRIPTION, HEADER, "0,1.5,0.39", "0.0025,-2e-3,1", zipped=zipped)
    assert len(table) == 2
    assert table.description == {"dt_s": 0.0025}
    assert {name: column.tolist() for name, column in table.columns.items()} == {
        "t_s": [0.0, 0.0025],
        "z_m": [1.5, -0.002],
        "thrust": [0.39, 1.0],
    }


def test_an_empty_field_is_nan_where_a_signal_may_be_absent() -> None:
    table = read(DESCRIPTION, HEADER, "0,1.5,", may_be_empty=("thrust",))
    assert math.isnan(table["thrust"][0])


@pytest.mark.parametrize(
    ("lines", "where"),
    [
        ((), "line 1, description: must be # and a JSON object"),
        ((HEADER, "0,1,2"), "line 1, description: must be # and a JSON object"),
        (("# [1]", HEADER, "0,1,2"), "line 1, description: must be # and a JSON object"),
        pytest.param(
            ("#" + "[" * 100_000, HEADER, "0,1,2"),
            "line 1, description: must be # and a JSON object",
            id="nested too deep",
        ),
        ((DESCRIPTION,), "line 2, z_m: column is missing"),
        ((DESCRIPTION, "t_s,z_m", "0,1"), "line 2, thrust: column is missing"),
        ((DESCRIPTION, HEADER + ",z_m", "0,1,2,3"), "line 2, z_m: column appears twice"),
        ((DESCRIPTION, HEADER), "has no rows"),
        ((DESCRIPTION, HEADER, "0,1,2", "0,1"), "line 4, thrust: the row has 2 values, the header 3"),
        ((DESCRIPTION, HEADER, "0,1,"), "line 3, thrust: must be a finite number, got ''"),
        ((DESCRIPTION, HEADER, "0,x,2"), "line 3, z_m: must be a finite number, got 'x'"),
        ((DESCRIPTION, HEADER, "0,inf,2"), "line 3, z_m: must be a finite number, got 'inf'"),
    ],
)
def test_malformed_runs_are_refused_naming_line_and_column(lines: tuple[str, ...], where: str) -> None:
    with pytest.raises(InputError) as refusal:
        read(*lines)
    assert where in str(refusal.value)


def test_damaged_files_are_refused() -> None:
    zipped = gzip.compress(f"{DESCRIPTION}\n{HEADER}\n0,1,2\n".encode())
    for content in (zipped[:40], b"\x1f\x8b" + bytes(40), b"# \xff\xfe\n"):
        with pytest.raises(InputError, match="damaged or not a text file"):
            read_trace_table(io.BytesIO(content), name="run.csv", columns=("z_m",))


def test_runs_beyond_the_limit_are_refused_while_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.logs.trace_table.MAX_ROWS", 2)
    with pytest.raises(InputError, match=r"line 5, t_s: a trace may have at most 2 rows"):
        read(DESCRIPTION, HEADER, *["0,1,2"] * 3)


def test_a_run_is_recognised_by_its_columns_in_its_second_line() -> None:
    beginning = f"{DESCRIPTION}\n{HEADER}\n0,1".encode()
    assert has_columns(beginning, ("z_m", "thrust"))
    assert not has_columns(beginning, ("z_m", "throttle"))
    assert not has_columns(f"{HEADER}\n{HEADER}\n".encode(), ("z_m",))
