"""Flights side by side over HTTP, with known errors in a real database; the verdicts have tests of their own."""

import csv
import io
from collections.abc import Sequence
from typing import Any

import httpx2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from scipy import stats

from app.db.session import Database
from tests.builders import (
    Json,
    climb_error,
    create_climb,
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
)

LONG: Json = {"strategy": "manual", "stop": {"kind": "budget", "max_flights": 50}}
FIRST = {"kp": 283, "ki": 13, "kd": 82}
OTHER = {"kp": 300, "ki": 60, "kd": 82}
PRIOR_SD_M, PRIOR_FREEDOM = 0.0105, 4.0
"""What the takeoff experiment knows of its scatter before any flight."""


def create(client: TestClient, database: Database, name: str = "Test", **fields: Any) -> int:
    campaign = create_ready_campaign(client, database, name=name, definition=LONG, **fields)
    return int(campaign["id"])


def fly(
    client: TestClient, database: Database, campaign_id: int, settling_s: float, gains: Json = FIRST, **record: Any
) -> int:
    return int(fly_trial(client, database, campaign_id, create_record(settling_s, **record), gains=gains)["id"])


def address(trial_ids: Sequence[int], what: str = "") -> str:
    return f"/api/compare{what}?" + "&".join(f"trial={trial_id}" for trial_id in trial_ids)


def refusal(client: TestClient, trial_ids: Sequence[int], what: str = "") -> dict[str, str]:
    answer: httpx2.Response = client.get(address(trial_ids, what))
    assert answer.status_code == 422, answer.text
    return problems_of(answer)


def t_test(own: Sequence[float], other: Sequence[float], *more: Sequence[float]) -> tuple[float, float, float]:
    """Difference, its standard error and the confidence in its direction, by the pooled t test with the prior."""
    groups = [np.array(one) for one in (own, other, *more)]
    freedom = PRIOR_FREEDOM + sum(len(one) - 1 for one in groups)
    squares = PRIOR_FREEDOM * PRIOR_SD_M**2 + sum(float(one.var()) * len(one) for one in groups)
    standard_error = (squares / freedom * (1 / len(own) + 1 / len(other))) ** 0.5
    difference = float(groups[0].mean() - groups[1].mean())
    return difference, standard_error, float(stats.t(freedom).cdf(abs(difference) / standard_error))


@pytest.mark.complete
def test_a_pair_is_compared_as_on_the_page_of_its_campaign(client: TestClient, database: Database) -> None:
    campaign = create(client, database)
    first = [fly(client, database, campaign, settling_s) for settling_s in (1.0, 1.2)]
    other = [fly(client, database, campaign, settling_s, OTHER) for settling_s in (0.5, 0.6, 0.55)]
    found = get(client, address([first[0], other[1]]))
    (pair,) = found["pairs"]
    assert (pair["trial_id"], pair["against_id"], pair["basis"]) == (other[1], first[0], "gains")
    assert (found["verdict"], pair["verdict"], pair["further"]) == ("better", "better", None)
    assert found["sentence"].startswith("Flight 4 (kp 300, ki 60, kd 82; 3 flights) is better than flight 1")
    assert [flight["label"] for flight in found["flights"]] == ["A", "B"]
    trial = get(client, f"/api/trials/{other[1]}")
    assert found["flights"][1]["group"] == trial["group"]
    (told,) = trial["comparisons"]
    assert {key: pair[key] for key in ("verdict", "confidence", "difference", "standard_error")} == {
        key: told[key] for key in ("verdict", "confidence", "difference", "standard_error")
    }


def test_the_sentence_and_the_table_allow_for_the_choice_of_the_best(client: TestClient, database: Database) -> None:
    """Observed defect: the best flight had one confidence in the sentence, and a higher one in the table."""
    campaign = create(client, database)
    trials = [
        fly(client, database, campaign, settling_s, {**FIRST, "ki": ki})
        for settling_s, ki in ((1.0, 13), (0.75, 40), (0.95, 60))
    ]
    found = get(client, address(trials))
    (alone,) = get(client, address(trials[:2]))["pairs"]
    pair = next(one for one in found["pairs"] if one["trial_id"] == trials[1])
    assert (alone["verdict"], pair["verdict"], found["verdict"]) == ("better", "unresolved", "unresolved")
    assert pair["confidence"] == pytest.approx(1.0 - 2.0 * (1.0 - alone["confidence"]))
    assert found["sentence"].startswith("Flight 2 is the lowest of 3 gain sets")
    assert found["sentence"].endswith(pair["sentence"])
    further = pair["further"]
    assert f"{further['trial']} with the gains of flight 2 and {further['against']} with" in pair["sentence"]


@pytest.mark.complete
def test_only_what_differs_is_listed_with_its_change_against_the_first(client: TestClient, database: Database) -> None:
    plain = create(client, database, "Plain")
    body = {"name": "Heavier", "vehicle": {"kind": "twin", "options": {"hover_throttle": 0.65}}}
    heavier = client.post(f"/api/campaigns/{plain}/clone", json=body).json()["id"]
    run_jobs(database)
    trials = [fly(client, database, plain, 1.0), fly(client, database, heavier, 0.9, OTHER)]
    found = get(client, address(trials))
    gains = {one["title"]: (one["values"], one["changes"]) for one in found["gains"]}
    assert gains == {"kp": ([283, 300], [0, 17]), "ki": ([13, 60], [0, 47])}
    (hover,) = found["settings"]
    assert (hover["title"], hover["unit"], hover["values"]) == ("Hover throttle", "of full throttle", [0.61, 0.65])
    assert hover["changes"] == [0, pytest.approx(0.04)]
    assert found["verdict"] is None
    assert found["notes"][0].startswith("One vehicle with different settings.")


@pytest.mark.complete
def test_campaigns_of_one_vehicle_share_their_scatter(client: TestClient, database: Database) -> None:
    one, two = create(client, database, "Morning"), create(client, database, "Evening")
    first = [fly(client, database, one, settling_s) for settling_s in (1.0, 1.1)]
    other = [fly(client, database, two, settling_s, OTHER) for settling_s in (0.7, 0.9)]
    found = get(client, address([first[0], other[0]]))
    difference, standard_error, confidence = t_test(
        [climb_error(0.7), climb_error(0.9)], [climb_error(1.0), climb_error(1.1)]
    )
    (pair,) = found["pairs"]
    assert pair["difference"] == pytest.approx(difference, abs=1e-4)
    assert pair["standard_error"] == pytest.approx(standard_error, rel=1e-3)
    assert pair["confidence"] == pytest.approx(confidence, abs=1e-4)
    assert "Flight 1 of Evening" in found["sentence"]
    assert "2 campaigns of the same vehicle" in found["notes"][0]


@pytest.mark.complete
def test_between_vehicles_there_is_a_difference_and_no_verdict(client: TestClient, database: Database) -> None:
    twin, windy = create(client, database), create(client, database, vehicle="jsbsim")
    trials = [fly(client, database, twin, 1.0), fly(client, database, windy, 0.5, OTHER)]
    found = get(client, address(trials))
    (pair,) = found["pairs"]
    assert (found["verdict"], pair["verdict"], pair["basis"]) == (None, None, "apart")
    assert pair["difference"] == pytest.approx(climb_error(0.5) - climb_error(1.0), abs=1e-4)
    assert pair["standard_error"] == pytest.approx(2**0.5 * PRIOR_SD_M, rel=1e-3)
    assert found["sentence"].startswith("No verdict on the gains")
    assert found["notes"][0].startswith("Different vehicles (")
    vehicles = next(one for one in found["settings"] if one["title"] == "Vehicle")
    assert len(set(vehicles["values"])) == 2
    assert "(campaign" in found["flights"][0]["name"], "two campaigns of one name are told apart"


@pytest.mark.complete
def test_flights_made_elsewhere_are_not_taken_for_those_of_one_vehicle(client: TestClient, database: Database) -> None:
    campaigns = [create_ready_campaign(client, database, vehicle="import")["id"] for _ in range(2)]
    trials = [create_imported_trial(client, campaign)["id"] for campaign in campaigns]
    (note,) = get(client, address(trials))["notes"]
    assert note.startswith("Flights flown elsewhere: it is unknown whether the same vehicle")


@pytest.mark.complete
def test_a_flight_without_an_error_stands_beside_the_others_without_a_verdict(
    client: TestClient, database: Database
) -> None:
    campaign = create(client, database)
    valid = fly(client, database, campaign, 1.0)
    aborted = fly(client, database, campaign, 1.0, OTHER, ending="aborted", reason="too high", until_s=3.0)
    found = get(client, address([valid, aborted]))
    assert [flight["state"] for flight in found["flights"]] == ["valid", "aborted"]
    assert (found["flights"][1]["error"], found["flights"][1]["group"]) == (None, None)
    assert found["pairs"][0]["sentence"] == "Flight 2 is aborted: it has no error that counts."
    assert found["sentence"].startswith("No verdict")


@pytest.mark.complete
def test_curves_and_csv_are_the_stored_records(client: TestClient, database: Database) -> None:
    campaign = create(client, database)
    trials = [fly(client, database, campaign, 1.0), fly(client, database, campaign, 0.5, OTHER)]
    card = get(client, address(trials, "/figure") + "&theme=dark")
    assert card["state"] == "ready", card["reason"]
    drawn = {(one["meta"]["role"], one["meta"].get("trial")): one for one in card["figure"]["data"]}
    for trial_id, settling_s in zip(trials, (1.0, 0.5), strict=True):
        curve, flown = drawn["flight", trial_id], create_climb(settling_s)
        np.testing.assert_allclose(curve["y"], np.interp(curve["x"], flown.time_s, flown["altitude_m"]), atol=2e-3)
    answer = client.get(address(trials, "/curves.csv"))
    name = f"compare-campaign-{campaign}-flights-1-2.csv"
    assert answer.headers["content-disposition"] == f'attachment; filename="{name}"'
    rows = list(csv.DictReader(io.StringIO(answer.text)))
    assert list(rows[0]) == [
        "time_s", "set_point_m", f"campaign_{campaign}_flight_1_altitude_m", f"campaign_{campaign}_flight_2_altitude_m"
    ]  # fmt: skip
    time_s = np.array([float(row["time_s"]) for row in rows])
    np.testing.assert_allclose(np.diff(time_s), 0.02, atol=1e-9)
    second = np.array([float(row[f"campaign_{campaign}_flight_2_altitude_m"]) for row in rows])
    np.testing.assert_allclose(second, 3.0 - 3.0 * np.exp(-time_s / 0.5), atol=1e-4)


def test_what_cannot_be_compared_is_named_by_its_place(client: TestClient, database: Database) -> None:
    campaign = create(client, database)
    flown = fly(client, database, campaign, 1.0)
    planned = create_trial(client, campaign, gains=OTHER)["id"]
    for what in ("", "/figure", "/curves.csv"):
        said = refusal(client, [flown, planned, 999, flown], what)
        assert said.keys() == {"trial.1", "trial.2", "trial.3"}
        assert "has not flown: it is planned" in said["trial.1"]
        assert "there is no trial 999" in said["trial.2"]
        assert "listed twice" in said["trial.3"]
    assert "at least 2 items" in refusal(client, [flown])["trial"]
    assert "at most 20 items" in refusal(client, range(1, 22))["trial"]


@pytest.mark.complete
def test_errors_over_different_windows_are_refused_by_name(client: TestClient, database: Database) -> None:
    paper = fly(client, database, create(client, database), 1.0)
    named, shorter = (
        create_ready_campaign(client, database, definition={**LONG, "experiment_options": {"window_s": window_s}})["id"]
        for window_s in (32.6, 20.0)
    )
    same, other = fly(client, database, named, 1.0), fly(client, database, shorter, 1.0)
    assert refusal(client, [paper, other]) == {
        "trial.1": f"the error of flight 1 of campaign {shorter} covers a window of 20 s, that of flight 1 of campaign "
        "1 one of 32.6 s: the errors are different quantities"
    }
    assert get(client, address([paper, same]))["pairs"][0]["basis"] == "repeats"


@pytest.mark.complete
def test_errors_in_different_units_are_refused_by_name(client: TestClient, database: Database) -> None:
    takeoff = fly(client, database, create(client, database), 1.0)
    pitch = create_ready_campaign(
        client, database, vehicle="lti", definition={"experiment": "pitch-tracking", "strategy": "identified"}
    )
    trial = create_trial(client, pitch["id"], fly={"speed": None})
    land(database, lift_off(database), create_record(1.0))
    said = refusal(client, [takeoff, trial["id"]])
    assert said.keys() == {"trial.1"}
    assert "is in rad·s, that of flight 1" in said["trial.1"]
