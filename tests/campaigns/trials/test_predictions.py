"""Predictions of planned trials: what the page shows for gains that no proposal contains is kept with their trial."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import Json, create_flown_trial, create_ready_campaign, create_trial, get, run_jobs
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    """A campaign with one flight."""
    created = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 9}})
    create_flown_trial(client, database, created["id"])
    run_jobs(database)
    return created


def prediction(client: TestClient, campaign_id: int, gains: Json) -> Json:
    answer = client.post(f"/api/campaigns/{campaign_id}/prediction", json={"gains": gains})
    assert answer.status_code == 200, answer.text
    found: Json = answer.json()
    return found


def test_custom_gains_keep_the_prediction_with_which_they_were_planned(client: TestClient, campaign: Json) -> None:
    gains = {"kp": 350, "ki": 30, "kd": 90}
    shown = prediction(client, campaign["id"], gains)
    planned = create_trial(client, campaign["id"], gains=gains)
    assert shown["predicted_error"] is not None
    assert planned["predicted_error"] == pytest.approx(shown["predicted_error"])
    assert planned["predicted_interval"] == pytest.approx(shown["interval"])
    assert get(client, f"/api/trials/{planned['id']}")["predicted_error"] == planned["predicted_error"]


def test_a_repeat_keeps_its_prediction(client: TestClient, campaign: Json) -> None:
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"variant": "repeat"})
    assert answer.status_code == 201, answer.text
    planned = answer.json()
    shown = prediction(client, campaign["id"], planned["gains"])
    assert planned["predicted_error"] == pytest.approx(shown["predicted_error"])
    assert planned["predicted_interval"] == pytest.approx(shown["interval"])
