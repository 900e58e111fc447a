"""Statistics, advice, intervals, variants and warm starts over HTTP, on flights with known errors."""

from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.campaigns.proposals import read_history
from app.core.policy import Gains
from app.db.session import Database
from app.vehicles.base import FlightRecord
from tests.builders import (
    Json,
    climb_error,
    create_campaign,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    land,
    lift_off,
    made_once,
    problems_of,
    run_jobs,
)
from tests.core.tuning.flying import TAKEOFF, TWIN

LONG = {"strategy": "manual", "stop": {"kind": "budget", "max_flights": 50}}
DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
OTHER = {"kp": 300, "ki": 60, "kd": 80}


def modelled(gains: Gains) -> FlightRecord:
    """A flight of the twin without scatter."""
    trajectory = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array(TWIN))
    return FlightRecord(trajectory=trajectory, ending="completed")


def fly(client: TestClient, database: Database, campaign_id: int, settling_s: float, **chosen: object) -> int:
    identity: int = fly_trial(client, database, campaign_id, create_record(settling_s), **chosen)["id"]
    return identity


@pytest.mark.complete
def test_repeats_form_a_group_with_mean_and_standard_error(client: TestClient, database: Database) -> None:
    """Prior scatter 0.0105 m worth four degrees of freedom, as the experiment says."""
    campaign = create_ready_campaign(client, database, definition=LONG)
    for settling_s in (1.0, 1.2):
        fly(client, database, campaign["id"], settling_s, gains=DEFAULT)
    last = fly(client, database, campaign["id"], 0.5, gains=OTHER)
    found = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    first, second = climb_error(1.0), climb_error(1.2)
    sigma = ((4 * 0.0105**2 + (first - second) ** 2 / 2) / 5) ** 0.5
    assert found["sigma"] == pytest.approx(sigma, rel=1e-3)
    assert found["degrees_of_freedom"] == 5
    baseline, best = found["groups"]
    assert (baseline["is_baseline"], baseline["is_best"], baseline["trial_numbers"]) == (True, False, [1, 2])
    assert baseline["mean"] == pytest.approx((first + second) / 2, abs=1e-4)
    assert baseline["standard_error"] == pytest.approx(sigma / 2**0.5, rel=1e-3)
    assert (best["is_best"], best["gains"]) == (True, OTHER)
    assert found["comparison"]["verdict"] == "better"
    assert found["drift"]["difference"] == pytest.approx(second - first, abs=1e-4)
    assert found["drift"]["sentence"] in found["notes"]
    group = get(client, f"/api/trials/{last}")["group"]
    assert group == {"mean": best["mean"], "standard_error": pytest.approx(sigma, rel=1e-3), "n": 1}


def test_a_campaign_without_a_flight_has_the_prior_scatter_only(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    found = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    assert (found["sigma"], found["groups"], found["comparison"], found["notes"]) == (0.0105, [], None, [])
    assert client.get("/api/campaigns/99/statistics").status_code == 404


@pytest.mark.complete
def test_what_noise_hides_is_unresolved_and_says_how_many_flights_would_decide(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=LONG)
    fly(client, database, campaign["id"], 1.00, gains=DEFAULT)
    fly(client, database, campaign["id"], 0.95, gains=OTHER)
    found = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    assert found["comparison"]["verdict"] == "unresolved"
    further = found["comparison"]["further"]
    assert further["best"] + further["baseline"] > 0
    assert found["optimism"] > 0.0
    assert found["shrunk_error"] == pytest.approx(climb_error(0.95) + found["optimism"], abs=1e-4)
    seen = get(client, f"/api/campaigns/{campaign['id']}")
    assert (seen["verdict"], seen["best"]["flights"]) == ("unresolved", 1)
    assert seen["best"]["standard_error"] == pytest.approx(0.0105)
    (card,) = get(client, "/api/campaigns")["items"]
    assert (card["verdict"], card["best"]) == ("unresolved", seen["best"])


def test_one_sentence_each_says_how_the_error_with_the_same_gains_has_changed_in_time_and_with_the_battery(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition=LONG)
    for settling_s, volts in ((1.9, 9.0), (1.6, 10.0), (1.3, 11.0), (1.0, 12.0)):
        create_trial(client, campaign["id"], fly={"speed": None}, gains=DEFAULT)
        record = create_record(settling_s)
        battery_v = np.full(len(record.trajectory), volts)
        trajectory = replace(record.trajectory, channels={**record.trajectory.channels, "battery_v": battery_v})
        land(database, lift_off(database), replace(record, trajectory=trajectory))
    fly(client, database, campaign["id"], 2.5, gains=OTHER)
    found = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    drift, trend = found["drift"], found["battery_trend"]
    assert (drift["first_trial"], drift["last_trial"], drift["resolved"]) == (1, 4, True)
    assert drift["difference"] == pytest.approx(climb_error(1.0) - climb_error(1.9), rel=1e-2)
    assert drift["sentence"].startswith(
        "The vehicle has drifted: from flight 1 to 4 the trend of the error with the same gains is −0."
    )
    assert " m (" in drift["sentence"]
    assert [note for note in found["notes"] if "flight number" in note or "drift" in note] == [drift["sentence"]]
    assert trend["slope"] == pytest.approx((climb_error(1.0) - climb_error(1.9)) / 3, rel=1e-2)
    assert trend["upper"] < 0.0
    assert trend["sentence"].startswith("The error changes with the battery voltage: −0.")


@pytest.mark.complete
def test_a_flight_of_a_proposal_carries_its_interval_and_is_held_against_it(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    fly_trial(client, database, campaign["id"], modelled(DEFAULT))
    run_jobs(database)
    proposal = get(client, f"{path}/proposal")["proposal"]
    assert proposal["interval"]["lower"] < proposal["predicted_error"] < proposal["interval"]["upper"]
    fly_trial(client, database, campaign["id"], modelled(proposal["gains"]), proposal_id=proposal["id"])
    [_, flown] = get(client, f"{path}/trials")["items"]
    assert flown["predicted_interval"] == proposal["interval"]
    assert flown["inside_interval"]
    record = get(client, f"{path}/statistics")["track_record"]
    assert (record["inside"], record["of"], record["share"]) == (1, 1, 1.0)
    again = create_trial(client, campaign["id"], gains=DEFAULT)
    interval = again["predicted_interval"]
    assert interval["lower"] < again["predicted_error"] < interval["upper"]
    assert again["inside_interval"] is None


def test_a_first_prediction_that_allows_any_flight_is_none_and_does_not_count_as_kept(
    client: TestClient, database: Database
) -> None:
    """The uncorrected model allows 0 … 2.2 m."""
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    proposal = get(client, f"{path}/proposal")["proposal"]
    assert proposal["advice"]["kind"] == proposal["recommended"] == "baseline"
    assert (proposal["predicted_error"], proposal["interval"]) == (None, None)
    fly_trial(client, database, campaign["id"], modelled(proposal["gains"]), proposal_id=proposal["id"])
    [flown] = get(client, f"{path}/trials")["items"]
    assert (flown["predicted_error"], flown["predicted_interval"], flown["inside_interval"]) == (None, None, None)
    assert "predicted" not in flown["verdict"]
    record = get(client, f"{path}/statistics")["track_record"]
    assert (record["inside"], record["of"]) == (0, 0)
    assert record["sentence"] == "No prediction has been tested by a flight yet."


@pytest.mark.complete
def test_repeats_of_a_simulation_without_scatter_get_none(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}"
    prior = "prior estimate of 0.0105 m"

    def fly() -> Json:
        fly_trial(client, database, campaign["id"], modelled(DEFAULT), gains=DEFAULT)
        statistics: Json = get(client, f"{path}/statistics")
        return statistics

    found = fly()
    assert found["sigma"] == pytest.approx(0.0105)
    assert found["scatter_source"] == f"From a {prior} (4 degrees of freedom): no gain set has two valid flights."
    fly()
    found = fly()
    assert (found["sigma"], found["groups"][0]["standard_error"], found["drift"]) == (0.0, None, None)
    assert found["scatter_source"] == (
        f"No scatter in this simulation: 2 repeats gave the same error. Comparisons still assume the {prior}."
    )
    [*_, last] = get(client, f"{path}/trials")["items"]
    assert last["group"] == {"mean": last["error"], "standard_error": None, "n": 3}


@pytest.mark.complete
def test_a_variant_is_what_the_advice_means_where_the_best_gains_are_outside_the_bounds(
    client: TestClient, database: Database
) -> None:
    """They were flown over the gate's refusal, and would be refused again."""
    stop = {"kind": "budget", "max_flights": 50}
    definition = {"strategy": "manual", "stop": stop, "bounds": {"ki": [0, 50]}}
    campaign = create_ready_campaign(client, database, definition=definition)
    fly(client, database, campaign["id"], 2.0)
    fly(client, database, campaign["id"], 0.5, gains=OTHER, overrule="To see what lies outside.")
    best = {"kp": 320, "ki": 20, "kd": 80}
    fly(client, database, campaign["id"], 1.0, gains=best)
    assert get(client, f"/api/campaigns/{campaign['id']}")["best"]["gains"] == OTHER
    for variant, gains in (("repeat", best), ("baseline", DEFAULT)):
        answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"variant": variant})
        assert (answer.status_code, answer.json()["gains"]) == (201, gains), answer.text


def test_exactly_one_of_proposal_gains_and_variant_is_taken(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    path = f"/api/campaigns/{campaign['id']}/trials"
    for body in ({}, {"variant": "repeat", "proposal_id": 1}, {"gains": DEFAULT, "proposal_id": 1}):
        answer = client.post(path, json=body)
        assert "exactly one is required" in problems_of(answer)["proposal_id"]


def test_half_of_no_step_is_refused(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=LONG)
    fly(client, database, campaign["id"], 1.0)
    run_jobs(database)
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"variant": "smaller step"})
    assert answer.status_code == 409
    assert "cannot be made smaller" in answer.json()["detail"]


def test_a_smaller_step_waits_for_the_proposal_that_it_is_half_of(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"stop": {"kind": "budget", "max_flights": 50}})
    fly_trial(client, database, campaign["id"], create_record(1.0))
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"variant": "smaller step"})
    assert (answer.status_code, "have not been computed yet" in answer.json()["detail"]) == (409, True)


@pytest.fixture
def donor(client: TestClient, database: Database) -> int:
    """A campaign whose second flight is its best."""

    def make() -> Json:
        campaign = create_ready_campaign(client, database, definition=LONG)
        fly(client, database, campaign["id"], 2.0)
        fly(client, database, campaign["id"], 1.0, gains=OTHER)
        return campaign

    return int(made_once(database, "donor", make)["id"])


@pytest.mark.complete
def test_a_clone_on_another_vehicle_starts_from_the_best_flight(
    client: TestClient, database: Database, donor: int
) -> None:
    answer = client.post(f"/api/campaigns/{donor}/clone", json={"warm_start": True, "vehicle": {"kind": "jsbsim"}})
    assert answer.status_code == 201, answer.text
    clone = answer.json()
    start = clone["definition"]["start"]
    assert (start["kind"], start["gains"]) == ("campaign", OTHER)
    assert (start["donor"]["campaign_id"], start["donor"]["trial_number"]) == (donor, 2)
    run_jobs(database)
    proposal = get(client, f"/api/campaigns/{clone['id']}/proposal")["proposal"]
    assert proposal["gains"] == OTHER
    assert proposal["predicted_error"] == pytest.approx(climb_error(1.0), abs=1e-3)
    assert "best gains of the campaign" in proposal["explanation"]["summary"]
    again = client.patch(f"/api/campaigns/{clone['id']}", json={"version": 1, "definition": clone["definition"]})
    assert again.json()["definition"]["start"] == start


@pytest.mark.complete
def test_a_warm_start_takes_the_best_gains_and_not_those_of_one_lucky_flight(
    client: TestClient, database: Database, donor: int
) -> None:
    fly(client, database, donor, 1.01, gains=OTHER)
    fly(client, database, donor, 0.99, gains={"kp": 300, "ki": 20, "kd": 80})
    campaign = get(client, f"/api/campaigns/{donor}")
    assert (campaign["best"]["trial_number"], campaign["winner"]["trial_numbers"]) == (4, [2, 3])
    (card,) = get(client, "/api/campaigns")["items"]
    clone = client.post(f"/api/campaigns/{donor}/clone", json={"warm_start": True}).json()
    start = clone["definition"]["start"]
    assert start["gains"] == OTHER
    assert start["donor"]["trial_number"] == card["best"]["trial_number"] == 2


@pytest.mark.complete
@pytest.mark.parametrize(
    ("settling_s", "decided", "agreement"),
    [
        (1.0, "The model fitted to the other vehicle's flight replaces the data sheet: ", "agreement 100\u00a0%"),
        (6.0, "Nothing is used from the other vehicle: ", "less than 50\u00a0%"),
    ],
)
def test_the_proposals_after_a_warm_starts_first_flight_say_what_was_taken_over(
    client: TestClient, database: Database, donor: int, settling_s: float, decided: str, agreement: str
) -> None:
    """The donor's best flight settled within 1 s; what this vehicle's first one shows decides for all that follow."""
    definition = {**LONG, "strategy": "gradient", "start": {"kind": "campaign", "donor": {"campaign_id": donor}}}
    campaign = create_ready_campaign(client, database, definition=definition)
    path = f"/api/campaigns/{campaign['id']}/proposal"
    assert not any("other vehicle" in note for note in get(client, path)["proposal"]["explanation"]["notes"])
    for flown_s in (settling_s, 0.8 * settling_s):
        create_flown_trial(client, database, campaign["id"], flown_s)
        proposal = get(client, path)["proposal"]
        (note,) = [note for note in proposal["explanation"]["notes"] if "other vehicle" in note]
        assert note.startswith(decided)
        assert agreement in note


def test_a_donor_that_cannot_be_one_is_refused_by_name(client: TestClient, database: Database, donor: int) -> None:
    empty = create_campaign(client)["id"]

    def refusal(donor: dict[str, object], **fields: object) -> dict[str, str]:
        start = {"kind": "campaign", "donor": donor}
        answer = client.post("/api/campaigns", json={"name": "Warm", "definition": {"start": start, **fields}})
        assert answer.status_code == 422, answer.text
        return problems_of(answer)

    assert "no valid flight" in refusal({"campaign_id": empty})["definition.start.donor.trial_number"]
    assert (
        "no valid flight 9" in refusal({"campaign_id": donor, "trial_number": 9})["definition.start.donor.trial_number"]
    )
    assert "there is no campaign 99" in refusal({"campaign_id": 99})["definition.start.donor.campaign_id"]
    assert "leave it out" in refusal({"campaign_id": donor, "checksum": "0" * 64})["definition.start.donor.checksum"]
    assert (
        "must hold the start gain" in refusal({"campaign_id": donor}, bounds={"kp": (0, 290)})["definition.bounds.kp"]
    )
    other = refusal({"campaign_id": donor}, experiment_options={"window_s": 20.0})["definition.start.donor.campaign_id"]
    assert other == f"campaign {donor} has a scored window of 32.6 s, this one of 20 s"
    assert (
        "between 10 and 60 s"
        in refusal({"campaign_id": donor}, experiment_options={"window_s": 5.0})[
            "definition.experiment_options.window_s"
        ]
    )
    assert "this one" in refusal({"campaign_id": donor}, experiment="elsewhere")["definition.start.donor.campaign_id"]
    answer = client.post(
        "/api/campaigns", json={"name": "Warm", "definition": {"start": {"donor": {"campaign_id": donor}}}}
    )
    assert "kind 'campaign' only" in problems_of(answer)["definition.start.donor"]


@pytest.mark.complete
def test_a_donor_flight_serves_on_when_it_is_classed_otherwise_later(
    client: TestClient, database: Database, donor: int
) -> None:
    definition = {"start": {"kind": "campaign", "donor": {"campaign_id": donor}}}
    campaign = create_campaign(client, definition=definition)
    best = get(client, f"/api/campaigns/{donor}/trials")["items"][1]
    body = {"version": best["version"], "outcome": "invalid", "reason": "rain"}
    assert client.post(f"/api/trials/{best['id']}/classify", json=body).status_code == 200
    run_jobs(database)
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]["gains"] == OTHER
    assert client.delete(f"/api/campaigns/{donor}?version=1").status_code == 409
    with database.read() as session:
        flight = read_history(session, campaign["id"]).donor
    assert flight is not None
    assert (flight.outcome, flight.error) == ("valid", best["error"])
