"""Why a flight was broken off: a limit counts against its gains, an operator's caution only when they say so."""

from dataclasses import replace
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.db.models import TrialRow
from app.db.session import Database
from app.flights.record_spool import Spool
from app.vehicles.flight_end import FAILURE_TEXTS, Failure, FlightEnd, StopRequest
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

CALIBRATED = {"strategy": "calibrated", "stop": {"kind": "budget", "max_flights": 9}}


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    """One flight has counted, and the whole step from it is proposed."""
    return create_flown_campaign(client, database, definition=CALIBRATED)


def proposal(client: TestClient, campaign: Json) -> Json:
    found: Json = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    return found


def trust(client: TestClient, campaign: Json) -> float:
    fraction: float = proposal(client, campaign)["explanation"]["trust_fraction"]
    return fraction


def aborted(client: TestClient, database: Database, campaign: Json, *, on_request: bool) -> Json:
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    reason = "" if on_request else "A safety limit was exceeded."
    land(
        database, lift_off(database), create_record(ending="aborted", reason=reason, until_s=4.0, on_request=on_request)
    )
    run_jobs(database)
    found: Json = get(client, f"/api/trials/{trial['id']}")
    assert found["state"] == "aborted"
    return found


def judge(client: TestClient, trial: Json, cause: str, *, version: int | None = None) -> int:
    now: int = get(client, f"/api/trials/{trial['id']}")["version"]
    body = {"version": now if version is None else version, "cause": cause}
    return client.post(f"/api/trials/{trial['id']}/judge-abort", json=body).status_code


@pytest.mark.complete
def test_three_cautious_aborts_leave_the_proposal_as_it_was(
    client: TestClient, database: Database, campaign: Json
) -> None:
    before = proposal(client, campaign)
    for _ in range(3):
        trial = aborted(client, database, campaign, on_request=True)
        assert trial["abort_cause"] == "operator"
        assert {"judge abort", "classify"} <= set(trial["actions"])
    assert trust(client, campaign) == 1.0
    assert proposal(client, campaign)["gains"] == before["gains"]


@pytest.mark.complete
def test_an_abort_counts_once_its_operator_says_that_the_vehicle_behaved_badly_and_no_more_when_they_take_it_back(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=True)
    planned = create_trial(client, campaign["id"])
    free = proposal(client, campaign)
    assert judge(client, trial, "behaved badly") == 200
    assert proposal(client, campaign)["stale"]
    assert get(client, f"/api/trials/{planned['id']}")["state"] == "cancelled"
    run_jobs(database)
    assert trust(client, campaign) == 0.5
    assert judge(client, trial, "something else") == 200
    run_jobs(database)
    assert proposal(client, campaign)["gains"] == free["gains"]
    assert get(client, f"/api/trials/{trial['id']}")["abort_cause"] == "something else"


def test_saying_that_it_was_something_else_changes_no_proposal(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=True)
    assert judge(client, trial, "something else") == 200
    assert not proposal(client, campaign)["stale"]


@pytest.mark.parametrize(
    ("request_", "cause"),
    [(None, "limit"), (StopRequest(FAILURE_TEXTS[Failure.ENVELOPE]), "operator")],
    ids=["limit", "operator"],
)
def test_who_ended_a_flight_follows_from_no_words(
    client: TestClient, database: Database, campaign: Json, request_: StopRequest | None, cause: str
) -> None:
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    end = FlightEnd(failure=Failure.ENVELOPE if request_ is None else Failure.OPERATOR, request=request_)
    record = create_record(ending="aborted", until_s=4.0)
    land(database, lift_off(database), replace(record, end=end))
    found = get(client, f"/api/trials/{trial['id']}")
    assert (found["abort_cause"], found["reason"]) == (cause, FAILURE_TEXTS[Failure.ENVELOPE])


def test_an_abort_at_a_limit_always_counts_against_the_gains(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=False)
    assert trial["abort_cause"] == "limit"
    assert "judge abort" not in trial["actions"]
    assert judge(client, trial, "something else") == 409
    assert trust(client, campaign) == 0.5


@pytest.mark.complete
def test_a_campaign_whose_start_gains_a_limit_aborted_twice_stops_and_says_what_to_do(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=CALIBRATED)
    aborted(client, database, campaign, on_request=False)
    offered = proposal(client, campaign)
    assert (offered["kind"], offered["recommended"], offered["stop_verdict"]["stop"]) == ("start", "stop", False)
    assert offered["advice"]["why"].startswith("Flight 1 was aborted because of the vehicle's behaviour")
    assert "tune attitude first" in offered["advice"]["why"]
    assert [(one["kind"], one["recommended"]) for one in offered["choices"]] == [("baseline", False)]
    aborted(client, database, campaign, on_request=False)
    ended = get(client, f"/api/campaigns/{campaign['id']}")
    assert (ended["state"], ended["outcome"]) == ("finished", "stopped")
    assert ended["stop_reason"].startswith("Flights 1, 2 were aborted because of the vehicle's behaviour")


def test_two_operators_do_not_overwrite_each_others_word(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=True)
    assert judge(client, trial, "behaved badly", version=trial["version"]) == 200
    assert judge(client, trial, "something else", version=trial["version"]) == 409


@pytest.mark.complete
def test_a_flight_that_was_not_aborted_has_no_cause(client: TestClient, database: Database, campaign: Json) -> None:
    flown = create_flown_trial(client, database, campaign["id"])
    assert flown["abort_cause"] is None
    assert judge(client, flown, "behaved badly") == 409


@pytest.mark.complete
def test_an_abort_from_before_its_cause_was_recorded_counts_until_its_operator_says_otherwise(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=False)
    digest = proposal(client, campaign)["history_digest"]
    with database.write() as session:
        session.get_one(TrialRow, trial["id"]).abort_cause = None
    found = get(client, f"/api/trials/{trial['id']}")
    assert (found["abort_cause"], "judge abort" in found["actions"]) == (None, True)
    assert (proposal(client, campaign)["history_digest"], proposal(client, campaign)["stale"]) == (digest, False)
    assert judge(client, trial, "something else") == 200
    run_jobs(database)
    assert trust(client, campaign) == 1.0


def test_the_texts_of_an_abort_name_it_once_and_tell_whether_it_counts(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=True)
    assert trial["verdict"] == "Aborted by the operator"
    said = aborted(client, database, campaign, on_request=False)["verdict"]
    assert said == "Aborted: A safety limit was exceeded."
    path = f"/api/campaigns/{campaign['id']}/report.html"
    report = client.get(path).text
    told = "by the operator (No cause was given. It does not count against the gains.)"
    assert f'<td class="text">Aborted</td><td class="text">{told}' in report
    assert "Vehicle problem" not in report
    assert judge(client, trial, "behaved badly") == 200
    assert "Cause given by the operator: vehicle behaviour. It counts against the gains." in client.get(path).text


@pytest.mark.complete
def test_the_texts_of_an_aborted_flight_that_is_marked_invalid_still_name_the_abort(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = aborted(client, database, campaign, on_request=True)
    judged = {"version": trial["version"], "outcome": "invalid", "reason": "gust"}
    assert client.post(f"/api/trials/{trial['id']}/classify", json=judged).status_code == 200
    report = client.get(f"/api/campaigns/{campaign['id']}/report.html").text
    assert '<td class="text">Not counted</td><td class="text">gust</td>' in report
    assert '<td class="text">Aborted</td><td class="text">by the operator</td>' in report


def test_a_record_that_waits_on_the_disk_keeps_why_it_was_broken_off(tmp_path: Path) -> None:
    spool = Spool(tmp_path)
    spool.reserve(1)
    spool.write(1, create_record(ending="aborted", reason="enough", on_request=True))
    assert spool.read(1).end == FlightEnd(failure=Failure.OPERATOR, request=StopRequest("enough"))
