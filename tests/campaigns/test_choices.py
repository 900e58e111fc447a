"""What may be flown next, over HTTP: the choices of a proposal, and the prediction and gate result of any gains."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.campaigns import history
from app.campaigns.flight_predictions import KEPT, PredictorCache, predict_gains
from app.db.session import Database
from tests.builders import (
    Json,
    create_climb,
    create_flown_trial,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    run_jobs,
)

PATIENT = {"stop": {"kind": "budget", "max_flights": 9}}
FIRST = {"kp": 283, "ki": 13, "kd": 82}
OWN = {"kp": 400, "ki": 30, "kd": 100}


def proposal_of(client: TestClient, campaign_id: int) -> Json:
    found: Json = get(client, f"/api/campaigns/{campaign_id}/proposal")["proposal"]
    return found


def consider(client: TestClient, campaign_id: int, what: str, gains: object) -> tuple[int, Json]:
    answer = client.post(f"/api/campaigns/{campaign_id}/{what}", json={"gains": gains})
    return answer.status_code, answer.json()


def fly_gains(client: TestClient, database: Database, campaign_id: int, gains: Json, settling_s: float) -> None:
    fly_trial(client, database, campaign_id, create_record(settling_s), gains=gains)
    run_jobs(database)


def test_before_the_first_flight_the_only_choice_is_the_baseline_and_no_variant_is_taken(
    client: TestClient, database: Database
) -> None:
    campaign_id = create_ready_campaign(client, database)["id"]
    assert proposal_of(client, campaign_id)["choices"] == [
        {"kind": "baseline", "gains": FIRST, "proposed": True, "recommended": True}
    ]
    for variant in ("repeat", "baseline", "smaller step"):
        refused = client.post(f"/api/campaigns/{campaign_id}/trials", json={"variant": variant})
        assert (refused.status_code, "needs a valid flight inside the bounds" in refused.json()["detail"]) == (
            409,
            True,
        )


@pytest.mark.complete
def test_after_two_flights_there_are_a_step_half_of_it_the_best_again_and_the_first_again(
    client: TestClient, database: Database
) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    create_flown_trial(client, database, campaign_id, 6.0)
    second = create_flown_trial(client, database, campaign_id, 5.0)
    proposal = proposal_of(client, campaign_id)
    best, step = second["gains"], proposal["gains"]
    chosen = {choice["kind"]: choice["gains"] for choice in proposal["choices"]}
    half = {name: pytest.approx((best[name] + step[name]) / 2.0, abs=0.5) for name in step}
    assert chosen == {"step": step, "smaller step": half, "repeat": best, "baseline": FIRST}
    assert list(chosen) == ["step", "smaller step", "repeat", "baseline"]
    assert [choice["kind"] for choice in proposal["choices"] if choice["proposed"]] == ["step"]
    [recommended] = [choice for choice in proposal["choices"] if choice["recommended"]]
    assert recommended["gains"] == proposal["advice"]["gains"]
    for variant, kind in (("smaller step", "shorter step"), ("baseline", "baseline"), ("repeat", "repeat")):
        planned = create_trial(client, campaign_id, variant=variant)
        assert (planned["kind"], planned["gains"], planned["gate"]["passed"]) == (kind, chosen[variant], True)


def test_after_one_flight_its_gains_are_offered_once(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    create_flown_trial(client, database, campaign_id, 6.0)
    kinds = [choice["kind"] for choice in proposal_of(client, campaign_id)["choices"]]
    assert kinds == ["step", "smaller step", "repeat"]


@pytest.mark.complete
def test_gains_chosen_by_hand_start_from_the_best_flown(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition={"strategy": "manual", **PATIENT})["id"]
    create_flown_trial(client, database, campaign_id, 2.0)
    assert [choice["kind"] for choice in proposal_of(client, campaign_id)["choices"]] == ["repeat"]
    fly_gains(client, database, campaign_id, OWN, 1.0)
    choices = proposal_of(client, campaign_id)["choices"]
    assert [(choice["kind"], choice["gains"], choice["proposed"]) for choice in choices] == [
        ("repeat", OWN, True),
        ("baseline", FIRST, False),
    ]


@pytest.mark.complete
def test_a_variant_is_refused_when_its_gains_are_not_those_shown(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    create_flown_trial(client, database, campaign_id)
    body = {"variant": "repeat", "gains": OWN}
    refused = client.post(f"/api/campaigns/{campaign_id}/trials", json=body)
    assert (refused.status_code, refused.json()["detail"]) == (
        409,
        "The gains of the repeat have changed since they were shown.",
    )
    planned = create_trial(client, campaign_id, variant="repeat", gains=FIRST)
    assert (planned["kind"], planned["gains"]) == ("repeat", FIRST)


@pytest.mark.complete
def test_own_gains_are_predicted_by_the_proposals_model(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    create_flown_trial(client, database, campaign_id, 6.0)
    proposal = proposal_of(client, campaign_id)
    _, same = consider(client, campaign_id, "prediction", proposal["gains"])
    assert (same["predicted_error"], same["interval"]) == (
        pytest.approx(proposal["predicted_error"]),
        pytest.approx(proposal["interval"]),
    )
    status, own = consider(client, campaign_id, "prediction", OWN)
    assert status == 200
    assert own["predicted_error"] != same["predicted_error"]
    assert own["interval"]["lower"] <= own["predicted_error"] <= own["interval"]["upper"]
    drawn, lower, upper = (dict(zip(own[name]["time_s"], own[name]["values"], strict=True)) for name in
                           ("curve", "lower", "upper"))  # fmt: skip
    assert min(map(len, (drawn, lower, upper))) > 20
    assert lower[max(lower)] < drawn[max(drawn)] < upper[max(upper)]


@pytest.mark.complete
def test_gains_that_were_flown_are_predicted_by_their_flights(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    flown = create_flown_trial(client, database, campaign_id, 1.5)
    _, found = consider(client, campaign_id, "prediction", FIRST)
    assert found["predicted_error"] == pytest.approx(flown["error"])
    climb = create_climb(1.5)
    at = found["curve"]["time_s"]
    assert found["curve"]["values"][10] == pytest.approx(climb["altitude_m"][round(at[10] * 50.0)], abs=0.05)


@pytest.mark.complete
def test_a_newer_flight_changes_the_prediction(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    _, before = consider(client, campaign_id, "prediction", OWN)
    create_flown_trial(client, database, campaign_id, 3.0)
    _, after = consider(client, campaign_id, "prediction", OWN)
    assert after["predicted_error"] != before["predicted_error"]


def test_without_a_model_only_flown_gains_are_predicted(client: TestClient, database: Database) -> None:
    definition = {"experiment": "takeoff-px4", "strategy": "manual", **PATIENT}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    gains = proposal_of(client, campaign["id"])["gains"]
    status, found = consider(client, campaign["id"], "prediction", gains)
    assert (status, found["predicted_error"], found["curve"]) == (200, None, None)


@pytest.mark.complete
def test_the_gate_judges_gains_before_they_are_planned(client: TestClient, database: Database) -> None:
    campaign_id = create_ready_campaign(client, database)["id"]
    status, gate = consider(client, campaign_id, "gate", OWN)
    assert (status, gate["passed"]) == (200, True)
    _, gate = consider(client, campaign_id, "gate", {**OWN, "kp": 4001})
    [refused] = [check for check in gate["checks"] if check["name"] == "bounds"]
    assert (refused["passed"], refused["gain"], refused["offer"]["kp"] <= 4000) == (False, "kp", True)
    assert get(client, f"/api/campaigns/{campaign_id}/trials")["total"] == 0


@pytest.mark.parametrize("what", ["prediction", "gate"])
def test_incomplete_gains_and_half_counts_are_refused_with_the_field(
    client: TestClient, database: Database, what: str
) -> None:
    campaign_id = create_ready_campaign(client, database)["id"]
    status, problem = consider(client, campaign_id, what, {"kp": 400.5, "ki": 20})
    assert status == 422
    assert [one["field"] for one in problem["problems"]] == ["gains.kd", "gains.kp"]


def test_a_prediction_keeps_its_model_though_other_histories_replace_it_meanwhile(
    client: TestClient, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign_id = create_ready_campaign(client, database, definition=PATIENT)["id"]
    create_flown_trial(client, database, campaign_id, 6.0)
    cache, read = PredictorCache(), history.flights_of
    first = predict_gains(database, cache, campaign_id, OWN)
    assert first.predicted_error is not None

    def replaced(*args: Any, **options: Any) -> Any:
        for other in range(2 * KEPT):
            cache.get(f"history {other}", lambda: None)
        return read(*args, **options)

    monkeypatch.setattr(history, "flights_of", replaced)
    assert predict_gains(database, cache, campaign_id, OWN) == first
