"""Predictions of planned trials: what the page shows for gains that no proposal contains is kept with their trial."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import (
    Json,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    get,
    land,
    lift_off,
    run_jobs,
)
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


def drawn(client: TestClient, campaign_id: int, query: str = "") -> dict[str, tuple[int | None, list[float]]]:
    """The flight and the values of each predicted trace of the takeoffs, by its role and edge."""
    figure = get(client, f"/api/campaigns/{campaign_id}/figures/takeoffs{query}")["figure"]
    return {
        f"{one['meta']['role']} {one['meta'].get('edge', '')}".strip(): (one["meta"].get("trial"), one["y"])
        for one in figure["data"]
        if one["meta"]["role"] in {"prediction", "band", "predicted deviation"}
    }


def fly(client: TestClient, campaign_id: int, gains: Json) -> Json:
    return create_trial(client, campaign_id, gains=gains, fly={"speed": None})


def test_a_flight_with_custom_gains_grows_over_its_own_prediction(
    client: TestClient, database: Database, campaign: Json
) -> None:
    gains = {"kp": 350, "ki": 30, "kd": 90}
    shown = prediction(client, campaign["id"], gains)
    trial = fly(client, campaign["id"], gains)
    for query in ("", f"?predicted={trial['number']}"):
        found = drawn(client, campaign["id"], query)
        assert set(found) == {"prediction", "band lower", "band upper", "predicted deviation"}
        assert found["prediction"][0] == trial["number"]
        assert max(found["prediction"][1]) == pytest.approx(max(shown["curve"]["values"]), abs=1e-3)
        assert found["band upper"][1][-1] == pytest.approx(shown["upper"]["values"][-1], abs=1e-3)
    land(database, lift_off(database), create_record(0.9))
    run_jobs(database)


def test_the_chart_of_a_reviewed_flight_has_its_own_prediction_or_none_but_never_the_next_ones(
    client: TestClient, database: Database, campaign: Json
) -> None:
    proposed = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    next_one = drawn(client, campaign["id"])["prediction"]
    create_flown_trial(client, database, campaign["id"], 1.2)
    run_jobs(database)
    assert proposed["gains"] == get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][1]["gains"]
    assert drawn(client, campaign["id"], "?predicted=2")["prediction"] == next_one
    fly(client, campaign["id"], {"kp": 350, "ki": 30, "kd": 90})
    land(database, lift_off(database), create_record(0.9))
    run_jobs(database)
    assert drawn(client, campaign["id"], "?predicted=3") == {}
    assert drawn(client, campaign["id"])["prediction"][0] == 4
    assert drawn(client, campaign["id"], "?predicted=9") == {}
