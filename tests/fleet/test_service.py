"""Vehicles: registered when first wanted, with safe gains, and a ledger of every gain set that they were given."""

import pytest
from fastapi.testclient import TestClient

from app.core.errors import InputError
from app.db.session import Database
from app.fleet.service import registered_for
from tests.builders import create_campaign, get
from tests.fleet.vehicles import register

DEFAULT_GAINS = {"kp": 283, "ki": 13, "kd": 82}


def test_a_vehicle_is_registered_when_the_first_campaign_wants_it(client: TestClient) -> None:
    assert get(client, "/api/vehicles") == {"items": [], "total": 0, "next_cursor": None}
    first, second = create_campaign(client), create_campaign(client)
    assert first["vehicle"]["id"] == second["vehicle"]["id"]
    (vehicle,) = get(client, "/api/vehicles?limit=1")["items"]
    assert (vehicle["kind"], vehicle["state"], vehicle["is_real"]) == ("twin", "ready", False)
    assert vehicle["safe_gains"] == DEFAULT_GAINS
    assert vehicle["actions"] == ["fly"]


def test_a_vehicle_that_flies_elsewhere_cannot_be_flown(client: TestClient) -> None:
    vehicle = create_campaign(client, vehicle="import")["vehicle"]
    assert (vehicle["can_fly"], vehicle["state"]) == (False, "disconnected")
    assert get(client, f"/api/vehicles/{vehicle['id']}")["actions"] == []


def test_the_options_of_a_vehicle_belong_to_the_campaign(client: TestClient) -> None:
    def with_scatter(scatter: float) -> object:
        return {"name": "Test", "vehicle": {"kind": "twin", "options": {"scatter": scatter}}}

    calm, windy = (client.post("/api/campaigns", json=with_scatter(scatter)).json() for scatter in (0.0, 2.0))
    assert calm["vehicle"]["options"]["scatter"] == 0.0
    assert windy["vehicle"]["options"]["scatter"] == 2.0
    assert set(calm["vehicle"]["options"]) == set(windy["vehicle"]["options"])


def test_an_experiment_is_flown_by_the_named_vehicle_or_the_last_registered_one(
    client: TestClient, database: Database
) -> None:
    options = {"autopilot": "px4", "simulated": True}
    first = register(client, "First", options=options)["id"]
    register(client, "Paparazzi")
    with database.read() as session:
        assert registered_for(session, "altitude-steps-px4", None).id == first
    second = register(client, "Second", options=options)["id"]
    refused = {
        ("altitude-steps-px4", None): f"must be given: First ({first}), Second ({second}) fly 'altitude-steps-px4'",
        ("altitude-steps-ardupilot", None): "no registered vehicle flies 'altitude-steps-ardupilot'",
        ("altitude-steps-px4", 99): "99 is not registered",
    }
    with database.read() as session:
        assert registered_for(session, "altitude-steps-px4", second).id == second
        for (experiment, vehicle_id), reason in refused.items():
            with pytest.raises(InputError) as raised:
                registered_for(session, experiment, vehicle_id)
            assert [(each.field, each.reason) for each in raised.value.problems] == [("vehicle", reason)]
