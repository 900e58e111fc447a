"""`gainline import`: the same service as the upload, on the same database."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient
from pymavlink.dialects.v10 import paparazzi
from pymavlink.dialects.v20 import ardupilotmega
from typer.testing import CliRunner, Result

from app.cli.commands import app
from app.common.settings import Settings
from app.db.session import Database
from tests.builders import Json, climb_error, create_climb, create_ready_campaign, create_trial, csv_of, get
from tests.logs.paparazzi_flights import Flight, write
from tests.logs.recorded import LOGS, Telemetry
from tests.logs.written_tlog import together

TUNED_LOG, LOG = LOGS / "paparazzi_1624_1356_195.tlog", LOGS / "paparazzi_283_13_82.tlog"


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    return create_ready_campaign(client, database, vehicle="import", name="Garage")


def run(settings: Settings, *arguments: object) -> Result:
    return CliRunner().invoke(app, ["import", *map(str, arguments), "--data-dir", str(settings.data_dir)])


def test_a_log_finds_its_campaign_by_name_and_plans_the_proposed_trial(
    client: TestClient, settings: Settings, campaign: Json
) -> None:
    result = run(settings, LOG, "--campaign", "garage", "--json", "-")
    assert result.exit_code == 0, result.stderr
    stored = json.loads(result.stdout)
    assert (stored["number"], stored["state"]) == (1, "valid")
    assert stored["error"] == pytest.approx(0.3297, abs=0.00005)
    assert get(client, f"/api/trials/{stored['id']}")["gains"] == {"kp": 283, "ki": 13, "kd": 82}


def test_the_trial_that_waits_takes_the_log(client: TestClient, settings: Settings, campaign: Json) -> None:
    trial = create_trial(client, campaign["id"])
    result = run(settings, LOG, "--campaign", campaign["id"])
    assert result.exit_code == 0, result.stderr
    assert "Trial 1 of campaign" in result.stdout
    assert "at the block Takeoff" in result.stdout
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "valid"


def test_other_gains_are_refused_where_nobody_can_be_asked_and_nothing_is_planned(
    client: TestClient, settings: Settings, campaign: Json
) -> None:
    result = run(settings, TUNED_LOG, "--campaign", "Garage")
    assert result.exit_code == 1
    assert "kp 1624, ki 1356, kd 195, not with the planned kp 283, ki 13, kd 82" in result.stderr
    assert "--yes confirms it" in result.stderr
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["total"] == 0


@pytest.mark.complete
def test_yes_takes_the_gains_of_the_log(client: TestClient, settings: Settings, campaign: Json, tmp_path: Path) -> None:
    data = write(tmp_path, Flight({"kp": 290, "ki": 40, "kd": 80}, setting=True))
    result = run(settings, data, "--campaign", "Garage", "--yes", "--json", tmp_path / "trial.json")
    assert result.exit_code == 0, result.stderr
    assert json.loads((tmp_path / "trial.json").read_text())["gains"] == {"kp": 290, "ki": 40, "kd": 80}


@pytest.mark.complete
def test_a_question_can_be_answered(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = write(tmp_path, Flight({"kp": 290, "ki": 40, "kd": 80}, setting=True))
    monkeypatch.setattr("app.cli.files.can_ask", lambda: True)
    asked = ["import", str(data), "--campaign", "Garage", "--data-dir", str(settings.data_dir)]
    declined = CliRunner().invoke(app, asked, input="n\n")
    assert declined.exit_code == 1
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["total"] == 0
    accepted = CliRunner().invoke(app, asked, input="y\n")
    assert accepted.exit_code == 0, accepted.stderr
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][0]["gains"]["kp"] == 290


def test_what_a_record_looks_like_is_asked_and_it_is_read_so(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    climb = create_climb()
    file = tmp_path / "flight.csv"
    file.write_bytes(csv_of({"time_s": climb.time_s, "altitude_m": 100.0 * climb["altitude_m"]}))
    refused = run(settings, file, "--campaign", "Garage")
    assert (refused.exit_code, "looks like one with altitude in centimetres" in refused.stderr) == (1, True)
    monkeypatch.setattr("app.cli.files.can_ask", lambda: True)
    asked = ["import", str(file), "--campaign", "Garage", "--data-dir", str(settings.data_dir)]
    declined = CliRunner().invoke(app, asked, input="n\n")
    assert (declined.exit_code, "Import it, read so?" in declined.output) == (1, True)
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["total"] == 0
    accepted = CliRunner().invoke(app, asked, input="y\n")
    assert accepted.exit_code == 0, accepted.stderr
    (trial,) = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    assert (trial["state"], trial["error"]) == ("valid", pytest.approx(climb_error(1.0), abs=1e-3))
    assert trial["record"]["source"] == "csv; read with altitude in centimetres"


def test_yes_stores_what_shows_no_flight_as_invalid(settings: Settings, campaign: Json, tmp_path: Path) -> None:
    climb = create_climb()
    file = tmp_path / "flight.csv"
    file.write_bytes(csv_of({"time_s": climb.time_s, "altitude_m": np.full_like(climb.time_s, 3.0)}))
    stored = run(settings, file, "--campaign", "Garage", "--yes")
    assert (stored.exit_code, "invalid, no error" in stored.stdout) == (0, True)


@pytest.mark.complete
def test_two_takeoffs_are_listed_and_one_is_taken_by_its_number(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    both = tmp_path / "both.tlog"
    both.write_bytes(TUNED_LOG.read_bytes() + LOG.read_bytes())
    listed = run(settings, both, "--campaign", "Garage")
    assert listed.exit_code == 1
    assert "The log contains 2 takeoffs" in listed.stderr
    assert "2: " in listed.stderr
    assert run(settings, both, "--campaign", "Garage", "--takeoff", 2).exit_code == 0


@pytest.mark.complete
def test_the_takeoffs_of_two_vehicles_are_listed_with_their_system_ids(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    log = Telemetry(ardupilotmega, autopilot=3, system=1)
    log.heartbeat()
    log.fly(2.0, to_m=0.0)
    log.fly(5.0, to_m=3.0)
    both = tmp_path / "both.tlog"
    both.write_bytes(log.content + LOG.read_bytes())
    listed = run(settings, both, "--campaign", "Garage")
    assert listed.exit_code == 1
    numbers = re.findall(r"([12]): system (\d+),", listed.stderr)
    assert sorted(system for _, system in numbers) == ["1", "31"]
    number = next(number for number, system in numbers if system == "31")
    assert run(settings, both, "--campaign", "Garage", "--takeoff", number).exit_code == 0
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][0]["error"] == pytest.approx(
        0.3297, abs=5e-5
    )


@pytest.mark.complete
def test_a_companion_computer_on_board_changes_nothing(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    companion = Telemetry(paparazzi, autopilot=9)
    companion.now_s = 0.0
    for _ in range(80):
        companion.now_s += 1.0
        companion.component("heartbeat", 2, 9, 0, 0, 4)
    log = tmp_path / "companion.tlog"
    log.write_bytes(together(LOG.read_bytes(), companion.content))
    assert run(settings, log, "--campaign", "Garage").exit_code == 0
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][0]["error"] == pytest.approx(
        0.3297, abs=5e-5
    )


@pytest.mark.complete
def test_two_waiting_trials_are_told_apart_by_their_number(
    client: TestClient, settings: Settings, campaign: Json
) -> None:
    gains = {"kp": 283, "ki": 13, "kd": 82}
    for _ in range(2):
        create_trial(client, campaign["id"], gains=gains)
    refused = run(settings, LOG, "--campaign", "Garage")
    assert refused.exit_code == 1
    assert "2 trials of campaign" in refused.stderr
    assert run(settings, LOG, "--campaign", "Garage", "--trial", 2).exit_code == 0
    assert run(settings, LOG, "--campaign", "Garage", "--trial", 9).exit_code == 1


@pytest.mark.parametrize(
    ("campaign_name", "file", "said"),
    [
        ("Nowhere", LOG, "There is no campaign 'Nowhere'"),
        ("77", LOG, "There is no campaign 77"),
        ("Garage", Path("absent.tlog"), "could not be read: No such file"),
    ],
)
def test_what_cannot_be_found_is_said_in_words(
    settings: Settings, campaign: Json, campaign_name: str, file: Path, said: str
) -> None:
    result = run(settings, file, "--campaign", campaign_name)
    assert result.exit_code == 1
    assert said in result.stderr


def test_a_name_that_two_campaigns_have_is_refused_with_their_numbers(
    client: TestClient, database: Database, settings: Settings, campaign: Json
) -> None:
    other = create_ready_campaign(client, database, vehicle="import", name="Garage")
    result = run(settings, LOG, "--campaign", "Garage")
    assert result.exit_code == 1
    assert f"{campaign['id']}, {other['id']}" in result.stderr


def test_a_log_for_a_campaign_that_flies_by_itself_is_refused(
    client: TestClient, database: Database, settings: Settings
) -> None:
    create_ready_campaign(client, database, vehicle="twin", name="Twin")
    result = run(settings, LOG, "--campaign", "Twin")
    assert result.exit_code == 1
    assert "is flown from here" in result.stderr
    assert "Flown elsewhere" in result.stderr


@pytest.mark.complete
def test_a_log_for_a_campaign_that_has_ended_is_refused_with_the_way_to_import_it(
    client: TestClient, settings: Settings, campaign: Json
) -> None:
    assert run(settings, LOG, "--campaign", "Garage").exit_code == 0
    assert client.post(f"/api/campaigns/{campaign['id']}/finish", json={}).status_code == 200
    result = run(settings, LOG, "--campaign", "Garage")
    assert result.exit_code == 1
    assert "has ended" in result.stderr
    assert "Reopen it" in result.stderr


def test_without_a_database_the_command_to_make_one_is_told(tmp_path: Path) -> None:
    arguments = ["import", str(LOG), "--campaign", "1", "--data-dir", str(tmp_path)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert "gainline serve" in result.stderr
