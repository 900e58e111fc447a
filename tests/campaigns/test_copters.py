"""Campaigns of other autopilots over HTTP: gains chosen by the operator, scored and drawn, without predictions."""

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from tests.builders import (
    Json,
    climb_error,
    create_csv,
    create_imported_trial,
    create_ready_campaign,
    create_trial,
    get,
    problems_of,
    run_jobs,
    store_campaign,
    upload,
)
from tests.fleet.vehicles import register

PX4: Json = {"experiment": "takeoff-px4", "strategy": "manual", "step_fraction": 0.25}
DEFAULT: Json = {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0}
FIRMER: Json = {**DEFAULT, "MPC_Z_P": 1.3}
SETTLED_S = (1.5, 0.8, 1.0)


def flown_by_hand(client: TestClient, database: Database) -> tuple[Json, list[Json]]:
    """A campaign of three flights flown elsewhere: the defaults as proposed, then two sets of a script's."""
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PX4)
    trials = [create_imported_trial(client, campaign["id"], create_csv(SETTLED_S[0]))]
    for gains, settling_s in zip((FIRMER, {**FIRMER, "MPC_Z_VEL_P_ACC": 6.0}), SETTLED_S[1:], strict=True):
        run_jobs(database)
        trial = create_trial(client, campaign["id"], gains=gains)
        trials.append(upload(client, trial["id"], create_csv(settling_s)).json())
    run_jobs(database)
    return get(client, f"/api/campaigns/{campaign['id']}"), trials


@pytest.mark.complete
def test_a_script_submits_gains_and_gets_their_errors(client: TestClient, database: Database) -> None:
    campaign, trials = flown_by_hand(client, database)
    assert [trial["error"] for trial in trials] == pytest.approx([climb_error(each) for each in SETTLED_S], abs=1e-4)
    assert [trial["kind"] for trial in trials] == ["start", "manual", "manual"]
    assert [trial["predicted_error"] for trial in trials] == [None, None, None]
    assert campaign["best"]["gains"] == FIRMER
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    assert (proposal["kind"], proposal["gains"]) == ("manual", FIRMER)
    assert (proposal["predicted_error"], proposal["interval"]) == (None, None)
    assert {check["name"] for check in proposal["gate"]["checks"]} == {"bounds", "step"}


@pytest.mark.complete
def test_its_figures_and_statistics_stand_without_predictions(client: TestClient, database: Database) -> None:
    campaign, trials = flown_by_hand(client, database)
    cards = [get(client, f"/api/campaigns/{campaign['id']}/figures/{name}") for name in ("takeoffs", "errors", "gains")]
    cards.append(get(client, f"/api/trials/{trials[-1]['id']}/figure"))
    assert [card["state"] for card in cards] == ["ready"] * 4, [card["reason"] for card in cards]
    traces = [trace for card in cards for trace in card["figure"]["data"] if trace.get("visible", True)]
    drawn = [trace["name"] for trace in traces if "name" in trace]
    assert not [name for name in drawn if "predict" in name.lower()]
    said = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    assert said["track_record"]["of"] == 0


@pytest.mark.complete
def test_nothing_is_better_before_a_gain_set_was_flown_twice_under_an_autopilot_whose_scatter_nobody_measured(
    client: TestClient, database: Database
) -> None:
    campaign, trials = flown_by_hand(client, database)
    said = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    found = said["comparison"]
    assert (found["verdict"], found["confidence"], found["standard_error"]) == ("not known yet", None, None)
    assert (said["sigma"], said["shrunk_error"], campaign["best"]["standard_error"]) == (None, None, None)
    assert found["sentence"].endswith("Fly one of the gain sets again.")
    assert campaign["verdict"] == "not known yet"
    last = get(client, f"/api/trials/{trials[-1]['id']}")
    assert {each["verdict"] for each in last["comparisons"]} == {"not known yet"}
    compared = get(client, "/api/compare?" + "&".join(f"trial={trial['id']}" for trial in trials))
    assert (compared["verdict"], {pair["verdict"] for pair in compared["pairs"]}) == (
        "not known yet",
        {"not known yet"},
    )
    assert "Fly one of the gain sets again" in compared["sentence"]
    report = client.get(f"/api/campaigns/{campaign['id']}/report.html").text
    assert "Not known yet" in report
    assert "no gain set has two valid flights" in report


@pytest.mark.complete
def test_one_repeat_makes_the_scatter_known_from_these_flights_alone(client: TestClient, database: Database) -> None:
    campaign, trials = flown_by_hand(client, database)
    again = create_trial(client, campaign["id"], gains=FIRMER)
    repeat = upload(client, again["id"], create_csv(0.86)).json()
    said = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    apart = repeat["error"] - trials[1]["error"]
    assert said["sigma"] == pytest.approx(abs(apart) / 2**0.5)
    assert said["degrees_of_freedom"] == 1.0
    assert said["comparison"]["verdict"] in {"better", "unresolved"}
    assert said["comparison"]["confidence"] is not None


def test_a_step_beyond_the_limit_or_the_bounds_is_refused_with_what_would_pass(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PX4)
    path = f"/api/campaigns/{campaign['id']}/trials"
    refused = problems_of(client.post(path, json={"gains": {**DEFAULT, "MPC_Z_VEL_P_ACC": 9.0}}))
    assert "only 25\u00a0% is allowed from the start gains" in refused["gains.MPC_Z_VEL_P_ACC"]
    refused = problems_of(client.post(path, json={"gains": {"MPC_Z_P": 1.0}}))
    assert refused["gains.MPC_Z_VEL_I_ACC"] == "is missing"


REFUSED = "'takeoff-px4' is no longer offered for new campaigns; use 'altitude-steps-px4' instead"


def test_it_is_not_offered_for_new_campaigns_which_are_told_what_replaces_it(
    client: TestClient, database: Database
) -> None:
    wanted = {"name": "Test", "vehicle": {"kind": "import"}, "definition": {**PX4, "strategy": "gradient"}}
    stored, other = store_campaign(database, "import", PX4), create_ready_campaign(client, database, vehicle="import")
    for answer in (
        client.post("/api/campaigns", json=wanted),
        client.post(f"/api/campaigns/{stored}/clone", json={}),
        client.patch(f"/api/campaigns/{other['id']}", json={"definition": PX4, "version": other["version"]}),
    ):
        assert answer.status_code == 422
        assert problems_of(answer)["definition.experiment"] == REFUSED


def test_a_stored_draft_of_it_can_be_changed_and_a_strategy_that_needs_a_model_is_refused_with_the_reason(
    client: TestClient, database: Database
) -> None:
    path = f"/api/campaigns/{store_campaign(database, 'import', PX4)}"
    wanted = {"definition": {**PX4, "step_fraction": 0.1}, "version": 1}
    assert client.patch(path, json=wanted).json()["definition"]["step_fraction"] == 0.1
    answer = client.patch(path, json={"definition": {**PX4, "strategy": "gradient"}, "version": 2})
    assert answer.status_code == 422
    assert "there is no model for the gains of 'takeoff-px4'" in problems_of(answer)["definition.strategy"]


def test_flights_made_elsewhere_with_different_gains_do_not_get_in_each_others_way(
    client: TestClient, database: Database
) -> None:
    """Both campaigns have the one vehicle that stands for all that fly elsewhere."""
    create_ready_campaign(client, database, vehicle="import", definition=PX4)
    paper = create_ready_campaign(client, database, vehicle="import")
    assert create_imported_trial(client, paper["id"])["gains"] == {"kp": 283, "ki": 13, "kd": 82}


def test_a_registered_copter_flies_the_steps_of_its_own_gains(client: TestClient) -> None:
    options = {"simulated": True, "autopilot": "px4"}
    vehicle = client.post("/api/vehicles", json={"name": "Copter", "kind": "mavlink", "options": options}).json()
    assert vehicle["experiments"] == ["altitude-steps-px4"]
    choice = {"kind": "mavlink", "id": vehicle["id"]}
    steps = {"experiment": "altitude-steps-px4"}
    answer = client.post("/api/campaigns", json={"name": "Test", "vehicle": choice, "definition": steps})
    assert answer.status_code == 201, answer.text
    assert answer.json()["vehicle"]["options"]["autopilot"] == "px4"


def test_the_catalogue_describes_experiments_without_a_model_and_offers_no_vehicle_for_them(client: TestClient) -> None:
    catalogue = get(client, "/api/catalogue")
    without = [each["name"] for each in catalogue["experiments"] if not each["has_model"]]
    assert without == ["takeoff-ardupilot", "takeoff-px4"]
    assert not [each["name"] for each in catalogue["vehicle_kinds"] if set(without) & set(each["experiments"])]


def test_what_a_log_tells_of_the_vehicle_is_kept_unless_the_campaign_is_for_another(client: TestClient) -> None:
    one, other = (
        {"kind": "mavlink", "id": register(client, name, options={"autopilot": "px4", "simulated": True})["id"]}
        for name in ("One", "Other")
    )
    vehicle = {
        "hover_throttle": [0.6, 0.01],
        "thrust_slope": [1.0, 0.02],
        "motor_lag_s": [0.05, 0.01],
        "drag_1_s": [0.3, 0.1],
    }
    log = {"file_name": "day.ulg", "error_m": 0.19, "vehicle": vehicle, "parameters": {"MPC_THR_HOVER": 0.5}}
    definition = {"experiment": "altitude-steps-px4", "start": {"kind": "given", "gains": FIRMER, "log": log}}
    new = {"name": "From a log", "vehicle": one, "definition": definition}
    campaign = client.post("/api/campaigns", json=new)
    assert campaign.status_code == 201, campaign.text
    path = f"/api/campaigns/{campaign.json()['id']}/clone"
    starts = [client.post(path, json=json).json()["definition"]["start"] for json in ({}, {"vehicle": other})]
    assert [start["gains"] for start in starts] == [FIRMER, FIRMER]
    assert [start["log"] for start in starts] == [log, None]
    moved = client.patch(f"/api/campaigns/{campaign.json()['id']}", json={"vehicle": other, "version": 1})
    assert (moved.status_code, moved.json()["definition"]["start"]["log"]) == (200, None), moved.text
    del vehicle["drag_1_s"]
    refused = client.post("/api/campaigns", json=new)
    assert "must have hover_throttle" in problems_of(refused)["definition.start.log.vehicle"]
