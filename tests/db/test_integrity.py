"""Records that have changed on the disk: whatever is taken away says which, and what is shown shows the rest."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.cli.commands import app
from app.common.settings import Settings
from app.db.session import Database
from tests.builders import Json, create_flown_campaign, get


def damage(settings: Settings, trial: Json) -> None:
    """A few bytes of its stored record become others, as on a failing disk."""
    with closing(sqlite3.connect(settings.database_file)) as connection, connection:
        (record, data) = connection.execute(
            "SELECT trajectory.id, data FROM trajectory JOIN trial ON trajectory_id = trajectory.id WHERE trial.id = ?",
            (trial["id"],),
        ).fetchone()
        (trigger,) = connection.execute(
            "SELECT sql FROM sqlite_master WHERE name = 'trajectory_is_immutable'"
        ).fetchone()
        connection.execute("DROP TRIGGER trajectory_is_immutable")
        spoilt = data[: len(data) // 2] + bytes(8) + data[len(data) // 2 + 8 :]
        connection.execute("UPDATE trajectory SET data = ? WHERE id = ?", (spoilt, record))
        connection.execute(trigger)


@pytest.fixture
def damaged(client: TestClient, settings: Settings, campaign: Json) -> Json:
    """The second of the campaign's three flights."""
    trial: Json = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][1]
    damage(settings, trial)
    return trial


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    definition = {"stop": {"kind": "budget", "max_flights": 9}}
    return create_flown_campaign(client, database, 1.5, 1.2, 0.9, definition=definition)


@pytest.mark.complete
def test_a_backup_of_a_damaged_record_is_refused_and_names_its_trial(
    client: TestClient, campaign: Json, damaged: Json
) -> None:
    answer = client.get("/api/system/backup")
    assert answer.status_code == 503
    assert f"the record of trial 2 of campaign {campaign['id']} is damaged" in answer.json()["detail"]
    assert "copy gainline.sqlite3" in answer.json()["hint"]
    assert [problem["field"] for problem in answer.json()["problems"]] == [f"trial 2 of campaign {campaign['id']}"]


def test_a_backup_names_every_damaged_trial(client: TestClient, settings: Settings, campaign: Json) -> None:
    for trial in get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]:
        damage(settings, trial)
    answer = client.get("/api/system/backup").json()
    assert answer["detail"].startswith(
        "The backup was not created: 3 records are damaged, those of trial 1 of campaign"
    )
    assert len(answer["problems"]) == 3


def test_a_bundle_of_a_damaged_record_is_refused_and_leaves_no_file(
    client: TestClient, settings: Settings, campaign: Json, damaged: Json, tmp_path: Path
) -> None:
    answer = client.get(f"/api/campaigns/{campaign['id']}/bundle")
    assert answer.status_code == 503
    assert f"the record of trial 2 of campaign {campaign['id']} is damaged" in answer.json()["detail"]
    target = tmp_path / "out.gainline.zip"
    arguments = ["bundle", str(campaign["id"]), "--out", str(target), "--data-dir", str(settings.data_dir)]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 1
    assert f"trial 2 of campaign {campaign['id']}" in " ".join(result.output.split())
    assert list(tmp_path.glob("*.zip*")) == []


@pytest.mark.complete
def test_a_report_shows_the_rest_and_says_which_record_is_damaged(
    client: TestClient, campaign: Json, damaged: Json
) -> None:
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.html")
    assert answer.status_code == 200, answer.text
    assert "Damaged record" in answer.text
    assert "The stored record does not match its checksum." in answer.text
    assert f"{damaged['error']:.3f}" in answer.text
    card = get(client, f"/api/campaigns/{campaign['id']}/figures/takeoffs")
    assert card["state"] == "ready"


def test_what_is_computed_from_a_damaged_record_names_its_trial(
    client: TestClient, campaign: Json, damaged: Json
) -> None:
    answer = client.get(f"/api/trials/{damaged['id']}/trajectory.csv")
    assert answer.status_code == 503
    assert answer.json()["detail"].startswith(f"The record of trial 2 of campaign {campaign['id']} cannot be read")
