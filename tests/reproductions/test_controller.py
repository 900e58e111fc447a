"""The recorded takeoff that comes with the program, replayed."""

import csv
import gzip
from pathlib import Path

import pytest

from app.core.errors import InputError
from app.reproductions.controller import RECORDED_TAKEOFF, run_controller

TRACES = Path(__file__).parents[1] / "data" / "vertical_loop"


def test_the_packaged_takeoff_is_the_recorded_one_and_replays_without_a_difference() -> None:
    assert RECORDED_TAKEOFF.read_bytes() == (TRACES / "takeoff_default.csv.gz").read_bytes()
    told: list[float] = []
    result = run_controller(lambda share, _doing: told.append(share))
    assert [row.label for row in result.rows] == [
        "z_ref", "zd_ref", "zdd_ref", "z_sum_err", "ff_cmd", "fb_cmd", "thrust"
    ]  # fmt: skip
    assert {row.measured for row in result.rows} == {0.0}
    assert {row.numbers["rows"] for row in result.rows} == {8192.0}
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_recording_and_replica_are_overlaid_signal_by_signal() -> None:
    figures = run_controller(lambda _share, _doing: None).figures
    drawn = {panel.y_title: panel.lines for plot in figures.values() for panel in plot.panels}
    assert set(drawn) == {"z_ref", "zd_ref", "zdd_ref", "ff_cmd", "fb_cmd", "thrust"}
    for recorded, replica in drawn.values():
        assert (recorded.name, replica.name) == ("Recorded", "Replica")
        assert recorded.y == replica.y
    assert max(drawn["thrust"][0].y) == pytest.approx(8965.0, abs=2.0), "the recorded peak, thinned"


@pytest.mark.complete
def test_a_trace_that_differs_is_measured(tmp_path: Path) -> None:
    with gzip.open(RECORDED_TAKEOFF, "rt", newline="") as recorded:
        rows = list(csv.reader(recorded))
    rows[1001][rows[0].index("thrust")] = str(int(rows[1001][rows[0].index("thrust")]) + 7)
    path = tmp_path / "spoilt.csv"
    with path.open("w", newline="") as out:
        csv.writer(out).writerows(rows)
    result = run_controller(lambda _share, _doing: None, path)
    assert {row.label: row.measured for row in result.rows if row.measured} == {"thrust": 7.0}
    assert "row 1000" in result.notes[0]


def test_a_file_that_is_no_trace_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        run_controller(lambda _share, _doing: None, tmp_path / "absent.csv")
