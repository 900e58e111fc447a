"""A campaign of altitude steps over HTTP: defined, flown on the simulated vehicles, drawn, compared and taken along."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from numpy.typing import NDArray

from app.core.clock import REAL_TIME
from app.db.session import Database
from app.flights.flight_loop import FlightMonitor
from app.flights.process_messages import FlightRequest
from app.live.messages import Telemetry
from app.vehicles.base import FlightRecord
from app.vehicles.registry import open_vehicle
from tests.builders import (
    create_flown_trial,
    create_ready_campaign,
    create_trial,
    get,
    land,
    lift_off,
    problems_of,
    run_jobs,
)
from tests.bundles.builders import download_bundle, import_bundle, second_installation
from tests.campaigns.test_landscapes import run_landscapes
from tests.core.tuning.flying import compiled_only
from tests.fleet.vehicles import create_campaign_on, create_connected
from tests.vehicles.flying import SAFE

Json = dict[str, Any]
OPTIONS: Json = {"steps": 2, "step_window_s": 3.0}
"""Two steps, from 3 m to 2 m and back, scored from 10 to 16 s."""
SHORT: Json = {"experiment": "altitude-steps", "experiment_options": OPTIONS}
PATIENT: Json = {**SHORT, "stop": {"kind": "budget", "max_flights": 8}}


def fly(client: TestClient, database: Database, campaign_id: int, **plan: Any) -> Json:
    """Plan a trial, fly it on its simulated vehicle, and compute the next proposal."""
    trial = create_trial(client, campaign_id, fly={"speed": None}, **plan)
    task = lift_off(database)
    land(database, task, record_of(task))
    run_jobs(database)
    flown: Json = get(client, f"/api/trials/{trial['id']}")
    return flown


def record_of(task: FlightRequest, monitor: FlightMonitor | None = None) -> FlightRecord:
    with open_vehicle(task.vehicle_kind, task.vehicle_options, safe_gains=SAFE) as vehicle:
        vehicle.stage(task.gains)
        watch = (lambda _: None) if monitor is None else monitor.sample
        return vehicle.fly(task.options(REAL_TIME), on_sample=watch, should_stop=lambda: None)


def refused(client: TestClient, vehicle: Json, definition: Json) -> dict[str, str]:
    answer = client.post("/api/campaigns", json={"name": "Test", "vehicle": vehicle, "definition": definition})
    assert answer.status_code == 422, answer.text
    return problems_of(answer)


@compiled_only
def test_two_flights_are_flown_to_the_schedule_scored_against_the_reference_predicted_and_drawn(
    client: TestClient, database: Database, tmp_path: Path, migrated_file: Path
) -> None:
    campaign = create_ready_campaign(client, database, definition=PATIENT)
    path = f"/api/campaigns/{campaign['id']}"
    assert campaign["definition"]["strategy"] == "calibrated"
    first = fly(client, database, campaign["id"])
    second = fly(client, database, campaign["id"])
    assert [first["state"], second["state"]] == ["valid", "valid"]
    rows = rows_of(client, second)
    changes = np.flatnonzero(np.diff(rows["set_point_m"])) + 1
    assert rows["time_s"][changes].tolist() == [10.0, 13.0]
    assert rows["set_point_m"][[0, 5120, 6656, -1]].tolist() == [3.0, 2.0, 3.0, 3.0]
    scored = (rows["time_s"] >= 10.0) & (rows["time_s"] <= 16.0)
    distance = np.abs(rows["reference_m"] - rows["altitude_m"])[scored]
    assert second["error"] == pytest.approx(np.trapezoid(distance, dx=1 / 512) / 6.0, abs=1e-6)
    assert second["error"] < 0.02 * first["error"]
    assert second["predicted_interval"]["lower"] <= second["error"] <= second["predicted_interval"]["upper"]
    assert (second["rise_time_s"], second["settling_time_s"], second["overshoot_m"]) == (None, None, None)

    card = get(client, f"{path}/figures/takeoffs")
    assert (card["title"], card["state"]) == ("Altitude steps", "ready")
    drawn = {trace["meta"]["role"]: trace for trace in card["figure"]["data"]}
    assert (drawn["target"]["name"], sorted(set(drawn["set point"]["y"]))) == ("Reference", [2.0, 3.0])
    assert card["figure"]["layout"]["xaxis"]["range"] == [9.0, pytest.approx(16.0, abs=0.01)]
    deviations = [trace for trace in card["figure"]["data"] if trace["meta"]["role"] == "deviation"]
    late = [np.abs(np.array(each["y"])[np.array(each["x"]) > 10.0]).max() for each in deviations]
    assert max(late) == pytest.approx(distance_of(client, first), abs=0.01)
    assert get(client, f"/api/trials/{second['id']}/figure")["state"] == "ready"
    assert get(client, f"{path}/figures/errors")["state"] == "ready"
    assert client.get(f"{path}/report.html").status_code == 200

    with second_installation(tmp_path / "elsewhere", migrated_file) as (there, _):
        answer = import_bundle(there, download_bundle(client, campaign["id"]))
        assert answer.status_code == 201, answer.text
        arrived = answer.json()
        theirs = get(there, f"/api/campaigns/{arrived['id']}/trials")["items"]
    assert arrived["definition"]["experiment_options"] == OPTIONS
    assert [trial["error"] for trial in theirs] == [first["error"], second["error"]]


@pytest.mark.complete
@compiled_only
def test_its_error_landscape_is_computed_and_drawn(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={**SHORT, "strategy": "gradient"})
    fly(client, database, campaign["id"])
    path = f"/api/campaigns/{campaign['id']}/figures/landscape"
    assert get(client, path)["state"] == "waiting"
    assert run_landscapes(database) == 1
    assert get(client, path)["state"] == "ready"


def rows_of(client: TestClient, trial: Json) -> NDArray[np.void]:
    """The trial's exported record, its columns by name."""
    text = client.get(f"/api/trials/{trial['id']}/trajectory.csv").text
    return np.genfromtxt(io.StringIO(text), delimiter=",", names=True)


def distance_of(client: TestClient, trial: Json) -> float:
    """The largest distance from the reference after the first step."""
    rows = rows_of(client, trial)
    after = (rows["time_s"] > 10.0) & (rows["time_s"] <= 16.0)
    return float(np.abs(rows["altitude_m"] - rows["reference_m"])[after].max())


@compiled_only
def test_the_error_so_far_begins_with_the_first_step_and_ends_at_the_error(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition={**SHORT, "strategy": "gradient"})
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    task = lift_off(database)
    heard: list[Telemetry] = []
    monitor = FlightMonitor(task, heard.append, REAL_TIME)
    land(database, task, record_of(task, monitor))
    monitor.flush()
    assert [said.error_so_far for said in heard if said.time_s <= 10.0] == [None] * len(
        [said for said in heard if said.time_s <= 10.0]
    )
    error = get(client, f"/api/trials/{trial['id']}")["error"]
    assert heard[-1].error_so_far == pytest.approx(error, abs=2e-4)


def test_flights_flown_elsewhere_are_refused_with_a_plain_sentence(client: TestClient) -> None:
    said = refused(client, {"kind": "import"}, SHORT)
    assert said["definition.experiment"] == "'altitude-steps' cannot be flown by import"
    assert said["vehicle.kind"] == "'import' flies only takeoff"


def test_a_vehicle_with_a_link_flies_to_no_set_point_near_its_altitude_limit(client: TestClient) -> None:
    high = {**SHORT, "experiment_options": {**OPTIONS, "order": "up first"}}
    assert refused(client, {"kind": "mavlink"}, high) == {
        "definition.experiment_options.height_m": "must be lower by 0.5 m, or the steps smaller: a vehicle of this "
        "kind flies to at most 3.5 m"
    }


@pytest.mark.complete
def test_steps_that_last_longer_than_the_flight_plan_allows_are_refused_with_the_time_that_is_needed(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    definition = {**SHORT, "experiment_options": {"steps": 6, "step_window_s": 8.0}}
    campaign = create_campaign_on(client, database, vehicle, definition=definition)
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]["id"]
    answer = client.post(f"/api/campaigns/{campaign['id']}/trials", json={"proposal_id": proposal, "fly": {}})
    assert answer.status_code == 409
    assert answer.json()["hint"].endswith("(plan_time_s), to 60.4 s or more.")


def test_a_ceiling_below_the_highest_step_is_refused_by_its_field(client: TestClient) -> None:
    high = {**SHORT, "experiment_options": {**OPTIONS, "order": "up first", "height_m": 4.0}}
    assert refused(client, {"kind": "twin"}, high) == {"definition.ceiling_m": "must be between 5.2 and 100 m, got 4.5"}


@pytest.mark.complete
def test_flights_of_other_steps_or_of_a_takeoff_are_not_compared_and_start_no_campaign(
    client: TestClient, database: Database
) -> None:
    manual = {"strategy": "manual", "stop": {"kind": "budget", "max_flights": 3}}
    larger = {"experiment": "altitude-steps", "experiment_options": {**OPTIONS, "step_m": 0.5}}
    ids = [create_ready_campaign(client, database, definition={**each, **manual})["id"] for each in (SHORT, larger, {})]
    trials = [fly(client, database, campaign, gains=SAFE) for campaign in ids]
    assert [trial["state"] for trial in trials] == ["valid"] * 3
    said = [
        problems_of(client.get("/api/compare", params={"trial": [trials[0]["id"], other["id"]]}))["trial.1"]
        for other in trials[1:]
    ]
    named = "of 2 steps of 1 m from 3 m, down first, 3 s each: the errors are different quantities"
    assert all(each.endswith(named) for each in said), said
    assert "is of 2 steps of 0.5 m from 3 m, down first, 3 s each" in said[0]
    assert "is of a takeoff to 3 m" in said[1]
    donor = {"start": {"kind": "campaign", "donor": {"campaign_id": ids[1]}}}
    assert refused(client, {"kind": "twin"}, {**SHORT, **donor})["definition.start.donor.campaign_id"] == (
        f"campaign {ids[1]} flies 2 steps of 0.5 m from 3 m, down first, 3 s each, this one 2 steps of 1 m from 3 m, "
        "down first, 3 s each"
    )


@pytest.mark.complete
def test_a_record_that_had_not_settled_is_invalid_and_says_why(client: TestClient, database: Database) -> None:
    """Gains that ring flew past the gate's refusal: with a reason, which a simulated vehicle allows."""
    campaign = create_ready_campaign(client, database, definition={**SHORT, "strategy": "manual"})
    ringing = {"kp": 283, "ki": 13, "kd": 0}
    flown = fly(client, database, campaign["id"], gains=ringing, overrule="to see what it does")
    assert (flown["state"], flown["error"]) == ("invalid", None)
    assert flown["reason"].startswith("the altitude had not settled before the first step, at 10 s: it changed by")


def test_a_record_without_the_autopilots_reference_is_invalid_and_says_why(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, definition={**SHORT, "strategy": "manual"})
    bare = create_flown_trial(client, database, campaign["id"])
    assert bare["reason"] == "reference_m is not among the recorded channels (altitude_m)"
    assert (bare["state"], bare["error"]) == ("invalid", None)


def test_the_catalogue_offers_it_on_simulated_vehicles_with_its_options(client: TestClient) -> None:
    offered = get(client, "/api/catalogue")
    [steps] = [each for each in offered["experiments"] if each["name"] == "altitude-steps"]
    assert [option["name"] for option in steps["options"]] == ["height_m", "step_m", "steps", "order", "step_window_s"]
    kinds = [kind["name"] for kind in offered["vehicle_kinds"] if "altitude-steps" in kind["experiments"]]
    assert kinds == ["jsbsim", "twin", "mavlink"]
    strategies = [each["name"] for each in offered["strategies"] if "altitude-steps" in each["experiments"]]
    assert strategies == ["calibrated", "gradient", "simplex", "manual"]
