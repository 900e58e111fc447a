"""Trials over HTTP: what outdates them, how many there may be, what may become of them."""

import pytest
from fastapi.testclient import TestClient

from app.common.states import TrialState
from app.db.models import TrialRow
from app.db.session import Database
from app.flights import flight_rows
from tests.builders import (
    claim,
    create_csv,
    create_flown_trial,
    create_imported_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    land,
    lift_off,
    problems_of,
    run_jobs,
    upload,
)

GAINS = {"kp": 283, "ki": 13, "kd": 82}
PATIENT = {"stop": {"kind": "budget", "max_flights": 9}}


def classify(client: TestClient, trial_id: int, outcome: str) -> int:
    version = get(client, f"/api/trials/{trial_id}")["version"]
    answer = client.post(
        f"/api/trials/{trial_id}/classify", json={"version": version, "outcome": outcome, "reason": "looked at it"}
    )
    return answer.status_code


def test_only_a_completed_flight_has_a_steady_state_until_a_person_counts_it(
    client: TestClient, database: Database
) -> None:
    """A record can go on through the landing of a flight that the program ended."""
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    record = create_record(ending="invalid", reason="The battery voltage is low.")
    ended = fly_trial(client, database, campaign["id"], record)
    measured = ("settling_time_s", "overshoot_m", "steady_state_error_m")
    assert [ended[name] for name in measured] == [None] * 3
    assert classify(client, ended["id"], "valid") == 200
    counted = get(client, f"/api/trials/{ended['id']}")
    assert None not in [counted[name] for name in measured]


def test_a_landing_outdates_what_was_planned_from_the_same_proposal(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    first, second = (create_trial(client, campaign["id"]) for _ in range(2))
    own = create_trial(client, campaign["id"], gains={"kp": 300, "ki": 13, "kd": 82})
    assert client.post(f"/api/trials/{first['id']}/fly", json={"speed": None}).status_code == 202
    land(database, lift_off(database), create_record())
    outdated = get(client, f"/api/trials/{second['id']}")
    assert (outdated["state"], outdated["actions"]) == ("cancelled", ["note"])
    assert outdated["reason"] == "its proposal is outdated: the campaign's flights have changed"
    assert client.post(f"/api/trials/{second['id']}/fly", json={"speed": None}).status_code == 409
    assert get(client, f"/api/trials/{own['id']}")["state"] == "planned"


def test_a_record_of_an_outdated_trial_is_refused(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    late = create_trial(client, campaign["id"])
    create_imported_trial(client, campaign["id"])
    answer = upload(client, late["id"], create_csv(2.0))
    assert answer.status_code == 409
    assert get(client, f"/api/trials/{late['id']}")["record"] is None


def test_a_flight_that_was_asked_for_from_an_outdated_proposal_does_not_lift_off(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    flown = create_flown_trial(client, database, campaign["id"])
    waiting = create_trial(client, campaign["id"], fly={"speed": None})
    assert classify(client, flown["id"], "invalid") == 200
    outdated = get(client, f"/api/trials/{waiting['id']}")
    assert (outdated["state"], outdated["flight"]["state"]) == ("cancelled", "cancelled")
    with pytest.raises(AssertionError):
        claim(database)


def test_a_lost_flight_outdates_nothing(client: TestClient, database: Database) -> None:
    """It is no history: the proposal still holds, and so does what was planned from it."""
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    waiting, lost = (create_trial(client, campaign["id"]) for _ in range(2))
    client.post(f"/api/trials/{lost['id']}/fly", json={"speed": None})
    lift_off(database)
    with database.write() as session:
        flight_rows.lose_running_flights(session)
    assert get(client, f"/api/trials/{lost['id']}")["state"] == "lost"
    assert get(client, f"/api/trials/{waiting['id']}")["state"] == "planned"


@pytest.mark.parametrize(("until_s", "may_be_valid"), [(20.0, False), (33.0, True)])
def test_only_a_record_that_covers_the_window_may_be_marked_valid(
    client: TestClient, database: Database, until_s: float, may_be_valid: bool
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    ended = fly_trial(
        client, database, campaign["id"], create_record(ending="invalid", reason="low battery", until_s=until_s)
    )
    assert (ended["state"], ended["may_be_valid"]) == ("invalid", may_be_valid)
    assert classify(client, ended["id"], "valid") == (200 if may_be_valid else 422)


def test_a_flight_that_was_broken_off_never_counts_as_complete(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    trial = fly_trial(client, database, campaign["id"], create_record(ending="aborted", reason="gust"))
    assert classify(client, trial["id"], "invalid") == 200
    version = get(client, f"/api/trials/{trial['id']}")["version"]
    answer = client.post(
        f"/api/trials/{trial['id']}/classify", json={"version": version, "outcome": "valid", "reason": "looks good"}
    )
    assert answer.status_code == 422
    assert problems_of(answer) == {"outcome": "cannot be valid: the flight was aborted"}
    assert not get(client, f"/api/trials/{trial['id']}")["may_be_valid"]
    assert get(client, f"/api/trials/{trial['id']}")["record"]["ending"] == "aborted"
    assert classify(client, trial["id"], "aborted") == 200


def test_an_archived_campaign_takes_no_other_word_on_its_flights(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_flown_trial(client, database, campaign["id"])
    path = f"/api/campaigns/{campaign['id']}"
    client.post(f"{path}/finish")
    assert "classify" in get(client, f"/api/trials/{trial['id']}")["actions"]
    client.post(f"{path}/archive")
    assert get(client, f"/api/trials/{trial['id']}")["actions"] == ["note"]
    assert classify(client, trial["id"], "invalid") == 409
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "valid"


def test_no_more_trials_are_planned_than_the_flight_budget_holds(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 2}})
    first, _ = (create_trial(client, campaign["id"]) for _ in range(2))
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": first["gains"]})
    assert answer.status_code == 409
    assert "2 flights" in answer.json()["detail"]
    assert "reopen" in answer.json()["hint"]
    assert client.post(f"/api/trials/{first['id']}/cancel").status_code == 200
    create_trial(client, campaign["id"], gains=first["gains"])


def test_the_flight_budget_holds_between_the_last_landing_and_its_verdict(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 2}})
    trials = [create_trial(client, campaign["id"], gains=GAINS) for _ in range(2)]
    client.post(f"/api/trials/{trials[0]['id']}/fly", json={"speed": None})
    land(database, lift_off(database), create_record(ending="aborted", reason="gust"))
    client.post(f"/api/trials/{trials[1]['id']}/fly", json={"speed": None})
    land(database, lift_off(database), create_record())
    with database.write() as session:  # a third one, planned while an invalid flight had left room for it
        planned = session.get_one(TrialRow, trials[0]["id"])
        session.add(
            TrialRow(
                campaign_id=campaign["id"],
                number=3,
                state=TrialState.PLANNED,
                gains=planned.gains,
                kind="manual",
                gate=planned.gate,
                seed=1,
            )
        )
    answer = client.post("/api/trials/3/fly", json={"speed": None})
    assert answer.status_code == 409
    assert "2 flights" in answer.json()["detail"]


def test_aborting_a_flight_that_is_over_is_harmless(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    trial = create_flown_trial(client, database, campaign["id"])
    answer = client.post(f"/api/trials/{trial['id']}/abort")
    assert (answer.status_code, answer.json()["sentence"]) == (202, "The flight has already ended.")
    planned = create_trial(client, campaign["id"])
    assert client.post(f"/api/trials/{planned['id']}/abort").status_code == 409


@pytest.mark.complete
def test_trials_come_page_by_page_with_the_best_before_each(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    for settling_s in (2.0, 1.0, 1.5):
        run_jobs(database)
        create_imported_trial(client, campaign["id"], create_csv(settling_s))
    path = f"/api/campaigns/{campaign['id']}/trials"
    first = get(client, f"{path}?limit=2")
    rest = get(client, f"{path}?limit=2&cursor={first['next_cursor']}")
    assert (first["total"], rest["total"], rest["next_cursor"]) == (3, 3, None)
    assert [trial["number"] for trial in first["items"] + rest["items"]] == [1, 2, 3]
    assert "repeating the gains of flight 2" in rest["items"][0]["verdict"]
    assert client.get(f"{path}?cursor=nonsense").status_code == 422
    assert client.get(f"{path}?limit=201").status_code == 422


def test_a_trial_shows_its_vehicle_and_the_source_of_its_record(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_flown_trial(client, database, campaign["id"])
    assert trial["settings"] == {}
    assert trial["record"]["units"] == {"altitude_m": "m"}
    assert (trial["record"]["clock"], trial["record"]["ending"]) == ("vehicle", "completed")
