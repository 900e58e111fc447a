"""The best gains of a campaign become its vehicle's safe ones, once flights have shown that they are better."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import (
    Json,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    fly_trial,
    get,
    problems_of,
)
from tests.fleet.vehicles import DEFAULT_GAINS, control_header, create_campaign_on, create_connected, seen

SAID = {"version": 1, "statement": "Ada looked at the flights"}


def promote(client: TestClient, campaign: Json, headers: dict[str, str] | None = None, **fields: object) -> Json:
    answer = client.post(f"/api/campaigns/{campaign['id']}/promote", json={**SAID, **fields}, headers=headers)
    found: Json = {"status": answer.status_code, **answer.json()}
    return found


def test_gains_that_flew_better_become_the_safe_ones_and_the_act_says_from_which_flights(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    campaign = create_campaign_on(client, database, vehicle)
    assert "shown to be better" in promote(client, campaign)["detail"]
    create_flown_trial(client, database, campaign["id"], 3.0)
    best = create_flown_trial(client, database, campaign["id"], 1.0)
    assert get(client, f"/api/campaigns/{campaign['id']}/statistics")["comparison"]["verdict"] == "better"

    header = control_header(client, vehicle)
    assert promote(client, campaign)["detail"] == "Ada is in control of Drone."
    promoted = promote(client, campaign, header)
    assert (promoted["status"], promoted["safe_gains"], promoted["version"]) == (200, best["gains"], 2)
    act = get(client, f"/api/vehicles/{vehicle['id']}/acts")["items"][0]
    assert (act["kind"], act["asked"], act["by"]) == ("safe gains", best["gains"], "Ada")
    assert act["reason"].startswith(
        "Ada looked at the flights (campaign 1, flight 2: better, more than 99.9\u00a0% confidence"
    )
    assert promote(client, campaign, header)["status"] == 409  # the vehicle's version is 2 now


@pytest.mark.complete
def test_gains_that_are_not_shown_to_be_better_stay_what_they_are(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    patient = {"stop": {"kind": "budget", "max_flights": 4}}
    campaign = create_campaign_on(client, database, vehicle, definition=patient)
    create_flown_trial(client, database, campaign["id"], 1.0)
    fly_trial(client, database, campaign["id"], create_record(0.99), gains={"kp": 250, "ki": 13, "kd": 90})
    refused = promote(client, campaign)
    assert refused["status"] == 409
    assert "with the first gains is unresolved" in refused["detail"]
    assert seen(client, vehicle)["safe_gains"] == DEFAULT_GAINS


@pytest.mark.complete
def test_a_shared_simulation_keeps_its_safe_gains(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    for settling_s in (3.0, 1.0):
        create_flown_trial(client, database, campaign["id"], settling_s)
    assert "is shared by all campaigns" in promote(client, campaign)["detail"]


def test_a_promotion_names_who_decided_it(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    refused = client.post(f"/api/campaigns/{campaign['id']}/promote", json={"version": 1})
    assert (refused.status_code, set(problems_of(refused))) == (422, {"statement"})
