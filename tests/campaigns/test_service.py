"""Campaigns over HTTP: what is kept for ever, what is frozen, what a later word on a flight changes."""

from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy.exc import IntegrityError

from app.campaigns.definitions import definition_of
from app.campaigns.history import history_digest, trials_of
from app.campaigns.proposals import read_history
from app.common.states import TrialState
from app.core.definition import Definition
from app.db.models import CampaignRow, FlightRow, TrialRow
from app.db.session import Database
from app.flights import flight_rows
from app.vehicles.base import FlightRecord
from tests.builders import (
    claim,
    create_campaign,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    land,
    lift_off,
    run_jobs,
)
from tests.campaigns.trials.test_service import PATIENT, classify


def test_a_vehicles_ledger_outlives_the_wish_to_delete_a_campaign(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    create_trial(client, campaign["id"], fly={"speed": None})
    task = claim(database)
    with database.write() as session:
        flight_rows.record_outcome(
            session, task.flight_id, flight_rows.FlightOutcome(problem="the vehicle did not answer")
        )
    answer = client.delete(f"{path}?version=1")
    assert answer.status_code == 409
    assert "gain history" in answer.json()["detail"]
    assert get(client, f"/api/vehicles/{campaign['vehicle']['id']}/ledger")["total"] == 1
    with pytest.raises(IntegrityError), database.write() as session:
        session.delete(session.get_one(CampaignRow, campaign["id"]))


def test_a_flight_that_nobody_began_does_not_keep_a_campaign(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    client.post(f"/api/trials/{trial['id']}/cancel")
    assert client.delete(f"/api/campaigns/{campaign['id']}?version=1").status_code == 204
    with database.read() as session:
        assert session.query(FlightRow).count() == 0


def test_deleting_takes_the_version_that_was_looked_at(client: TestClient) -> None:
    path = f"/api/campaigns/{create_campaign(client)['id']}"
    client.patch(path, json={"version": 1, "name": "Renamed"})
    assert client.delete(path).status_code == 422
    assert client.delete(f"{path}?version=1").status_code == 409
    assert client.delete(f"{path}?version=2").status_code == 204


def test_an_edit_that_changes_nothing_is_none(client: TestClient) -> None:
    path = f"/api/campaigns/{create_campaign(client)['id']}"
    assert client.patch(path, json={"version": 1}).json()["version"] == 1


@pytest.mark.complete
def test_the_frozen_digest_covers_the_vehicle(client: TestClient, database: Database) -> None:
    digests = set()
    for vehicle in ({"kind": "twin"}, {"kind": "twin", "options": {"scatter": 0.0}}, {"kind": "jsbsim"}):
        made = client.post("/api/campaigns", json={"name": "Test", "vehicle": vehicle}).json()
        run_jobs(database)
        create_flown_trial(client, database, made["id"])
        digests.add(get(client, f"/api/campaigns/{made['id']}")["definition_digest"])
    assert len(digests) == 3


@pytest.mark.complete
def test_a_vehicles_own_safe_gains_stand_in_the_definition_that_proposals_and_gate_go_by(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    before = get(client, f"{path}/proposal")["proposal"]
    own: dict[str, float] = {"kp": 300, "ki": 13, "kd": 82}
    with database.write() as session:
        row = session.get_one(CampaignRow, campaign["id"])
        assert definition_of(row).safe_gains is None
        row.vehicle.safe_gains = own
        session.flush()
        assert definition_of(row).safe_gains == read_history(session, row.id).definition.safe_gains == own
    assert get(client, f"{path}/proposal")["proposal"]["stale"]
    client.post(f"{path}/proposal")
    run_jobs(database)
    after = get(client, f"{path}/proposal")["proposal"]
    assert not after["stale"]
    assert after["history_digest"] != before["history_digest"]
    assert get(client, path)["definition"] == campaign["definition"]


def test_the_budget_ends_a_campaign_marking_a_flight_invalid_reopens_it_and_marking_it_valid_ends_it_again(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 2}})
    path = f"/api/campaigns/{campaign['id']}"
    create_flown_trial(client, database, campaign["id"], 2.0)
    last = create_flown_trial(client, database, campaign["id"], 1.0)
    done = get(client, path)
    assert (done["state"], done["outcome"]) == ("finished", "budget")
    assert done["stop_reason"] == "All 2 flights of the budget have been flown."
    assert done["actions"] == ["rename", "reopen", "archive", "clone", "judge"]
    assert get(client, f"{path}/proposal")["proposal"]["recommended"] == "stop"
    assert client.post(f"{path}/trials", json={"gains": last["gains"]}).status_code == 409
    assert classify(client, last["id"], "invalid") == 200
    run_jobs(database)
    after = get(client, path)
    assert (after["state"], after["outcome"], after["stop_reason"]) == ("deciding", None, "")
    assert get(client, f"{path}/proposal")["state"] == "ready"
    assert classify(client, last["id"], "valid") == 200
    run_jobs(database)
    again = get(client, path)
    assert (again["state"], again["outcome"], again["stop_reason"]) == ("finished", "budget", done["stop_reason"])


@pytest.mark.complete
def test_a_finished_campaign_is_reopened_for_more_flights_and_ends_after_them(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 2}})
    path = f"/api/campaigns/{campaign['id']}"
    create_flown_trial(client, database, campaign["id"], 2.0)
    create_flown_trial(client, database, campaign["id"], 1.0)
    reopened = client.post(f"{path}/reopen", json={"flights": 2}).json()
    assert (reopened["state"], reopened["outcome"], reopened["stop_reason"]) == ("deciding", None, "")
    run_jobs(database)
    told = get(client, f"{path}/proposal")["proposal"]["stop_verdict"]
    assert (told["stop"], told["sentence"]) == (False, "Reopened for 2 more flights.")
    create_flown_trial(client, database, campaign["id"], 1.1)
    assert get(client, path)["state"] == "deciding"
    create_flown_trial(client, database, campaign["id"], 1.2)
    done = get(client, path)
    assert (done["state"], done["outcome"]) == ("finished", "budget")
    assert client.post(f"{path}/trials", json={"variant": "repeat"}).status_code == 409


@pytest.mark.complete
def test_a_campaign_that_its_rule_would_end_at_once_stays_open_for_the_flights_asked_for(
    client: TestClient, database: Database
) -> None:
    rule = {"stop": {"kind": "paper", "max_flights": 9}}
    campaign = create_ready_campaign(client, database, definition=rule)
    path = f"/api/campaigns/{campaign['id']}"
    create_flown_trial(client, database, campaign["id"])
    assert (get(client, path)["outcome"], get(client, path)["standing"]) == ("converged", None)
    assert client.post(f"{path}/reopen").json()["state"] == "deciding"
    run_jobs(database)
    told = get(client, f"{path}/proposal")["proposal"]["stop_verdict"]
    assert (told["stop"], told["sentence"]) == (False, "Reopened for 3 more flights.")


@pytest.mark.parametrize(("flights", "status"), [(0, 422), (51, 422), (2.5, 422), ("3", 422)])
def test_a_campaign_is_reopened_for_one_to_fifty_flights(
    client: TestClient, database: Database, flights: float | str, status: int
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    answer = client.post(f"/api/campaigns/{campaign['id']}/reopen", json={"flights": flights})
    assert (answer.status_code, answer.json()["problems"][0]["field"]) == (status, "flights")


@pytest.mark.complete
def test_a_campaign_is_reopened_with_planned_flights_or_not_at_all(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 1}})
    path = f"/api/campaigns/{campaign['id']}"
    flown = create_flown_trial(client, database, campaign["id"])
    too_many = client.post(f"{path}/reopen", json={"flights": 1, "plan": ["repeat", "baseline"]})
    assert too_many.status_code == 422
    refused = client.post(f"{path}/reopen", json={"plan": ["repeat", "smaller step"]})
    assert refused.status_code == 409
    assert (get(client, path)["state"], get(client, path)["open_until_flight"]) == ("finished", 0)
    assert len(get(client, f"{path}/trials")["items"]) == 1
    reopened = client.post(f"{path}/reopen", json={"plan": ["repeat", "baseline", "repeat"]}).json()
    assert (reopened["state"], reopened["open_until_flight"]) == ("deciding", 4)
    planned = get(client, f"{path}/trials")["items"][1:]
    assert [trial["kind"] for trial in planned] == ["repeat", "baseline", "repeat"]
    assert all(trial["gains"] == flown["gains"] for trial in planned)


def test_a_campaign_that_is_not_finished_is_not_reopened(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    answer = client.post(f"/api/campaigns/{campaign['id']}/reopen")
    assert answer.status_code == 409
    assert "cannot be reopened: it is" in answer.json()["detail"]
    assert answer.json()["hint"].startswith("This is possible only while it is finished.")


def test_what_an_operator_stopped_stays_stopped_and_says_why_it_has_no_proposal(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    path = f"/api/campaigns/{campaign['id']}"
    flown = create_flown_trial(client, database, campaign["id"])
    client.post(f"{path}/finish", json={"reason": "rain"})
    assert classify(client, flown["id"], "invalid") == 200
    (job,) = get(client, "/api/jobs?state=queued")["items"]
    client.post(f"/api/jobs/{job['id']}/cancel")
    problem = get(client, f"{path}/proposal")["problem"]
    assert problem["detail"] == "Its computation was cancelled."
    assert "reopen" in problem["hint"].lower()
    assert client.post(f"/api/jobs/{job['id']}/retry").status_code == 200
    run_jobs(database)
    after = get(client, path)
    assert (after["outcome"], after["stop_reason"]) == ("stopped", "rain")


@pytest.mark.complete
def test_gains_of_ones_own_are_judged_without_searching_the_model_again(
    client: TestClient, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = create_ready_campaign(client, database, definition={"start": {"kind": "simplex"}})
    gains = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]["gains"]

    def searched(*_: object) -> None:
        raise AssertionError("the start gains are stored with the first proposal")

    monkeypatch.setattr("app.core.tuning.corrected_model.model_optimum", searched)
    trial = create_trial(client, campaign["id"], gains={**gains, "kp": gains["kp"] + 10})
    assert trial["gate"]["passed"]


def test_gains_of_ones_own_wait_for_the_start_gains(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    client.patch(path, json={"version": 1, "definition": {"start": {"kind": "simplex"}}})
    answer = client.post(f"{path}/trials", json={"gains": {"kp": 1600, "ki": 900, "kd": 200}})
    assert answer.status_code == 409
    assert "start gains" in answer.json()["detail"]


def sagged(volts: float, *, until_s: float = 33.0) -> FlightRecord:
    """A climb at whose end the battery has so many volts; a short one cannot be scored."""
    record = create_record(until_s=until_s)
    channels = {**record.trajectory.channels, "battery_v": np.linspace(11.1, volts, len(record.trajectory))}
    return replace(record, trajectory=replace(record.trajectory, channels=channels))


@pytest.mark.complete
def test_a_low_battery_ends_a_campaign_whatever_its_last_flight_is_worth(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(
        client, database, definition={"stop": {"kind": "budget", "max_flights": 9, "min_battery_v": 10.5}}
    )
    path = f"/api/campaigns/{campaign['id']}"
    trial = create_trial(client, campaign["id"], gains={"kp": 300, "ki": 13, "kd": 82})
    fly_trial(client, database, campaign["id"], sagged(10.8))
    run_jobs(database)
    before = get(client, f"{path}/proposal")["proposal"]
    assert before["stop_verdict"]["stop"] is False
    assert client.post(f"/api/trials/{trial['id']}/fly", json={"speed": None}).status_code == 202
    land(database, lift_off(database), sagged(10.4, until_s=10.0))
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "invalid"
    run_jobs(database)
    done = get(client, path)
    assert (done["state"], done["outcome"]) == ("finished", "budget")
    assert done["stop_reason"].startswith("The last flight ended at 10.40 V; the minimum is 10.5 V.")
    after = get(client, f"{path}/proposal")["proposal"]
    assert (after["stale"], after["gains"]) == (False, before["gains"])
    assert after["history_digest"] != before["history_digest"]


def test_a_flights_parameters_are_in_the_digest_where_the_model_depends_on_them(
    client: TestClient, database: Database
) -> None:
    campaign_id = create_campaign(client)["id"]
    stepping = Definition(experiment="altitude-steps-px4", strategy="manual")
    digests = []
    with database.write() as session:
        campaign = session.get_one(CampaignRow, campaign_id)
        flown = TrialRow(campaign_id=campaign_id, number=1, state=TrialState.VALID, kind="manual", gains={}, gate={})
        flown.seed, flown.error = 1, 0.1
        session.add(flown)
        for name, value in (("log", "none"), ("telemetry_hz", 50.0), ("MPC_THR_MIN", 0.12), ("MPC_THR_MIN", 0.1)):
            flown.settings = {name: value}
            session.flush()
            digests.append(history_digest(session, campaign, stepping, trials_of(session, campaign_id)))
        session.delete(flown)
    assert digests[0] == digests[1]
    assert len(set(digests)) == 3


def test_without_a_battery_limit_an_invalid_flight_leaves_the_proposal_as_it_is(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    path = f"/api/campaigns/{campaign['id']}/proposal"
    before = get(client, path)["proposal"]
    fly_trial(client, database, campaign["id"], sagged(10.4, until_s=10.0))
    run_jobs(database)
    assert get(client, path)["proposal"]["history_digest"] == before["history_digest"]
