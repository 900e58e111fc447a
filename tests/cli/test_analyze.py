"""`gainline analyze` on recorded and simulated logs."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.cli.commands import app
from tests.core.analysis.flights import GUSTY, QUIET, simulated_flight
from tests.log_library.documents import require_data
from tests.logs.paparazzi_flights import Flight, write
from tests.logs.recorded import recorded
from tests.logs.written import NEWER_PARAMETERS, PARAMETERS, ardupilot_log

TRACE = Path(__file__).parents[1] / "data" / "vertical_loop" / "takeoff_default.csv.gz"


def analyze(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["analyze", *map(str, arguments)])


def lines_of(file: Path) -> list[str]:
    """Lines of a parameter file but for the comments."""
    return [line for line in file.read_text().splitlines() if not line.startswith("#")]


@pytest.fixture
def steps(tmp_path: Path) -> Path:
    path = tmp_path / "steps.bin"
    path.write_bytes(recorded("arducopter_steps.bin"))
    return path


@pytest.fixture
def takeoff(tmp_path: Path) -> Path:
    path = tmp_path / "takeoff.tlog"
    path.write_bytes(recorded("paparazzi_283_13_82.tlog"))
    return path


def test_a_log_gives_a_table_a_document_and_a_parameter_file(steps: Path, tmp_path: Path) -> None:
    """The binary flew 27 mm with its defaults, and 4.2 mm with 3, 8, 0.5, 3."""
    document, parameters = tmp_path / "steps.json", tmp_path / "gains.param"
    result = analyze(steps, "--json", document, "--params", parameters)
    assert result.exit_code == 0, result.output
    assert "hover throttle 0.365, thrust slope 1.00 ± 0.01, motor lag 0 ± 3 ms" in " ".join(result.output.split())
    for name in ("As flown", "Proposed", "ArduCopter's default gains", "P = hover throttle, I = 2 P", "3, 8, 0.5, 3"):
        assert name in result.output
    found = json.loads(document.read_text())
    require_data(found)
    numbers = found["tuning"]["numbers"]
    gains = numbers["proposed"]["gains"]
    assert numbers["proposed"]["error_m"] < 0.2 * numbers["assessments"][0]["error_m"]
    assert numbers["vehicle"]["thrust_slope"]["mean"] == pytest.approx(1.0, abs=0.01)
    assert found["texts"]["tuning"]["answer"] in " ".join(result.output.split())
    lines = lines_of(parameters)
    assert {line.split(",")[0]: float(line.split(",")[1]) for line in lines} == pytest.approx(gains)


@pytest.mark.complete
def test_a_log_of_release_4_7_is_answered_in_its_names_and_units(tmp_path: Path) -> None:
    older, newer = tmp_path / "older.bin", tmp_path / "newer.bin"
    flight = simulated_flight(QUIET)
    older.write_bytes(ardupilot_log(flight, parameters=PARAMETERS))
    newer.write_bytes(ardupilot_log(flight, parameters=NEWER_PARAMETERS))
    files = [tmp_path / "older.param", tmp_path / "newer.param"]
    outputs = [analyze(log, "--params", file).output for log, file in zip((older, newer), files, strict=True)]
    assert "P = hover throttle, I = 2 P" in outputs[0]
    assert "P = 0.1 hover throttle, I = 2 P" in outputs[1]
    assert "2, 7, 0.1, 0.2" in outputs[1]
    values = [[float(line.split(",")[1]) for line in lines_of(file)] for file in files]
    names = [line.split(",")[0] for line in lines_of(files[1])]
    assert names == ["PSC_D_POS_P", "PSC_D_VEL_P", "PSC_D_ACC_P", "PSC_D_ACC_I", "MOT_THST_HOVER"]
    assert values[1] == pytest.approx([*values[0][:2], 0.1 * values[0][2], 0.1 * values[0][3], values[0][4]])


@pytest.mark.complete
def test_the_document_alone_can_be_printed(takeoff: Path) -> None:
    result = analyze(takeoff, "--json", "-")
    assert json.loads(result.stdout)["file_name"] == "takeoff.tlog"


@pytest.mark.complete
def test_a_log_named_in_place_of_the_document_is_not_overwritten(takeoff: Path, steps: Path) -> None:
    """Observed: `--json LOG LOG` replaced the first log by the result of the second."""
    before = steps.read_bytes()
    result = analyze("--json", steps, takeoff)
    assert result.exit_code == 2
    assert "is not overwritten" in " ".join(result.output.split())
    assert steps.read_bytes() == before


def test_a_trace_is_compared_with_the_replica_and_gives_no_gains(tmp_path: Path) -> None:
    document = tmp_path / "trace.json"
    result = analyze(TRACE, "--json", document)
    assert result.exit_code == 0, result.output
    output = " ".join(result.output.split())
    assert f"Gains (refused): {TRACE.name} is a trace of the loop, not the log of a flight." in output
    assert "Recording: step-by-step trace, gains kp 283, ki 13, kd 82, of the recording." in output
    assert "thrust, commanded thrust exact 0 counts 0 counts" in output
    assert "steps are exact in all 7 signals" in output
    found = json.loads(document.read_text())
    assert (found["autopilot"], found["replica"]["agrees"]) == ("Paparazzi", True)
    assert "is a trace of the loop" in analyze(TRACE, "--params", tmp_path / "gains.xml").output


def test_the_replica_uses_the_gains_given(tmp_path: Path) -> None:
    flight = write(tmp_path, Flight(gains={"kp": 283, "ki": 13, "kd": 82}, fly_s=6.0))
    output = analyze(flight, "--gains", "300,13,82").output
    assert "The replica differs" in output
    assert "More commands match with kp 283, ki 13, kd 82: were other gains flown?" in output
    assert "gains must be three whole numbers, KP,KI,KD" in analyze(flight, "--gains", "1,2").output


@pytest.mark.complete
def test_gains_may_replace_gains_but_nothing_else(steps: Path, tmp_path: Path) -> None:
    earlier = tmp_path / "gains.param"
    earlier.write_text("PSC_POSZ_P,1\n")
    assert analyze(steps, "--params", earlier).exit_code == 0
    assert lines_of(earlier)[0] == "PSC_POSZ_P,3"
    assert "# PSC_POSZ_P was 1" in earlier.read_text()
    assert analyze(steps, "--params", earlier).exit_code == 0
    before = steps.read_bytes()
    refused = analyze(steps, "--params", steps)
    assert refused.exit_code == 2
    assert "was not written by this command" in refused.output
    assert steps.read_bytes() == before


@pytest.mark.complete
def test_a_flight_with_the_throttle_at_its_limit_for_a_moment_says_so(tmp_path: Path) -> None:
    flight = simulated_flight(QUIET)
    flight.segments[0].throttle[60:63] = 1.0
    path = tmp_path / "limit.bin"
    path.write_bytes(ardupilot_log(flight))
    assert "throttle at a limit in 2 % of the samples." in " ".join(analyze(path).output.split())


@pytest.mark.complete
def test_what_does_not_suffice_is_said_and_writes_no_gains(tmp_path: Path) -> None:
    path, parameters = tmp_path / "gusty.bin", tmp_path / "gains.param"
    told = replace(GUSTY, gust_m_s2=0.8, quadratic=0.4, assumed_hover_throttle=0.4)
    path.write_bytes(ardupilot_log(simulated_flight(told, seed=3), parameters={**PARAMETERS, "MOT_THST_HOVER": 0.4}))
    result = analyze(path)
    assert result.exit_code == 0
    assert "does not suffice to propose gains" in " ".join(result.output.split())
    refused = analyze(path, "--params", parameters)
    assert refused.exit_code == 1
    assert "No parameter file was written" in refused.output
    assert not parameters.exists()


@pytest.mark.complete
def test_takeoffs_under_paparazzi_give_a_section_of_the_airframe_file(takeoff: Path, tmp_path: Path) -> None:
    section = tmp_path / "gains.xml"
    result = analyze(takeoff, "--params", section)
    assert result.exit_code == 0, result.output
    assert "1 takeoff analysed over 32.6 s, mean distance from 3 m 0.330 m" in " ".join(result.output.split())
    assert '<define name="HOVER_KP" value="' in section.read_text()
    assert analyze(takeoff, "--params", section).exit_code == 0


def test_the_log_file_beside_a_data_file_is_read_too(tmp_path: Path) -> None:
    path = write(tmp_path, Flight(gains={"kp": 283, "ki": 13, "kd": 82}, fly_s=6.0))
    path.with_suffix(".log").write_text("<configuration>")
    assert "has a companion file that is not XML" in analyze(path).output


@pytest.mark.complete
def test_a_vehicle_that_is_not_in_the_log_cannot_be_chosen(takeoff: Path) -> None:
    result = analyze(takeoff, "--vehicle", "9")
    assert result.exit_code == 1
    assert "has no vehicle 9, only 31" in result.stderr


def test_files_that_cannot_be_read_or_written_are_named(takeoff: Path, tmp_path: Path) -> None:
    missing = analyze(tmp_path / "missing.bin")
    assert missing.exit_code == 1
    assert "missing.bin could not be read: No such file or directory." in missing.output
    assert "FILE" not in missing.output
    nowhere = analyze(takeoff, "--params", tmp_path / "none" / "gains.param")
    assert nowhere.exit_code == 1
    assert "could not be written" in nowhere.output
