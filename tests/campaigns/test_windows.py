"""A takeoff with another scored window, from its definition to its flights, figures and statistics."""

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.core.clock import REAL_TIME
from app.db.session import Database
from tests.builders import Json, claim, create_csv, create_imported_trial, create_ready_campaign, create_trial, get

WINDOW_S = 12.0
SHORT: Json = {"experiment_options": {"window_s": WINDOW_S}}


def test_a_flight_is_flown_as_long_as_the_window_of_its_campaign_needs(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition=SHORT)
    create_trial(client, campaign["id"], fly={"speed": None})
    request = claim(database)
    assert request.configured_experiment.window_s == WINDOW_S
    assert request.options(REAL_TIME).record_s == pytest.approx(WINDOW_S + 0.4)


def test_a_record_is_scored_drawn_and_judged_over_the_window(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=SHORT)
    path = f"/api/campaigns/{campaign['id']}"
    flown = create_imported_trial(client, campaign["id"], create_csv(until_s=WINDOW_S + 0.5))
    assert flown["state"] == "valid"
    assert flown["error"] == pytest.approx(3.0 * (1.0 - float(np.exp(-WINDOW_S))) / WINDOW_S, abs=1e-3)
    figure = get(client, f"{path}/figures/takeoffs")["figure"]
    [set_point] = [trace for trace in figure["data"] if trace["name"] == "Set point"]
    assert max(set_point["x"]) == pytest.approx(WINDOW_S, abs=0.01)
    assert get(client, f"{path}/statistics")["sigma"] == pytest.approx(0.0105 * 32.6 / WINDOW_S)


def test_a_log_shorter_than_the_window_does_not_count_and_says_why(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="import", definition=SHORT)
    flown = create_imported_trial(client, campaign["id"], create_csv(until_s=10.0), invalid=True)
    assert (flown["state"], flown["error"]) == ("invalid", None)
    assert flown["reason"] == "the record covers 0 … 10 s; 0 … 12 s after the command are needed"
