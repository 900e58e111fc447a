"""The gate over HTTP: what it refuses, who overrules it; and what a glitch does to the class of a flight."""

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.autopilots.registry import get_experiment
from app.campaigns import computation, proposals
from app.core.experiments.base import prior_distribution
from app.core.records.trajectory import Trajectory
from app.db.models import CampaignRow, ProposalRow, VehicleRow
from app.db.session import Database
from app.vehicles.base import FlightRecord
from tests.builders import (
    Json,
    climb_error,
    create_climb,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    csv_of,
    fly_trial,
    get,
    land,
    lift_off,
    problems_of,
    run_jobs,
    upload,
)
from tests.fleet.vehicles import create_campaign_on, create_connected

OPEN = {"first_step_fraction": 1.0, "stop": {"kind": "budget", "max_flights": 9}}
PAPERS = {"kp": 1624, "ki": 1356, "kd": 195}
GROWING = {"kp": 1500, "ki": 1000, "kd": 40}
REASON = "the paper flew it"


def ask(client: TestClient, campaign: Json, **fields: object) -> tuple[int, Json]:
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json=fields)
    return answer.status_code, answer.json()


@pytest.mark.complete
def test_the_papers_ki_is_refused_with_the_case_that_wraps_and_the_largest_that_cannot(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": PAPERS})
    assert answer.status_code == 422
    wrapping = [problem for problem in answer.json()["problems"] if "overflow" in problem["reason"]]
    assert [(problem["field"], problem["offer"]) for problem in wrapping] == [("gains.ki", {"ki": 1073})]
    assert "Simulated stuck on the ground, 5.25 s after the start" in wrapping[0]["reason"]
    assert "ki = 1073" in answer.json()["hint"]
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["total"] == 0


@pytest.mark.complete
def test_on_a_simulated_vehicle_the_gate_is_overruled_with_a_reason_that_the_flight_keeps(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    planned = create_trial(client, campaign["id"], gains=PAPERS, overrule=REASON)
    assert (planned["overrule_reason"], planned["gate"]["passed"]) == (REASON, False)
    assert client.post(f"/api/trials/{planned['id']}/fly", json={"speed": None}).status_code == 202
    land(database, lift_off(database), create_record())
    run_jobs(database)
    flown = get(client, f"/api/trials/{planned['id']}")
    assert (flown["state"], flown["gains"], flown["overrule_reason"]) == ("valid", PAPERS, REASON)
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["state"] == "ready"


def test_a_proposal_that_the_gate_refuses_flies_with_a_reason_only(client: TestClient, database: Database) -> None:
    given = {**OPEN, "start": {"kind": "given", "gains": GROWING}}
    campaign = create_ready_campaign(client, database, definition=given)
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    assert [check["name"] for check in proposal["gate"]["checks"] if not check["passed"]][:2] == [
        "altitude",
        "divergence",
    ]
    status, refused = ask(client, campaign, proposal_id=proposal["id"])
    assert status == 422
    assert "hover throttle 0." in refused["problems"][0]["reason"]
    assert {problem["field"] for problem in refused["problems"]} == {"gains"}
    status, planned = ask(client, campaign, proposal_id=proposal["id"], overrule=REASON)
    assert (status, planned["overrule_reason"]) == (201, REASON)


@pytest.mark.complete
def test_gains_that_the_vehicle_would_not_be_given_are_refused_whoever_overrules(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    campaign = create_campaign_on(client, database, vehicle, definition=OPEN)
    status, refused = ask(client, campaign, gains={"kp": 300, "ki": 13, "kd": 900}, overrule=REASON)
    assert (status, refused["detail"]) == (422, "These gains may not be written to the vehicle.")
    assert [(each["field"], each["reason"]) for each in refused["problems"]] == [
        ("gains.kd", "must be between 0 and 800, got 900")
    ]


def test_a_reason_that_nothing_needs_is_not_kept(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    planned = create_trial(client, campaign["id"], gains={"kp": 300, "ki": 13, "kd": 82}, overrule=REASON)
    assert (planned["overrule_reason"], planned["gate"]["passed"]) == ("", True)


@pytest.mark.parametrize(
    ("gains", "field", "reason"),
    [
        (PAPERS | {"kd": 82.5}, "gains.kd", "must be a whole number of counts, got 82.5"),
        (PAPERS | {"kp": 2**31}, "gains.kp", "must fit in 32 bits, got 2147483648"),
    ],
)
def test_numbers_that_the_controller_cannot_hold_are_never_overruled(
    client: TestClient, database: Database, gains: dict[str, float], field: str, reason: str
) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": gains, "overrule": REASON})
    assert answer.status_code == 422
    assert problems_of(answer)[field].startswith(reason)


def test_nobody_overrules_the_gate_on_a_real_vehicle(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    with database.write() as session:
        session.get_one(VehicleRow, campaign["vehicle"]["id"]).is_real = True
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"gains": PAPERS, "overrule": REASON})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("The gate cannot be overruled on a real vehicle.")
    assert problems_of(answer) == {"overrule": "is only for simulated vehicles"}


@pytest.mark.complete
def test_own_gains_are_judged_over_what_the_flights_have_shown(client: TestClient, database: Database) -> None:
    """Before any proposal, the data sheet; then the distribution stored with the latest proposal, which earlier
    releases stored not at all, or without the flights that showed it."""
    campaign = create_ready_campaign(client, database, definition=OPEN)
    experiment = get_experiment("takeoff")
    create_flown_trial(client, database, campaign["id"])
    with database.write() as session:
        row = session.get_one(CampaignRow, campaign["id"])
        spread = proposals.stored_distribution(session, row, experiment)
        assert spread == computation.compute(proposals.read_history(session, campaign["id"])).spread
        assert spread.origin != prior_distribution(experiment).origin
        stored = session.query(ProposalRow).order_by(ProposalRow.id.desc()).first()
        assert stored is not None
        assert stored.spread is not None
        for earlier in (None, {name: value for name, value in stored.spread.items() if name != "flights"}):
            for proposal in session.query(ProposalRow):
                proposal.spread = earlier
            session.flush()
            assert proposals.stored_distribution(session, row, experiment) == prior_distribution(experiment)
    assert run_jobs(database) == 1, "it is computed anew"
    with database.read() as session:
        row = session.get_one(CampaignRow, campaign["id"])
        assert proposals.stored_distribution(session, row, experiment) == spread


def test_what_a_flight_showed_that_no_longer_counts_is_not_judged_by(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    flown = create_flown_trial(client, database, campaign["id"])
    run_jobs(database)
    body = {"version": flown["version"], "outcome": "invalid", "reason": "somebody held it"}
    assert client.post(f"/api/trials/{flown['id']}/classify", json=body).status_code == 200
    experiment = get_experiment("takeoff")
    with database.read() as session:
        row = session.get_one(CampaignRow, campaign["id"])
        assert proposals.stored_distribution(session, row, experiment) == prior_distribution(experiment)


def spiky(climb: Trajectory) -> Trajectory:
    altitude_m = climb["altitude_m"].copy()
    altitude_m[(climb.time_s >= 10.0) & (climb.time_s < 10.1)] += 0.5
    return Trajectory(climb.time_s, {"altitude_m": altitude_m}, climb.source, climb.clock)


def test_a_simulated_flight_with_a_glitch_waits_for_a_person(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=OPEN)
    fly_trial(client, database, campaign["id"], FlightRecord(trajectory=spiky(create_climb()), ending="completed"))
    (trial,) = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    assert trial["state"] == "captured"
    assert trial["error"] == pytest.approx(climb_error(1.0) + 0.5 * 0.1 / 32.6, abs=1e-3)
    assert trial["verdict"].startswith("Landed and recorded, with 1 glitch in its record")
    assert [(glitch["kind"], glitch["start_s"]) for glitch in trial["glitches"]] == [
        ("acceleration", pytest.approx(9.98, abs=1e-3))
    ]
    assert trial["repaired_error"] == pytest.approx(climb_error(1.0), abs=1e-3)
    counted = client.post(
        f"/api/trials/{trial['id']}/classify",
        json={"version": trial["version"], "outcome": "valid", "reason": "the spike is the sonar's"},
    ).json()
    assert counted["error"] == pytest.approx(climb_error(1.0) + 0.5 * 0.1 / 32.6, abs=1e-3)
    record = get(client, f"/api/trials/{trial['id']}/trajectory?points=20000")
    assert max(record["channels"]["altitude_m"]) == pytest.approx(3.5, abs=0.01)


def test_a_gap_makes_a_record_invalid_until_a_person_classifies_it_and_its_repair_says_what_it_hides(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=OPEN)
    climb = create_climb()
    kept = (climb.time_s < 12.0) | (climb.time_s >= 12.5)
    columns = {"time_s": climb.time_s[kept], "altitude_m": climb["altitude_m"][kept]}
    trial = create_trial(client, campaign["id"])
    refused = upload(client, trial["id"], csv_of(columns))
    assert (refused.status_code, set(problems_of(refused))) == (409, {"invalid"})
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"
    invalid = upload(client, trial["id"], csv_of(columns), invalid=True).json()
    assert (invalid["state"], [glitch["kind"] for glitch in invalid["glitches"]]) == ("invalid", ["gap"])
    assert (invalid["error"], "gap of 0.52 s after 11.980 s" in invalid["reason"]) == (None, True)
    assert invalid["repaired_error"] == pytest.approx(climb_error(1.0), abs=1e-3)
    said = {"version": invalid["version"], "outcome": "valid", "reason": "the video shows nothing odd"}
    counted = client.post(f"/api/trials/{trial['id']}/classify", json=said).json()
    assert counted["state"] == "valid"
    # The trapezoid over the gap lies above the convex curve: at most gap³/12 · |f''| / window more.
    assert counted["error"] == pytest.approx(climb_error(1.0), rel=1e-2)


def test_a_second_altitude_is_kept_and_compared(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=OPEN)
    climb = create_climb()
    second = np.where((climb.time_s >= 7.0) & (climb.time_s < 8.0), climb["altitude_m"] + 0.6, climb["altitude_m"])
    trial = create_trial(client, campaign["id"])
    columns = {"time_s": climb.time_s, "altitude_m": climb["altitude_m"], "altitude_2_m": second}
    waiting = upload(client, trial["id"], csv_of(columns)).json()
    assert (waiting["state"], [glitch["kind"] for glitch in waiting["glitches"]]) == ("captured", ["disagreement"])
