"""A campaign on a real vehicle is flown on its simulation first: nothing real is staged before."""

import pytest
from fastapi.testclient import TestClient

from app.campaigns.definitions import definition_of
from app.campaigns.proposals import start_flying
from app.campaigns.rehearsals import rehearsal_of, rehearsal_result
from app.campaigns.repository import GatedTrial
from app.campaigns.service import get_row
from app.common.states import Outcome, TrialState
from app.db import outbox
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
from tests.conftest import Listen
from tests.fleet.vehicles import create_campaign_on, create_connected, put_rehearsal, register

VALID, ABORTED, INVALID, LOST = TrialState.VALID, TrialState.ABORTED, TrialState.INVALID, TrialState.LOST


@pytest.mark.parametrize(
    ("states", "outcome", "expected"),
    [
        ([], None, "under way"),
        ([VALID, VALID], None, "under way"),
        ([VALID, VALID, TrialState.PLANNED, TrialState.CANCELLED], None, "under way"),
        ([VALID] * 3, None, "passed"),
        ([VALID], Outcome.CONVERGED, "passed"),
        ([VALID], Outcome.BUDGET, "passed"),
        ([VALID, VALID], Outcome.STOPPED, "failed"),
        ([VALID] * 3, Outcome.STOPPED, "passed"),
        ([], Outcome.BUDGET, "failed"),
        ([VALID] * 6 + [ABORTED], None, "failed"),
        ([INVALID, VALID, VALID, VALID], Outcome.CONVERGED, "failed"),
        ([VALID, VALID, VALID, LOST], None, "failed"),
    ],
)
def test_it_is_passed_by_three_valid_flights_or_its_own_stop_and_nothing_spoilt(
    states: list[TrialState], outcome: Outcome | None, expected: str
) -> None:
    flown = [GatedTrial(number, state, gate_passed=True) for number, state in enumerate(states, start=1)]
    assert rehearsal_result(flown, outcome)[0] == expected


def test_gains_that_the_gate_refused_spoil_it() -> None:
    flown = [GatedTrial(number, VALID, gate_passed=number != 2) for number in (1, 2, 3)]
    assert rehearsal_result(flown, None) == ("failed", "the gate refused the gains of flight 2 and was overruled")


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    """On a real vehicle that is connected; nothing rehearsed."""
    drone = create_connected(client, database, real=True)
    definition = {"strategy": "gradient", "stop": {"kind": "paper"}}
    return create_campaign_on(client, database, drone, rehearsed=False, definition=definition)


def rehearse(client: TestClient, campaign: Json) -> Json:
    answer = client.post(f"/api/campaigns/{campaign['id']}/rehearsal")
    assert answer.status_code == 201, answer.text
    made: Json = answer.json()
    return made


def again(client: TestClient, campaign: Json) -> Json:
    found: Json = get(client, f"/api/campaigns/{campaign['id']}")
    return found


def test_a_real_vehicle_is_staged_only_after_three_flights_on_its_simulation(
    client: TestClient, database: Database, campaign: Json
) -> None:
    assert campaign["rehearsal"]["state"] == "missing"
    assert campaign["next_action"] == "Rehearse on a simulation"
    planned = create_trial(client, campaign["id"])
    assert "stage" not in planned["actions"]
    refused = client.post(f"/api/trials/{planned['id']}/stage")
    assert refused.status_code == 409
    assert "has not passed its rehearsal (it has not been flown on a simulation)" in refused.json()["detail"]
    assert "Rehearse it on its simulation first: fly 3 valid flights" in refused.json()["hint"]

    rehearsal = rehearse(client, campaign)
    assert (rehearsal["vehicle"]["kind"], rehearsal["rehearses"], rehearsal["name"]) == (
        "jsbsim",
        campaign["id"],
        "Rehearsal: Real",
    )
    assert rehearsal["definition"] == campaign["definition"]
    assert rehearse(client, campaign)["id"] == rehearsal["id"]
    run_jobs(database)
    for settling_s in (3.0, 2.0, 1.0):
        assert again(client, campaign)["rehearsal"]["state"] == "under way"
        create_flown_trial(client, database, rehearsal["id"], settling_s)
    assert again(client, campaign)["rehearsal"] == {
        "state": "passed",
        "campaign_id": rehearsal["id"],
        "reason": "3 valid flights, nothing aborted, invalid or refused",
    }
    assert client.post(f"/api/trials/{planned['id']}/stage").status_code == 202


@pytest.mark.complete
def test_the_card_of_one_that_has_passed_leads_to_the_real_vehicle(
    client: TestClient, database: Database, campaign: Json
) -> None:
    put_rehearsal(client, database, campaign)
    cards = {one["rehearsal"]: one for one in get(client, "/api/campaigns")["items"]}
    assert cards["not needed"]["has_passed_as_rehearsal"]
    assert cards["not needed"]["next_action"] == "Fly the campaign on the real vehicle"
    assert not cards["passed"]["has_passed_as_rehearsal"]


@pytest.mark.complete
def test_a_spoilt_one_is_flown_anew(client: TestClient, database: Database, campaign: Json) -> None:
    rehearsal = rehearse(client, campaign)
    run_jobs(database)
    create_trial(client, rehearsal["id"], fly={"speed": None})
    land(database, lift_off(database), create_record(ending="aborted", reason="too high", until_s=4.0))
    failed = again(client, campaign)
    assert (failed["rehearsal"]["state"], failed["rehearsal"]["reason"]) == ("failed", "flight 1 was aborted")
    assert failed["next_action"] == "Rehearse on a simulation"
    assert rehearse(client, campaign)["id"] != rehearsal["id"]
    assert again(client, campaign)["rehearsal"]["state"] == "under way"


@pytest.mark.complete
def test_another_definition_and_other_safe_gains_want_another_one(
    client: TestClient, database: Database, campaign: Json
) -> None:
    rehearse(client, campaign)
    changed = {**campaign["definition"], "bounds": {"kp": [200, 300]}}
    answer = client.patch(f"/api/campaigns/{campaign['id']}", json={"version": 1, "definition": changed})
    assert answer.json()["rehearsal"]["state"] == "missing"
    assert "have changed since the last rehearsal" in answer.json()["rehearsal"]["reason"]
    client.patch(f"/api/campaigns/{campaign['id']}", json={"version": 2, "definition": campaign["definition"]})
    assert again(client, campaign)["rehearsal"]["state"] == "under way"

    vehicle = campaign["vehicle"]["id"]
    softer = {"version": 1, "safe_gains": {"kp": 250, "ki": 13, "kd": 82}, "statement": "Ada: softer"}
    assert client.patch(f"/api/vehicles/{vehicle}", json=softer).status_code == 200
    assert again(client, campaign)["rehearsal"]["state"] == "missing"
    run_jobs(database)
    rehearsal = rehearse(client, campaign)
    run_jobs(database)
    create_flown_trial(client, database, rehearsal["id"])
    [flown] = get(client, f"/api/campaigns/{rehearsal['id']}/trials")["items"]
    first = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    assert flown["gains"] == first["gains"]


@pytest.mark.complete
def test_safe_gains_set_after_the_first_flight_want_no_other_one(
    client: TestClient, database: Database, campaign: Json
) -> None:
    put_rehearsal(client, database, campaign)
    with database.write() as session:
        row = get_row(session, campaign["id"])
        rehearsed = dict(row.vehicle.safe_gains)
        start_flying(row)
    softer = {"version": 1, "safe_gains": {"kp": 250, "ki": 13, "kd": 82}, "statement": "Ada: softer"}
    assert client.patch(f"/api/vehicles/{campaign['vehicle']['id']}", json=softer).status_code == 200
    assert again(client, campaign)["rehearsal"]["state"] == "passed"
    with database.read() as session:
        row = get_row(session, campaign["id"])
        assert (row.safe_gains, row.vehicle.safe_gains) == (rehearsed, softer["safe_gains"])


def test_where_no_simulation_flies_the_experiment_a_simulated_vehicle_is_asked_for(
    client: TestClient, database: Database
) -> None:
    options = {"autopilot": "px4"}
    copter = register(client, "Copter", real=True, options={**options, "simulated": False})
    body = {"name": "Copter", "vehicle": {"kind": "mavlink", "id": copter["id"]}}
    definition = {"experiment": copter["experiments"][0], "strategy": "manual", "step_fraction": 0.25}
    campaign = client.post("/api/campaigns", json={**body, "definition": definition}).json()
    refused = client.post(f"/api/campaigns/{campaign['id']}/rehearsal")
    assert refused.status_code == 409
    assert "gainline sim-drone" in refused.json()["hint"]
    simulated = register(client, "Desk copter", options={**options, "simulated": True})
    rehearsal = rehearse(client, campaign)
    assert rehearsal["vehicle"]["id"] == simulated["id"]


def test_simulations_need_none(client: TestClient, database: Database) -> None:
    shared = create_ready_campaign(client, database)
    own = create_campaign_on(client, database, create_connected(client, database))
    for one in (shared, own):
        assert one["rehearsal"] == {"state": "not needed", "campaign_id": None, "reason": ""}
        assert client.post(f"/api/campaigns/{one['id']}/rehearsal").status_code == 409


def test_a_rehearsal_that_begins_is_news_of_the_campaign_that_it_is_for(
    client: TestClient, database: Database, campaign: Json
) -> None:
    with database.read() as session:
        before = outbox.latest_event_id(session)
    rehearse(client, campaign)
    with database.read() as session:
        told = {(change.topic, change.entity_id) for change in outbox.events_after(session, before, limit=100)}
    assert ("campaign", campaign["id"]) in told


def test_a_rehearsal_that_is_given_to_a_real_vehicle_has_the_safe_gains_of_that_one(
    client: TestClient, database: Database, campaign: Json
) -> None:
    rehearsal = rehearse(client, campaign)
    other = register(client, "Other", real=True)
    softer = {"version": 1, "safe_gains": {"kp": 250, "ki": 13, "kd": 82}, "statement": "Ada: softer"}
    assert client.patch(f"/api/vehicles/{other['id']}", json=softer).status_code == 200
    moved = {"version": 1, "vehicle": {"kind": "mavlink", "id": other["id"]}}
    assert client.patch(f"/api/campaigns/{rehearsal['id']}", json=moved).status_code == 200
    with database.read() as session:
        assert definition_of(get_row(session, rehearsal["id"])).safe_gains == softer["safe_gains"]


def test_the_gates_word_on_a_rehearsal_is_read_at_once_however_many_flights_it_has(
    client: TestClient, database: Database, campaign: Json, listen: Listen
) -> None:
    put_rehearsal(client, database, campaign)
    with database.read() as session:
        row = get_row(session, campaign["id"])
        rehearsal_of(session, row)
        asked: list[str] = []
        listen(database.engine, "before_cursor_execute", lambda *said: asked.append(said[2]))
        assert rehearsal_of(session, row).state == "passed"
    assert len([statement for statement in asked if "FROM trial" in statement]) == 1
