"""A campaign of the F-16 over HTTP: defined, flown, evaluated and drawn."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.db.session import Database
from app.vehicles.registry import open_vehicle
from tests.builders import create_ready_campaign, create_trial, get, land, lift_off, run_jobs
from tests.vehicles.flying import HAND, fly

DEFINITION = {
    "experiment": "pitch-tracking",
    "experiment_options": {"perturbation": 0.45, "model_seed": 50},
    "strategy": "identified",
    "start": {"kind": "simplex"},
}


@pytest.mark.complete
def test_the_second_flight_is_at_the_optimum_and_every_figure_is_drawn(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, vehicle="lti", definition=DEFINITION)
    errors: list[float] = []
    trial: dict[str, Any] = {}
    for _ in range(2):
        trial = create_trial(client, campaign["id"], fly={"speed": None})
        task = lift_off(database)
        with open_vehicle("lti", {}, safe_gains=HAND) as vehicle:
            land(database, task, fly(vehicle, task.gains))
        run_jobs(database)
        flown = get(client, f"/api/trials/{trial['id']}")
        assert flown["overshoot_m"] is None
        errors.append(flown["error"])
    assert errors[1] == pytest.approx(0.204716, abs=2e-4)
    for path in (f"campaigns/{campaign['id']}/figures/{name}" for name in ("takeoffs", "errors", "gains")):
        card = get(client, f"/api/{path}")
        assert card["state"] == "ready", card["reason"]
    card = get(client, f"/api/trials/{trial['id']}/figure")
    assert card["figure"]["layout"]["yaxis"]["title"]["text"] == "Pitch error (rad)"
    assert card["figure"]["layout"]["yaxis2"]["title"]["text"] == "Pitch and elevator (rad)"
