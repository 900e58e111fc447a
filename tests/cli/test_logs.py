"""`gainline logs` on the data folder of the running application."""

import json
from collections.abc import Mapping
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from jsonschema import Draft202012Validator
from typer.testing import CliRunner, Result

from app.cli.commands import app
from app.common.settings import Settings
from app.db.session import Database
from tests.builders import get
from tests.log_library.documents import EXPORTED
from tests.log_library.library import FLOWN, PATH, VEHICLES, change, copied, library
from tests.logs.recorded import recorded

PX4, COPTER, TAKEOFF = FLOWN


@pytest.fixture
def logs(database: Database) -> Mapping[str, int]:
    return library(database)


@pytest.fixture
def hop(tmp_path: Path) -> Path:
    path = tmp_path / "[red]\x1b[2Jhop.bin"
    path.write_bytes(recorded(COPTER))
    return path


def run(settings: Settings, *arguments: object) -> Result:
    return CliRunner().invoke(app, ["logs", *map(str, arguments), "--data-dir", str(settings.data_dir)])


def words(result: Result) -> str:
    """What was printed, in one line."""
    return " ".join(result.output.split())


def test_a_log_is_added_and_kept_on_request(client: TestClient, settings: Settings, hop: Path) -> None:
    added = run(settings, "add", hop)
    assert added.exit_code == 0, added.output
    assert "\x1b[2J" not in added.output
    assert "[red][2Jhop.bin (ArduCopter" in added.output
    assert "Log 1, not kept, and deleted after seven days." in added.output
    again = run(settings, "add", hop, "--vehicle", "Bee [dim]", "--keep-file")
    assert again.exit_code == 0, again.output
    assert "This log was analysed before, on 20" in again.output
    assert "Log 1, kept as a flight of Bee [dim], with its file." in again.output
    assert get(client, f"{PATH}/1")["log"]["file_bytes"] == hop.stat().st_size
    assert "[red][2Jhop.bin Bee [dim] 2026-11-21 00:28 partial" in words(run(settings, "list"))


def test_a_log_with_the_hardware_id_of_a_vehicle_is_kept_as_its_flight(
    client: TestClient, database: Database, settings: Settings, logs: Mapping[str, int], hop: Path
) -> None:
    for log in (PX4, COPTER):
        change(database, logs[log], hardware_id="0012")
    client.put(f"{PATH}/{logs[PX4]}/vehicle", json={"name": "Bee"})
    refused = run(settings, "add", hop, "--vehicle", "Wasp")
    assert (refused.exit_code, "its hardware id is that of Bee" in refused.stderr) == (1, True)
    assert "kept as a flight of Bee." in run(settings, "add", hop).output


def test_a_log_is_kept_even_where_its_file_has_no_room(
    client: TestClient, settings: Settings, logs: Mapping[str, int], hop: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GAINLINE_LOG_FILE_BYTES", "0")
    refused = run(settings, "add", hop, "--vehicle", "Bee", "--keep-file")
    assert (refused.exit_code, "raise GAINLINE_LOG_FILE_BYTES" in refused.stderr) == (1, True)
    place = get(client, f"{PATH}/{logs[COPTER]}")["log"]
    assert (place["vehicle"]["name"], place["file_bytes"]) == ("Bee", 0)


@pytest.mark.parametrize("name", ["", "x" * 121, "a\x1b[2Jb"])
def test_a_name_that_no_vehicle_may_have_is_refused_before_the_log_is_read(
    client: TestClient, settings: Settings, tmp_path: Path, name: str
) -> None:
    refused = run(settings, "add", tmp_path / "missing.bin", "--vehicle", name)
    assert (refused.exit_code, "--vehicle: " in refused.stderr, "\x1b[2J" in refused.stderr) == (1, True, False)
    assert get(client, VEHICLES) == []


def test_logs_are_listed_and_those_of_a_vehicle_alone(
    client: TestClient, settings: Settings, logs: Mapping[str, int]
) -> None:
    client.put(f"{PATH}/{logs[COPTER]}/vehicle", json={"name": "Bee"})
    printed = words(run(settings, "list"))
    assert f"{logs[COPTER]} {COPTER} Bee 2026-11-21 00:28 partial" in printed
    assert f"{logs[TAKEOFF]} {TAKEOFF} not kept" in printed
    alone = run(settings, "list", "--vehicle", "bee").output
    assert (COPTER in alone, TAKEOFF in alone) == (True, False)
    unknown = run(settings, "list", "--vehicle", "Wasp")
    assert (unknown.exit_code, "There is no vehicle of logs Wasp." in unknown.stderr) == (1, True)


def test_an_empty_library_says_how_to_begin(client: TestClient, settings: Settings) -> None:
    assert "There is no log yet." in run(settings, "list").output
    missing = run(settings, "show", "7")
    assert (missing.exit_code, "There is no log 7." in missing.stderr) == (1, True)


def test_an_answer_is_shown_and_written(settings: Settings, logs: Mapping[str, int], tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("log.json", "log.html", "gains.xml")]
    options = zip(("--json", "--html", "--params"), files, strict=True)
    result = run(settings, "show", logs[TAKEOFF], *(each for option in options for each in option))
    assert result.exit_code == 0, result.output
    found = json.loads(files[0].read_text())
    Draft202012Validator(json.loads(EXPORTED.read_text())).validate(found)
    assert found["texts"]["tuning"]["answer"] in words(result)
    assert f"<h1>{TAKEOFF}</h1>" in files[1].read_text()
    assert files[2].read_text() == found["texts"]["tuning"]["parameter_file"]["content"]
    refused = run(settings, "show", logs[COPTER], "--params", files[2])
    assert (refused.exit_code, "nothing is proposed" in refused.stderr) == (1, True)


def test_two_logs_are_compared(
    client: TestClient, database: Database, settings: Settings, logs: Mapping[str, int]
) -> None:
    alone = run(settings, "compare", logs[COPTER])
    assert (alone.exit_code, "There is no earlier log to compare with." in alone.stderr) == (1, True)
    later = copied(database, logs[COPTER], digest="later", file_name="[red]later.bin")
    for log in (logs[COPTER], later):
        client.put(f"{PATH}/{log}/vehicle", json={"name": "Bee"})
    result = run(settings, "compare", later)
    assert result.exit_code == 0, result.output
    assert f"[red]later.bin compared with {COPTER}: " in result.output
    assert f"log {logs[COPTER]} log {later}" in words(result)
    assert "No parameter differs." in result.output
    other = run(settings, "compare", later, "--before", logs[PX4])
    assert (other.exit_code, "is not compared with" in other.stderr) == (1, True)
