"""`gainline controller replay` on recorded runs; all of them: tests/core/control/test_replay.py."""

import gzip
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.cli.commands import app
from tests.logs.recorded import recorded

DATA = Path(__file__).parents[1] / "data"
TRACES = sorted((DATA / "vertical_loop").glob("*.csv.gz"))


def replay(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["controller", "replay", *map(str, arguments)])


@pytest.mark.complete
def test_a_recording_named_in_place_of_the_result_is_not_overwritten(tmp_path: Path) -> None:
    """Observed: `--json LOG LOG` replaced the first log by the result of the second."""
    log = tmp_path / "flight.csv.gz"
    log.write_bytes(TRACES[0].read_bytes())
    result = replay("--json", log, TRACES[1])
    assert result.exit_code == 2
    assert "is not overwritten" in " ".join(result.stderr.split())
    assert log.read_bytes() == TRACES[0].read_bytes()
    out = tmp_path / "replay.json"
    for _ in range(2):
        assert replay(TRACES[1], "--json", out).exit_code == 0


def test_the_other_files_are_still_replayed_when_one_is_missing(tmp_path: Path) -> None:
    result = replay(tmp_path / "absent.csv", TRACES[0])
    assert result.exit_code == 1
    assert "absent.csv" in result.stderr
    assert "exact" in result.stdout


@pytest.mark.complete
def test_a_run_of_arducopter_is_told_by_its_columns_and_agrees_within_the_tolerances(tmp_path: Path) -> None:
    out = tmp_path / "replay.json"
    result = replay(DATA / "ardupilot_loop" / "steps_limits.csv.gz", TRACES[0], "--json", out)
    assert result.exit_code == 0
    assert "ArduCopter: largest difference" in result.stdout
    arducopter, paparazzi = json.loads(out.read_text())["files"]
    assert (arducopter["autopilot"], arducopter["rows"]) == ("ardupilot", 4800)
    assert (arducopter["passed"], arducopter["exact"], arducopter["first_different_row"]) == (True, False, None)
    assert 0.0 < arducopter["largest_difference"]["z_d_m"] < 1e-5
    assert arducopter["notes"][0].startswith("1\N{NARROW NO-BREAK SPACE}466 rows at a throttle limit")
    assert (paparazzi["autopilot"], paparazzi["exact"]) == ("paparazzi", True)


def test_the_log_of_an_arducopter_is_compared_beside_a_trace_with_more_signals(tmp_path: Path) -> None:
    log, out = tmp_path / "flight.bin", tmp_path / "replay.json"
    log.write_bytes(recorded("arducopter_steps.bin"))
    result = replay(log, DATA / "ardupilot_loop" / "steps_default.csv.gz", "--json", out)
    assert result.exit_code == 0
    flown, trace = json.loads(out.read_text())["files"]
    assert set(flown["largest_difference"]) == {"z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "throttle"}
    assert flown["largest_difference"]["z_d_m"] < 1e-5
    assert flown["largest_difference"]["throttle"] < 1e-7
    assert "160 rows" in flown["notes"][1]
    assert len(trace["largest_difference"]) == 8


@pytest.mark.complete
def test_the_loop_of_px4_alone_agrees_in_every_row_and_a_flight_in_its_medians(tmp_path: Path) -> None:
    out = tmp_path / "replay.json"
    folder = DATA / "px4_loop"
    result = replay(folder / "wild_inputs.csv.gz", folder / "soft_steps_push.csv.gz", "--json", out)
    assert result.exit_code == 0
    assert "PX4: largest difference" in result.stdout
    wild, flight = json.loads(out.read_text())["files"]
    assert (wild["autopilot"], wild["rows"], wild["passed"]) == ("px4", 3000, True)
    assert max(wild["largest_difference"].values()) < 2e-7
    assert (flight["rows"], flight["passed"], flight["first_different_row"]) == (8960, True, None)
    assert flight["largest_difference"]["out_thrust"] < 1e-7
    assert flight["tolerance"]["out_thrust"] == 1e-4
    assert set(flight["median_difference"]) == {"takeoff_state", "out_vz_m_s", "out_az_m_s2", "out_thrust"}
    assert all(value <= flight["tolerance"][name] for name, value in flight["median_difference"].items())
    assert (wild["median_difference"], "PX4: median difference" in result.stdout) == ({}, True)
    assert flight["notes"][0].endswith("2163, 2714, 3326, 6043, 8649, 8771, 8835.")
    assert flight["notes"][1] == "The recording fits if the spool-up began one row before it."
    assert len(wild["notes"]) == 1


@pytest.mark.complete
def test_a_flight_of_px4_with_an_integral_gain_5_percent_off_differs_in_its_medians(tmp_path: Path) -> None:
    with gzip.open(DATA / "px4_loop" / "default_steps_push.csv.gz", "rt") as recorded:
        first, rest = recorded.readline(), recorded.read()
    path, out = tmp_path / "other.csv", tmp_path / "replay.json"
    path.write_text(first.replace('"MPC_Z_VEL_I_ACC": 2.0', '"MPC_Z_VEL_I_ACC": 2.1') + rest)
    result = replay(path, "--json", out)
    (file,) = json.loads(out.read_text())["files"]
    assert result.exit_code == 1
    assert not file["passed"]
    assert file["first_different_row"] is not None
