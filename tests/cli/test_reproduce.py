"""`gainline reproduce`: tables for a person, JSON for a program."""

import json
from pathlib import Path
from typing import get_args

import pytest
from typer.testing import CliRunner, Result

from app.cli.commands import app
from app.cli.options import Reproducible
from app.reproductions.registry import REPRODUCTIONS

TRACES = Path(__file__).parents[1] / "data" / "vertical_loop"


def reproduce(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["reproduce", *map(str, arguments)])


def test_every_reproduction_can_be_asked_for_and_all_together() -> None:
    assert {*get_args(Reproducible)} == {*REPRODUCTIONS, "all"}


@pytest.mark.complete
def test_a_table_is_printed_and_written_with_published_measured_and_ratio(tmp_path: Path) -> None:
    out = tmp_path / "table2.json"
    result = reproduce("table2", "--json", out)
    assert result.exit_code == 0, result.output
    document = json.loads(out.read_text())
    assert document["name"] == "table2"
    assert len(document["rows"]) == 16 + 7 + 1 + 7, "flights of the table, then three campaigns"
    first = document["rows"][0]
    assert first["gains"] == {"kp": 283.0, "ki": 13.0, "kd": 82.0}
    assert (first["paper"], first["measured"]) == (0.5102, pytest.approx(0.5236, rel=0.01))
    assert first["ratio"] == pytest.approx(first["measured"] / first["paper"])
    assert first["overshoot_m"] == pytest.approx(0.842, abs=0.005)
    assert set(document["figures"]) == {"figure11-left", "figure11-right"}
    second = document["rows"][17]
    assert second["group"] == "Campaign on twin from the default gains"
    assert (second["step_ki_counts"], second["paper_step_ki_counts"]) == (199.0, 47.0)
    for said in ("Table 2", "In the paper: Five real takeoffs", "0.5102", "measured", "1.026", "reference"):
        assert said in result.stdout


@pytest.mark.complete
def test_the_controller_is_replayed_from_the_packaged_run_or_from_a_given_one() -> None:
    packaged = reproduce("controller", "--json", "-")
    given = reproduce("controller", "--trace", TRACES / "takeoff_tuned.csv.gz", "--json", "-")
    rows = [json.loads(result.stdout)["rows"] for result in (packaged, given)]
    assert [{row["measured"] for row in each} for each in rows] == [{0.0}, {0.0}]
    assert [each[0]["rows"] for each in rows] == [8192.0, 6144.0]


def test_what_the_paper_shows_is_printed_as_such() -> None:
    assert "In the paper: The copy of the vertical loop" in reproduce("controller").stdout


def test_a_trace_that_is_not_there_is_named(tmp_path: Path) -> None:
    result = reproduce("controller", "--trace", tmp_path / "absent.csv")
    assert result.exit_code == 1
    assert "absent.csv" in result.stderr


def test_an_unknown_reproduction_is_refused() -> None:
    result = reproduce("table3")
    assert result.exit_code == 2
    assert "table3" in result.stderr
