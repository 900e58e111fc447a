"""The sentence about a finished flight."""

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.campaigns.trials.views import verdict
from app.common.states import TrialState
from app.db.models import TrialRow
from app.db.session import Database
from app.vehicles.flight_end import Failure, FlightEnd
from tests.builders import create_csv, create_imported_trial, create_ready_campaign, create_trial, get, run_jobs, upload

PATIENT = {"stop": {"kind": "budget", "max_flights": 9}}


@pytest.mark.complete
def test_a_difference_is_shown_only_where_the_printed_errors_differ(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    for kp, settling_s in ((300, 1.0), (301, 1.0001), (302, 2.0)):
        run_jobs(database)
        trial = create_trial(client, campaign["id"], gains={"kp": kp, "ki": 13, "kd": 82})
        upload(client, trial["id"], create_csv(settling_s))
    trials = [get(client, f"/api/trials/{number}") for number in (1, 2, 3)]
    first, alike, slower = (trial["error"] for trial in trials)
    assert 0.0 < alike - first < 0.0005
    assert f"the same as the best before it (flight 1, {first:.3f} m)" in trials[1]["verdict"]
    share = 100 * (slower - first) / first
    told = f"{slower - first:.3f} m ({share:.0f}\u00a0%) higher than the best before it (flight 1, {first:.3f} m)"
    assert told in trials[2]["verdict"]


@pytest.mark.complete
def test_gains_flown_again_on_purpose_are_not_held_against_the_best(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    first = create_imported_trial(client, campaign["id"], create_csv(2.0))
    for settling_s in (2.1, 1.9):
        run_jobs(database)
        again = create_trial(client, campaign["id"], gains=first["gains"])
        upload(client, again["id"], create_csv(settling_s))
    second, third = (get(client, f"/api/trials/{number}") for number in (2, 3))
    for flight, earlier in ((second, "flight 1"), (third, "flights 1, 2")):
        predicted = f"; {flight['predicted_error']:.3f} m was predicted."
        assert flight["verdict"] == f"{flight['error']:.3f} m, repeating the gains of {earlier}{predicted}"
    assert second["predicted_error"] == pytest.approx(first["error"])


@pytest.mark.complete
def test_a_manual_strategy_that_proposes_flown_gains_repeats_them(client: TestClient, database: Database) -> None:
    definition = {**PATIENT, "strategy": "manual"}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    for settling_s in (2.0, 2.1):
        run_jobs(database)
        create_imported_trial(client, campaign["id"], create_csv(settling_s))
    second = get(client, "/api/trials/2")
    assert second["kind"] == "manual"
    assert f"{second['error']:.3f} m, repeating the gains of flight 1" in second["verdict"]


@pytest.mark.complete
def test_a_flight_is_compared_with_the_best_before_it_and_the_first_as_far_as_the_scatter_allows(
    client: TestClient, database: Database
) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=PATIENT)
    for settling_s in (2.0, 1.0, 1.001):
        run_jobs(database)
        create_imported_trial(client, campaign["id"], create_csv(settling_s))
    first, second, third = (get(client, f"/api/trials/{number}") for number in (1, 2, 3))
    assert first["comparisons"] == []
    [said] = second["comparisons"]
    assert (said["against"], said["trial_number"], said["verdict"]) == ("best before", 1, "better")
    assert said["difference"] == pytest.approx(second["group"]["mean"] - first["group"]["mean"], abs=1e-9)
    errors = [flight["group"]["standard_error"] for flight in (first, second)]
    assert said["standard_error"] == pytest.approx(np.hypot(*errors), abs=1e-9)
    assert [one["verdict"] for one in third["comparisons"] if one["against"] == "first"] == ["better"]
    same = third["gains"] == second["gains"]
    assert ("best before" in {one["against"] for one in third["comparisons"]}) is not same


def test_the_text_about_a_doubtful_flight_has_one_full_stop_after_its_reason() -> None:
    end = FlightEnd(failure=Failure.LOST_POSITION, remarks=("None of its positions was plausible for 0.5 s.",))
    row = TrialRow(number=1, state=TrialState.CAPTURED, reason="", ending="invalid", end=end, glitches=[])
    assert verdict(row, None, None, "m", again=()) == (
        "Landed and recorded; the measurement is doubtful: The vehicle's position was lost. None of its positions was "
        "plausible for 0.5 s. Review the flight."
    )
