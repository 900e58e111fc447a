"""Campaigns over HTTP: created, defined, listed, finished; what is refused, and that refusals change nothing."""

import pytest
from fastapi.testclient import TestClient

from app.campaigns.schemas import Definition
from app.db.models import CampaignRow, ProposalRow, TrajectoryRow
from app.db.session import Database
from tests.builders import (
    claim,
    climb_error,
    create_campaign,
    create_flown_trial,
    create_ready_campaign,
    create_trial,
    get,
    problems_of,
    run_jobs,
)

BUDGET = {"stop": {"kind": "budget", "max_flights": 2}}


def test_a_campaign_needs_nothing_but_a_name(client: TestClient) -> None:
    answer = client.post("/api/campaigns", json={"name": "  Mine "})
    assert answer.status_code == 201
    campaign = answer.json()
    assert (campaign["name"], campaign["state"], campaign["version"]) == ("Mine", "draft", 1)
    assert (campaign["vehicle"]["kind"], campaign["definition"]["strategy"]) == ("jsbsim", "calibrated")
    assert campaign["definition"]["stop"] == {
        "kind": "noise",
        "max_flights": 7,
        "improvement": 0.05,
        "confidence": 0.9,
        "min_battery_v": None,
    }
    assert campaign["next_action"] == "Wait for the first gains"


def test_a_draft_becomes_ready_when_its_first_gains_are_known(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)
    path = f"/api/campaigns/{campaign['id']}"
    assert get(client, f"{path}/proposal") == {"state": "computing", "proposal": None, "problem": None}
    assert client.post(f"{path}/trials", json={"gains": {"kp": 283, "ki": 13, "kd": 82}}).status_code == 409
    run_jobs(database)
    found = get(client, f"{path}/proposal")
    assert (found["state"], found["proposal"]["kind"], found["proposal"]["recommended"]) == (
        "ready",
        "start",
        "baseline",
    )
    assert found["proposal"]["gains"] == {"kp": 283, "ki": 13, "kd": 82}
    assert found["proposal"]["gate"]["passed"]
    assert get(client, path)["state"] == "ready"


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"name": ""}, "name"),
        ({"name": "   "}, "name"),
        ({"name": "x" * 121}, "name"),
        ({}, "name"),
        ({"name": "a", "nmae": "b"}, "nmae"),
        ({"name": "a", "vehicle": {"kind": "zeppelin"}}, "vehicle.kind"),
        ({"name": "a", "vehicle": {"kind": "twin", "options": {"scatter": -1}}}, "vehicle.options.scatter"),
        ({"name": "a", "vehicle": {"kind": "twin", "options": {"colour": "red"}}}, "vehicle.options.colour"),
        ({"name": "a", "definition": {"experiment": "landing"}}, "definition.experiment"),
        ({"name": "a", "definition": {"strategy": "guessing"}}, "definition.strategy"),
        ({"name": "a", "definition": {"options": {"speed": 3}}}, "definition.options.speed"),
        ({"name": "a", "definition": {"start": {"kind": "given"}}}, "definition.start.gains"),
        ({"name": "a", "definition": {"start": {"kind": "given", "gains": {"kp": 1}}}}, "definition.start.gains.ki"),
        ({"name": "a", "definition": {"bounds": {"kp": [0, 9999]}}}, "definition.bounds.kp"),
        ({"name": "a", "definition": {"bounds": {"kp": [9, 1]}}}, "definition.bounds.kp"),
        ({"name": "a", "definition": {"stop": {"max_flights": 0}}}, "definition.stop.max_flights"),
        ({"name": "a", "definition": {"stop": {"max_flights": 201}}}, "definition.stop.max_flights"),
        ({"name": "a", "definition": {"stop": {"improvement": 0.6}}}, "definition.stop.improvement"),
        ({"name": "a", "definition": {"first_step_fraction": 0}}, "definition.first_step_fraction"),
        ({"name": "a", "definition": {"step_fraction": 1.5}}, "definition.step_fraction"),
        ({"name": "a", "definition": {"seed": -1}}, "definition.seed"),
        ({"name": "a", "definition": {"seed": "1"}}, "definition.seed"),
    ],
)
def test_a_campaign_that_cannot_be_used_is_refused_by_field(
    client: TestClient, database: Database, body: object, field: str
) -> None:
    answer = client.post("/api/campaigns", json=body)
    assert answer.status_code == 422
    assert answer.headers["content-type"] == "application/problem+json"
    assert field in problems_of(answer)
    assert answer.json()["hint"]
    with database.read() as session:
        assert session.query(CampaignRow).count() == 0


def test_everything_wrong_is_named_at_once(client: TestClient) -> None:
    answer = client.post(
        "/api/campaigns",
        json={
            "name": "a",
            "vehicle": {"kind": "twin", "options": {"colour": "red"}},
            "definition": {
                "strategy": "guessing",
                "bounds": {"kq": [0, 1]},
                "start": {"kind": "given", "gains": {"kp": -1, "ki": 13, "kd": 82}},
                "stop": {"max_flights": 0, "confidence": 1},
                "ceiling_m": 1,
            },
        },
    )
    assert set(problems_of(answer)) == {
        "vehicle.options.colour",
        "definition.strategy",
        "definition.bounds.kq",
        "definition.start.gains.kp",
        "definition.stop.max_flights",
        "definition.stop.confidence",
        "definition.ceiling_m",
    }


@pytest.mark.complete
def test_a_campaign_can_be_renamed_and_redefined_before_its_first_flight(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    planned = create_trial(client, campaign["id"])
    edited = client.patch(
        path,
        json={
            "version": 1,
            "name": "Better",
            "vehicle": {"kind": "jsbsim"},
            "definition": {"start": {"kind": "given", "gains": {"kp": 500, "ki": 20, "kd": 90}}},
        },
    )
    assert edited.status_code == 200
    after = edited.json()
    assert (after["version"], after["name"], after["vehicle"]["kind"]) == (2, "Better", "jsbsim")
    assert get(client, f"/api/trials/{planned['id']}")["state"] == "cancelled"
    stale = get(client, f"{path}/proposal")
    assert (stale["state"], stale["proposal"]["stale"]) == ("computing", True)
    run_jobs(database)
    assert get(client, f"{path}/proposal")["proposal"]["gains"] == {"kp": 500, "ki": 20, "kd": 90}


def test_two_people_editing_one_campaign_get_a_conflict_that_says_what_changed(client: TestClient) -> None:
    path = f"/api/campaigns/{create_campaign(client)['id']}"
    assert client.patch(path, json={"version": 1, "name": "Anna's"}).status_code == 200
    answer = client.patch(path, json={"version": 1, "name": "Ben's"})
    assert answer.status_code == 409
    assert problems_of(answer) == {"version": "is 2, got 1", "name": "is now “Anna's”; you entered “Ben's”"}
    assert get(client, path)["name"] == "Anna's"


def test_what_is_asked_for_cannot_change_while_a_flight_is_asked_for(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    create_trial(client, campaign["id"], fly={"speed": None})
    assert get(client, path)["actions"] == ["rename", "propose", "clone", "judge"]
    for answer in (
        client.patch(path, json={"version": 1, "definition": {"seed": 2}}),
        client.delete(f"{path}?version=1"),
    ):
        assert answer.status_code == 409
        assert "of this campaign is in progress" in answer.json()["detail"]
    assert client.patch(path, json={"version": 1, "name": "Still possible"}).status_code == 200
    claim(database)


@pytest.mark.complete
def test_a_campaign_is_deleted_with_everything_that_it_made(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    create_trial(client, campaign["id"])
    create_trial(client, campaign["id"], gains={"kp": 350, "ki": 30, "kd": 90})
    assert client.delete(f"/api/campaigns/{campaign['id']}?version=1").status_code == 204
    assert client.get(f"/api/campaigns/{campaign['id']}").status_code == 404
    with database.read() as session:
        assert [session.query(table).count() for table in (CampaignRow, ProposalRow, TrajectoryRow)] == [0, 0, 0]


def test_a_campaign_with_flights_is_never_deleted(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    create_flown_trial(client, database, campaign["id"])
    assert client.delete(f"/api/campaigns/{campaign['id']}?version=1").status_code == 409


@pytest.mark.complete
def test_a_campaign_can_be_stopped_archived_and_continued_as_a_clone(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=BUDGET)
    path = f"/api/campaigns/{campaign['id']}"
    assert client.post(f"{path}/finish").status_code == 409  # nothing has flown: delete it instead
    flown = create_flown_trial(client, database, campaign["id"])
    waiting = create_trial(client, campaign["id"], gains=flown["gains"])
    assert waiting["kind"] == "repeat"
    assert client.post(f"{path}/archive").status_code == 409
    stopped = client.post(f"{path}/finish", json={"reason": "rain"}).json()
    assert (stopped["state"], stopped["outcome"], stopped["stop_reason"]) == ("finished", "stopped", "rain")
    assert get(client, f"/api/trials/{waiting['id']}")["state"] == "cancelled"
    assert client.post(f"{path}/archive").json()["state"] == "archived"
    clone = client.post(f"{path}/clone", json={"vehicle": {"kind": "jsbsim"}})
    assert clone.status_code == 201
    assert (clone.json()["parent_id"], clone.json()["name"]) == (campaign["id"], "Test (2)")
    assert clone.json()["definition"] == campaign["definition"]
    assert clone.json()["vehicle"]["kind"] == "jsbsim"
    assert clone.json()["definition_digest"] is None
    again = [client.post(f"/api/campaigns/{origin}/clone", json={}) for origin in (campaign["id"], clone.json()["id"])]
    assert [one.json()["name"] for one in again] == ["Test (3)", "Test (4)"]


@pytest.mark.complete
def test_reclassing_a_flight_recomputes_what_came_after(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 9}})
    path = f"/api/campaigns/{campaign['id']}"
    create_flown_trial(client, database, campaign["id"], 2.0)
    good = create_flown_trial(client, database, campaign["id"], 1.0)
    before = get(client, f"{path}/proposal")["proposal"]
    assert get(client, path)["best"]["trial_id"] == good["id"]
    said = client.post(
        f"/api/trials/{good['id']}/classify",
        json={"version": good["version"], "outcome": "invalid", "reason": "the tether pulled it up"},
    )
    assert (said.json()["state"], said.json()["verdict"]) == ("invalid", "Does not count: the tether pulled it up")
    assert get(client, path)["best"]["error"] == pytest.approx(climb_error(2.0), rel=1e-4)
    assert get(client, f"{path}/proposal")["state"] == "computing"
    refused = client.post(f"{path}/trials", json={"proposal_id": before["id"]})
    assert refused.status_code == 409
    assert "out of date" in refused.json()["detail"]
    run_jobs(database)
    after = get(client, f"{path}/proposal")["proposal"]
    assert after["history_digest"] != before["history_digest"]
    back = client.post(
        f"/api/trials/{good['id']}/classify",
        json={"version": good["version"] + 1, "outcome": "valid", "reason": "it was slack after all"},
    )
    assert back.json()["error"] == good["error"]
    run_jobs(database)
    again = get(client, f"{path}/proposal")["proposal"]
    assert (again["history_digest"], again["gains"], again["predicted_error"]) == (
        before["history_digest"],
        before["gains"],
        before["predicted_error"],
    )


def test_an_imported_campaign_cannot_be_flown_from_here(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import")
    assert campaign["next_action"] == "Upload the record of the first flight"
    trial = create_trial(client, campaign["id"])
    assert trial["actions"] == ["cancel", "upload", "note"]
    answer = client.post(f"/api/trials/{trial['id']}/fly")
    assert answer.status_code == 409
    assert "upload the flight record" in answer.json()["hint"]


@pytest.mark.parametrize(
    ("experiment", "strategy"),
    [("takeoff", "calibrated"), ("pitch-tracking", "gradient"), ("takeoff-px4", "manual"), ("landing", "calibrated")],
)
def test_a_definition_without_a_strategy_has_the_first_of_the_catalogue_for_its_experiment(
    client: TestClient, experiment: str, strategy: str
) -> None:
    assert Definition(experiment=experiment).strategy == strategy
    listed = get(client, "/api/catalogue")["strategies"]
    fitting = [each["name"] for each in listed if experiment in each["experiments"]]
    assert fitting[:1] in ([strategy], [])
