"""A flight's way through the database, and what it does to its trial, its campaign and its vehicle."""

from dataclasses import replace

import pytest
from fastapi.testclient import TestClient

from app.common.errors import ConflictError
from app.core.definition import flight_seed
from app.db.base import FLIGHT_END
from app.db.session import Database
from app.flights import flight_rows
from app.flights.flight_rows import FlightOutcome
from app.vehicles.base import FlightRecord
from app.vehicles.flight_end import Failure, FlightEnd, GainsLeft, Landing, Requester, StopRequest, end_text
from tests.builders import (
    claim,
    climb_error,
    create_climb,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    land,
    lift_off,
    run_jobs,
    stage,
)
from tests.campaigns.trials.states import make_vehicle_real

DEFAULT_GAINS = {"kp": 283, "ki": 13, "kd": 82}


def test_a_claimed_flight_carries_everything_that_the_worker_needs(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"seed": 7})
    trial = create_trial(client, campaign["id"], fly={"speed": 10})
    task = claim(database)
    assert (task.trial_id, task.campaign_id, task.experiment) == (trial["id"], campaign["id"], "takeoff")
    assert task.gains == task.safe_gains == DEFAULT_GAINS
    assert (task.vehicle_kind, task.vehicle_options["scatter"], task.speed) == ("twin", 1.0, 10.0)
    assert task.seed == flight_seed(7, 1)
    with database.write() as session:
        assert flight_rows.claim_flight(session, "another") is None


def test_a_landed_flight_is_scored_as_it_is_stored_and_classed_by_the_program(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    trial = fly_trial(client, database, campaign["id"], create_record(1.0))
    assert (trial["state"], trial["read_back"]) == ("valid", DEFAULT_GAINS)
    # 50 Hz trapezoids of an exponential: (dt/τ)²/12 = 3e-5 of the value; single precision adds less.
    assert trial["error"] == pytest.approx(climb_error(1.0), rel=1e-4)
    assert trial["overshoot_m"] == 0.0
    assert trial["record"]["samples"] == 1651
    assert trial["verdict"] == "0.092 m: the first valid flight."
    after = get(client, f"/api/campaigns/{campaign['id']}")
    assert (after["state"], after["best"]["trial_id"], after["flying"]) == ("deciding", trial["id"], None)


def test_the_definition_is_frozen_with_its_digest_at_lift_off(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    create_trial(client, campaign["id"], fly={"speed": None})
    task = stage(database)
    assert get(client, f"/api/campaigns/{campaign['id']}")["definition_digest"] is None
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
    flying = get(client, f"/api/campaigns/{campaign['id']}")
    assert flying["state"] == "flying"
    assert len(flying["definition_digest"]) == 64
    assert flying["flying"] == {"trial_id": 1, "trial_number": 1}
    land(database, task, create_record())
    answer = client.patch(f"/api/campaigns/{campaign['id']}", json={"version": 1, "definition": {"seed": 2}})
    assert answer.status_code == 409


def test_a_vehicle_that_took_other_gains_does_not_fly(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    task = claim(database)
    with database.write() as session:
        flight_rows.record_staged(session, task.flight_id, {"kp": 282, "ki": 13, "kd": 82})
    with pytest.raises(ConflictError, match="cannot be flown"), database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
    with database.write() as session:
        flight_rows.record_outcome(session, task.flight_id, FlightOutcome(problem="the vehicle did not take the gains"))
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["flight"]["state"]) == ("planned", "failed")
    assert after["flight"]["problem"] == "the vehicle did not take the gains"
    assert "fly" in after["actions"]
    ledger = get(client, f"/api/vehicles/{campaign['vehicle']['id']}/ledger")["items"]
    assert (ledger[0]["asked"], ledger[0]["read_back"]) == (DEFAULT_GAINS, {"kp": 282, "ki": 13, "kd": 82})


def test_an_aborted_flight_keeps_its_record_and_is_history_without_an_error(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    after = fly_trial(
        client, database, campaign["id"], create_record(ending="aborted", reason="too close to the wall", until_s=4.0)
    )
    assert (after["state"], after["error"], after["reason"]) == ("aborted", None, "too close to the wall")
    assert after["record"]["duration_s"] == pytest.approx(4.0)
    assert run_jobs(database) == 1
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]["kind"] == "start"


ON_GROUND = FlightEnd(failure=Failure.OPERATOR, landed=Landing.STAYED)
BEFORE_LIFT_OFF = [
    (replace(ON_GROUND, request=StopRequest()), "cancelled"),
    (replace(ON_GROUND, request=StopRequest("somebody walked in")), "cancelled"),
    (replace(ON_GROUND, failure=Failure.BATTERY, remarks=("The battery voltage was low: 9.0 V.",)), "failed"),
    (replace(ON_GROUND, request=StopRequest(by=Requester.PROGRAM_STOPPED)), "cancelled"),
]


@pytest.mark.parametrize(("end", "state"), BEFORE_LIFT_OFF)
def test_a_trial_whose_vehicle_never_left_the_ground_is_planned_again(
    client: TestClient, database: Database, end: FlightEnd, state: str
) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    record = FlightRecord(trajectory=create_climb(until_s=0.0), ending="aborted", end=end)
    task = lift_off(database)
    with database.write() as session:
        outcome = replace(flight_rows.outcome_of(record), restored=DEFAULT_GAINS)
        flight_rows.record_outcome(session, task.flight_id, outcome)
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["flown_at"], after["record"], after["abort_cause"]) == ("planned", None, None, None)
    assert after["reason"] == after["flight"]["problem"]
    expected = replace(end, gains_left=GainsLeft.SAFE)
    assert (FLIGHT_END.validate_python(after["end"]), after["reason"]) == (expected, end_text(expected))
    assert (after["flight"]["state"], after["flight"]["safe_gains_restored"]) == (state, True)
    assert "fly" in after["actions"]
    [summary] = get(client, "/api/campaigns")["items"]
    assert summary["flights"] == 0
    assert get(client, f"/api/vehicles/{campaign['vehicle']['id']}")["state"] == "ready"


def test_a_record_of_a_flight_is_its_outcome() -> None:
    record = create_record(ending="aborted", on_request=True, until_s=4.0)
    assert flight_rows.outcome_of(record) == FlightOutcome(record=record, lifted_off=True)


def test_a_worker_that_died_leaves_a_lost_flight_that_is_not_flown_again(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    lift_off(database)
    with database.write() as session:
        assert flight_rows.lose_running_flights(session) == [trial["id"]]
        assert flight_rows.claim_flight(session, "the next worker") is None
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["flight"]["state"]) == ("lost", "lost")
    assert "fly" not in after["actions"]
    assert get(client, f"/api/campaigns/{campaign['id']}")["state"] == "deciding"
    assert get(client, f"/api/vehicles/{campaign['vehicle']['id']}")["state"] == "ready"


def test_the_record_of_a_lost_flight_can_be_recovered_once(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    task = lift_off(database)
    with database.write() as session:
        flight_rows.lose_running_flights(session)
    for _ in range(2):
        with database.write() as session:
            flight_rows.recover_record(session, task.flight_id, create_record(2.0))
    after = get(client, f"/api/trials/{trial['id']}")
    assert after["state"] == "valid"
    assert after["error"] == pytest.approx(climb_error(2.0), rel=1e-4)


def test_a_landing_reported_twice_counts_once(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    create_trial(client, campaign["id"], fly={"speed": None})
    task = lift_off(database)
    for settling_s in (1.0, 2.0):
        land(database, task, create_record(settling_s))
    assert get(client, "/api/trials/1")["error"] == pytest.approx(climb_error(1.0), rel=1e-4)


def test_a_flight_of_a_real_vehicle_waits_for_a_person_and_blocks_the_next(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    make_vehicle_real(database)
    trial = create_flown_trial(client, database, campaign["id"])
    assert trial["state"] == "captured"
    assert trial["error"] == pytest.approx(climb_error(1.0), rel=1e-4)
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")
    assert proposal["state"] == "none"
    assert proposal["problem"]["title"] == "Flight 1 needs a review."
    assert get(client, f"/api/campaigns/{campaign['id']}")["next_action"] == "Review flight 1"
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": DEFAULT_GAINS})
    assert (answer.status_code, answer.json()["detail"]) == (409, "Flight 1 needs a review.")
    said = client.post(
        f"/api/trials/{trial['id']}/classify", json={"version": 1, "outcome": "valid", "reason": "a clean flight"}
    )
    assert said.json()["error"] == pytest.approx(climb_error(1.0), rel=1e-4)
    run_jobs(database)
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["state"] == "ready"


def test_a_real_vehicle_whose_flight_was_lost_is_quarantined_until_a_person_releases_it(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    make_vehicle_real(database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    lift_off(database)
    with database.write() as session:
        flight_rows.lose_running_flights(session)
    vehicle = f"/api/vehicles/{campaign['vehicle']['id']}"
    assert get(client, vehicle)["state"] == "quarantined"
    client.post(f"/api/trials/{trial['id']}/classify", json={"version": 1, "outcome": "invalid", "reason": "crashed"})
    refused = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": DEFAULT_GAINS, "fly": {}})
    assert refused.status_code == 409
    assert "quarantined" in refused.json()["detail"]
    assert client.post(f"{vehicle}/release", json={"statement": "safe gains read back by hand"}).status_code == 200
    assert (
        client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": DEFAULT_GAINS, "fly": {}}).status_code
        == 201
    )


def test_unverified_safe_gains_quarantine_even_a_vehicle_that_landed(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    create_trial(client, campaign["id"], fly={"speed": None})
    task = lift_off(database)
    land(database, task, create_record())
    with database.write() as session:
        outcome = FlightOutcome(record=create_record(), concern="the safe gains did not read back")
        flight_rows.record_outcome(session, task.flight_id, outcome)
    vehicle = get(client, f"/api/vehicles/{campaign['vehicle']['id']}")
    assert (vehicle["state"], vehicle["concern"]) == ("quarantined", "the safe gains did not read back")


def test_one_vehicle_has_one_flight_whoever_asks(client: TestClient, database: Database) -> None:
    first, second = (create_ready_campaign(client, database)["id"] for _ in range(2))
    create_trial(client, first, fly={"speed": None})
    refused = client.post(f"/api/campaigns/{second}/trials", json={"gains": DEFAULT_GAINS, "fly": {}})
    assert (refused.status_code, refused.json()["title"]) == (409, "Vehicle busy")
    assert f"flight 1 of campaign {first}" in refused.json()["detail"]
    assert get(client, f"/api/campaigns/{second}/trials")["items"] == []  # the trial was not planned either
    land(database, lift_off(database), create_record())
    create_trial(client, second, fly={"speed": None})


def test_a_flight_that_no_worker_has_begun_can_be_aborted(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    answer = client.post(f"/api/trials/{trial['id']}/abort")
    assert (answer.status_code, answer.json()["accepted"]) == (202, True)
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["flight"]["state"]) == ("planned", "cancelled")
    again = client.post(f"/api/trials/{trial['id']}/abort")
    assert (again.status_code, again.json()["accepted"]) == (202, True)


def test_an_abort_that_reaches_no_worker_is_reported(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    lift_off(database)
    answer = client.post(f"/api/trials/{trial['id']}/abort")
    assert answer.status_code == 409
    assert "remote control" in answer.json()["hint"]


def test_a_trial_cancelled_while_it_is_staged_does_not_lift_off(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    task = stage(database)
    assert client.post(f"/api/trials/{trial['id']}/cancel").status_code == 200
    with pytest.raises(ConflictError), database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
    with database.write() as session:
        flight_rows.record_outcome(session, task.flight_id, FlightOutcome(problem="cancelled"))
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "cancelled"
    assert get(client, f"/api/vehicles/{campaign['vehicle']['id']}")["state"] == "ready"
