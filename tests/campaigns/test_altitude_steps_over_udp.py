"""A whole campaign of altitude steps over a real UDP link, flown by the simulated Paparazzi."""

from typing import Any

from fastapi.testclient import TestClient

from app.core.clock import REAL_TIME
from app.db.session import Database
from tests.builders import create_trial, get, land, lift_off, run_jobs
from tests.core.tuning.flying import compiled_only
from tests.fleet.vehicles import create_campaign_on, create_connected
from tests.vehicles.flying import SAFE, never, unwatched
from tests.vehicles.mavlink.rigs import UdpRig

Json = dict[str, Any]
DEFINITION: Json = {
    "experiment": "altitude-steps",
    "experiment_options": {"steps": 2, "step_window_s": 3.0},
    "strategy": "calibrated",
    "stop": {"kind": "budget", "max_flights": 8},
}
SPEED = 40.0


@compiled_only
def test_two_flights_over_the_link_are_scored_and_the_second_is_far_better_as_predicted(
    client: TestClient, database: Database
) -> None:
    vehicle = create_connected(client, database)
    assert vehicle["experiments"] == ["takeoff", "altitude-steps"]
    campaign = create_campaign_on(client, database, vehicle, definition=DEFINITION)
    flown = []
    with UdpRig(speed=SPEED) as rig:
        link = rig.vehicle()
        for _ in range(2):
            trial = create_trial(client, campaign["id"], fly={"speed": None})
            task = lift_off(database)
            assert link.stage(task.gains) == task.gains
            record = link.fly(task.options(REAL_TIME), on_sample=unwatched, should_stop=never)
            assert link.read_gains() == SAFE
            land(database, task, record)
            run_jobs(database)
            flown.append(get(client, f"/api/trials/{trial['id']}"))
        link.close()
    first, second = flown
    assert [first["state"], second["state"]] == ["valid", "valid"], [each["reason"] for each in flown]
    assert (first["gains"], second["gains"] != SAFE) == (SAFE, True)
    assert first["error"] > 0.3
    assert second["error"] < 0.02
    interval = second["predicted_interval"]
    assert interval["lower"] <= second["error"] <= interval["upper"]
