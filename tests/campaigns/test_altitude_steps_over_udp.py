"""Whole campaigns of altitude steps over a real UDP link, flown by the simulated autopilots."""

from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.core.clock import REAL_TIME
from app.db.session import Database
from tests.builders import create_trial, get, land, lift_off, run_jobs
from tests.core.tuning.flying import compiled_only
from tests.fleet.vehicles import connect, create_campaign_on, register
from tests.vehicles.flying import never, unwatched
from tests.vehicles.mavlink.rigs import SAFE, UdpRig

Json = dict[str, Any]
SPEED = 40.0
"""The ground waits with the drone, so a busy machine makes no time-outs pass."""


def definition_of(experiment: str) -> Json:
    options = {"steps": 2, "step_window_s": 3.0}
    stop = {"kind": "budget", "max_flights": 8}
    return {"experiment": experiment, "experiment_options": options, "strategy": "calibrated", "stop": stop}


@pytest.mark.complete
@compiled_only
@pytest.mark.parametrize(
    ("autopilot", "experiment", "share"),
    [
        ("paparazzi", "altitude-steps", 0.04),
        pytest.param("ardupilot", "altitude-steps-ardupilot", 0.25, marks=pytest.mark.complete),
        pytest.param("px4", "altitude-steps-px4", 0.85, marks=pytest.mark.complete),
    ],
)
def test_two_flights_over_the_link_are_scored_and_the_second_is_better_as_predicted(
    client: TestClient, database: Database, autopilot: str, experiment: str, share: float
) -> None:
    vehicle = register(client, options={"simulated": True, "autopilot": autopilot})
    vehicle = connect(client, database, vehicle)
    assert experiment in vehicle["experiments"]
    campaign = create_campaign_on(client, database, vehicle, definition=definition_of(experiment))
    rig = UdpRig(autopilot, speed=SPEED)
    if autopilot != "paparazzi":
        rig.switch_on_failsafes()
    flown = []
    with rig:
        link = rig.vehicle()
        for _ in range(2):
            trial = create_trial(client, campaign["id"], fly={"speed": None})
            task = lift_off(database)
            assert link.stage(task.gains) == task.gains
            record = link.fly(task.options(REAL_TIME), on_sample=unwatched, should_stop=never)
            assert link.read_gains() == SAFE[autopilot]
            land(database, task, record)
            run_jobs(database)
            flown.append(get(client, f"/api/trials/{trial['id']}"))
        link.close()
    first, second = flown
    assert [first["state"], second["state"]] == ["valid", "valid"], [each["reason"] for each in flown]
    assert first["gains"] == SAFE[autopilot] != second["gains"]
    assert second["error"] < share * first["error"]
    assert second["predicted_error"] == pytest.approx(second["error"], rel=0.3)
    assert second["predicted_interval"]["lower"] < second["predicted_interval"]["upper"]
