"""Predictions of planned trials: what the page shows for gains that no proposal contains is kept with their trial."""

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.core.records.trajectory import Trajectory
from app.core.tuning.strategy import Explanation, Proposal
from app.db.models import TrialRow
from app.db.session import Database
from tests.builders import (
    Json,
    create_flown_campaign,
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

OWN = {"kp": 350, "ki": 30, "kd": 90}


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    """A campaign with one flight."""
    return create_flown_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 9}})


def prediction(client: TestClient, campaign_id: int, gains: Json) -> Json:
    answer = client.post(f"/api/campaigns/{campaign_id}/prediction", json={"gains": gains})
    assert answer.status_code == 200, answer.text
    found: Json = answer.json()
    return found


@pytest.mark.complete
def test_custom_gains_keep_the_prediction_with_which_they_were_planned(client: TestClient, campaign: Json) -> None:
    shown = prediction(client, campaign["id"], OWN)
    planned = create_trial(client, campaign["id"], gains=OWN)
    assert shown["predicted_error"] is not None
    assert planned["predicted_error"] == pytest.approx(shown["predicted_error"])
    assert planned["predicted_interval"] == pytest.approx(shown["interval"])
    assert get(client, f"/api/trials/{planned['id']}")["predicted_error"] == planned["predicted_error"]


def test_a_repeat_keeps_its_prediction(client: TestClient, campaign: Json) -> None:
    planned = create_trial(client, campaign["id"], variant="repeat")
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


@pytest.mark.complete
def test_the_chart_of_a_reviewed_flight_has_its_own_prediction_and_never_the_next_ones(
    client: TestClient, database: Database, campaign: Json
) -> None:
    proposed = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    next_one = drawn(client, campaign["id"])["prediction"]
    create_flown_trial(client, database, campaign["id"], 1.2)
    run_jobs(database)
    assert proposed["gains"] == get(client, f"/api/campaigns/{campaign['id']}/trials")["items"][1]["gains"]
    assert drawn(client, campaign["id"], "?predicted=2")["prediction"] == next_one
    fly(client, campaign["id"], OWN)
    land(database, lift_off(database), create_record(0.9))
    run_jobs(database)
    assert drawn(client, campaign["id"], "?predicted=3")["prediction"][0] == 3
    assert drawn(client, campaign["id"])["prediction"][0] == 4
    assert drawn(client, campaign["id"], "?predicted=9") == {}


def drawn_with_flight(client: TestClient, trial: Json) -> dict[str, Json]:
    """The predicted traces on the page of a flight, by role and edge."""
    figure = get(client, f"/api/trials/{trial['id']}/figure")["figure"]
    roles = {"prediction", "band"}
    return {
        f"{one['meta']['role']} {one['meta'].get('edge', '')}".strip(): {"x": one["x"], "y": one["y"]}
        for one in figure["data"]
        if one["meta"]["role"] in roles
    }


def is_curve(trace: Json, shown: Json) -> bool:
    """Whether a trace is a curve of `POST …/prediction`, thinned differently."""
    expected = np.interp(trace["x"], shown["time_s"], shown["values"])
    return bool(np.allclose(trace["y"], expected, atol=5e-3))


CHOICES: dict[str, Json] = {
    "custom gains": {"gains": OWN},
    "repeat": {"variant": "repeat"},
    "smaller step": {"variant": "smaller step"},
}


@pytest.mark.complete
@pytest.mark.parametrize("choice", CHOICES)
def test_a_flight_keeps_the_curve_and_the_band_with_which_it_was_planned(
    client: TestClient, database: Database, choice: str
) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 9}})
    for settling_s in (6.0, 5.0):  # slow enough that half a step is one
        create_flown_trial(client, database, campaign["id"], settling_s)
        run_jobs(database)
    trial = create_trial(client, campaign["id"], **CHOICES[choice], fly={"speed": None})
    shown = prediction(client, campaign["id"], trial["gains"])
    query = f"?predicted={trial['number']}"
    planned = drawn(client, campaign["id"], query)
    assert set(planned) == {"prediction", "band lower", "band upper", "predicted deviation"}
    assert planned["prediction"][0] == trial["number"]
    assert drawn(client, campaign["id"]) == planned
    task = lift_off(database)
    assert drawn(client, campaign["id"]) == planned
    land(database, task, create_record(0.9))
    run_jobs(database)
    assert drawn(client, campaign["id"], query) == planned
    on_its_page = drawn_with_flight(client, trial)
    for name, curve in (("prediction", "curve"), ("band lower", "lower"), ("band upper", "upper")):
        assert is_curve(on_its_page[name], shown[curve]), name
    review(client, trial)
    run_jobs(database)
    create_flown_trial(client, database, campaign["id"], 0.8)
    run_jobs(database)
    assert drawn(client, campaign["id"], query) == planned
    assert drawn_with_flight(client, trial) == on_its_page


def review(client: TestClient, trial: Json) -> None:
    """Rule a flight out, which changes what the others predict."""
    flown = get(client, f"/api/trials/{trial['id']}")
    said = {"version": flown["version"], "outcome": "invalid", "reason": "Gust"}
    assert client.post(f"/api/trials/{trial['id']}/classify", json=said).status_code == 200


def test_the_stored_curve_is_thin(client: TestClient, database: Database, campaign: Json) -> None:
    planned = create_trial(client, campaign["id"], gains=OWN)
    with database.read() as session:
        curve = session.get_one(TrialRow, planned["id"]).predicted
        assert curve is not None
        assert (curve.columns, curve.samples) == (
            ["time_s", "altitude_m", "altitude_m_lower", "altitude_m_upper"],
            1000,
        )
        assert len(curve.data) < 10_000


def test_the_flight_of_a_proposal_stores_no_second_curve(
    client: TestClient, database: Database, campaign: Json
) -> None:
    planned = create_trial(client, campaign["id"])
    with database.read() as session:
        assert session.get_one(TrialRow, planned["id"]).predicted_id is None


@pytest.mark.complete
def test_before_a_valid_flight_only_the_models_curve_is_kept(client: TestClient, database: Database) -> None:
    """As with the proposal: error and band of a model that no flight has corrected say nothing."""
    created = create_ready_campaign(client, database)
    shown = prediction(client, created["id"], OWN)
    assert (shown["predicted_error"], shown["lower"], shown["upper"]) == (None, None, None)
    trial = create_trial(client, created["id"], gains=OWN, fly={"speed": None})
    assert set(drawn(client, created["id"])) == {"prediction", "predicted deviation"}
    land(database, lift_off(database), create_record(0.9))
    run_jobs(database)
    on_its_page = drawn_with_flight(client, trial)
    assert set(on_its_page) == {"prediction"}
    assert is_curve(on_its_page["prediction"], shown["curve"])


def test_a_curve_that_cannot_be_stored_does_not_prevent_the_trial(
    client: TestClient, database: Database, campaign: Json, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(*_: object) -> Proposal:
        curve = Trajectory(np.array([0.0, 1.0]), {"altitude_m": np.array([0.0, 1e39])}, "model", "simulation")
        return Proposal(
            kind="manual", gains={}, predicted=curve, predicted_error=9.0, explanation=Explanation(summary="")
        )

    monkeypatch.setattr("app.campaigns.flight_predictions.TrialPredictor.predict", diverge)
    planned = create_trial(client, campaign["id"], gains=OWN)
    assert planned["predicted_error"] == 9.0
    assert drawn(client, campaign["id"]) == {}
