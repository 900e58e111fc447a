"""What a vehicle's campaigns tell of it, over HTTP: campaigns with the calibrated model on one shared simulation, whose
flights the simple model makes with its own parameters."""

import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import pytest
from fastapi.testclient import TestClient
from sqlalchemy import select

from app.common.states import FlightState
from app.core.records.trajectory import Trajectory
from app.db.models import FlightRow
from app.db.session import Database
from app.vehicles.base import FlightRecord
from tests.builders import create_ready_campaign, get, land, lift_off, run_jobs
from tests.core.tuning.flying import TAKEOFF, TWIN, compiled_only

pytestmark = compiled_only

Json = dict[str, Any]
WORN: Final = (0.68, *TWIN[1:])
"""Needs more throttle to hover than the twin: heavier, or with worn propellers."""


def record(gains: Json, model: Sequence[float], sag_v: float) -> FlightRecord:
    """A takeoff of `model`, from 12 V down by `sag_v` on the way."""
    flown = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array(model)).as_stored()
    voltage = np.linspace(12.0, 12.0 - sag_v, flown.time_s.size)
    trajectory = Trajectory(flown.time_s, {**flown.channels, "battery_v": voltage}, "test", "vehicle")
    return FlightRecord(trajectory=trajectory, ending="completed")


def fly_campaign(
    client: TestClient,
    database: Database,
    model: Sequence[float] = TWIN,
    *,
    flights: int = 2,
    sag_v: float = 0.5,
    **options: float,
) -> Json:
    """A campaign that ends with so many flights, as it then is."""
    definition = {"strategy": "calibrated", "stop": {"kind": "budget", "max_flights": flights}}
    choice = {"kind": "twin", "options": options}
    made = client.post("/api/campaigns", json={"name": "Test", "vehicle": choice, "definition": definition})
    assert made.status_code == 201, made.text
    run_jobs(database)
    path = f"/api/campaigns/{made.json()['id']}"
    for _ in range(flights):
        proposal = get(client, f"{path}/proposal")["proposal"]
        flown = client.post(f"{path}/trials", json={"proposal_id": proposal["id"], "fly": {"speed": None}})
        assert flown.status_code == 201, flown.text
        land(database, lift_off(database), record(proposal["gains"], model, sag_v))
        run_jobs(database)
    over: Json = get(client, path)
    assert over["state"] == "finished", over
    return over


def about(client: TestClient, campaign: Json, what: str) -> Json:
    found: Json = get(client, f"/api/vehicles/{campaign['vehicle']['id']}/{what}")
    return found


@pytest.mark.complete
def test_the_findings_of_the_proposal_follow_each_flight(client: TestClient, database: Database) -> None:
    campaign = fly_campaign(client, database)
    known = about(client, campaign, "calibration")
    latest = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    assert [one["flight"] for one in known["estimates"]] == [1, 2]
    assert known["estimates"][-1]["proposal_id"] == latest["id"]
    said = {one["name"]: one for one in latest["explanation"]["fitted"]}
    fitted = known["estimates"][-1]["fitted"]
    assert [one["name"] for one in fitted] == ["hover_throttle", "start_latency_s", "motor_lag_s", "drag_1_s"]
    for one in fitted:
        assert one == {field: said[one["name"]][field] for field in one}
    assert known["retune"]["since"] == 2
    assert not known["retune"]["due"]

    card = about(client, campaign, "figures/calibration")
    for drawn, one in zip(card["figure"]["data"], fitted, strict=True):
        assert drawn["meta"]["parameter"] == one["name"]
        assert (drawn["x"], drawn["y"][-1]) == ([1, 2], one["value"])
        assert drawn["error_y"]["array"][-1] == pytest.approx(1.96 * one["standard_error"])
    assert {shape["x0"] for shape in card["figure"]["layout"]["shapes"]} == {2}


@pytest.mark.complete
def test_a_vehicle_that_needs_more_throttle_than_when_it_was_tuned_is_due(
    client: TestClient, database: Database
) -> None:
    tuned = fly_campaign(client, database)
    definition = {"strategy": "calibrated"}
    later = create_ready_campaign(client, database, definition=definition)
    assert not about(client, tuned, "calibration")["retune"]["due"]
    proposal = get(client, f"/api/campaigns/{later['id']}/proposal")["proposal"]
    order = {"proposal_id": proposal["id"], "fly": {"speed": None}}
    assert client.post(f"/api/campaigns/{later['id']}/trials", json=order).status_code == 201
    land(database, lift_off(database), record(proposal["gains"], WORN, 0.5))
    run_jobs(database)

    known = about(client, tuned, "calibration")
    was, is_now = (
        {one["name"]: one for one in known["estimates"][place]["fitted"]}["hover_throttle"] for place in (1, -1)
    )
    before, now = was["value"], is_now["value"]
    assert (before, now) == (pytest.approx(TWIN[0], abs=0.01), pytest.approx(WORN[0], abs=0.01))
    retune = known["retune"]
    assert (retune["due"], retune["since"]) == (True, 2)
    assert "hover_throttle" in retune["drifted"]
    told = re.search(r"hover throttle from (\S+) ± (\S+) to (\S+) ± (\S+) of full", retune["sentence"])
    assert told is not None
    fitted = (before, was["standard_error"], now, is_now["standard_error"])
    assert [float(number) for number in told.groups()] == pytest.approx(fitted, rel=0.05)
    assert retune["sentence"] in about(client, tuned, "figures/calibration")["summary"]


@pytest.mark.complete
def test_a_finished_campaign_tunes_it_again(client: TestClient, database: Database) -> None:
    fly_campaign(client, database)
    again = fly_campaign(client, database, WORN)
    retune = about(client, again, "calibration")["retune"]
    assert (retune["due"], retune["since"]) == (False, 4)


@pytest.mark.complete
def test_a_simulation_with_other_settings_is_another_vehicle(client: TestClient, database: Database) -> None:
    first = fly_campaign(client, database)
    other = fly_campaign(client, database, WORN, flights=1, battery_sag=0.05)
    assert first["vehicle"]["id"] == other["vehicle"]["id"]
    known = about(client, first, "calibration")
    assert {one["campaign_id"] for one in known["estimates"]} == {other["id"]}
    assert (known["retune"]["due"], known["retune"]["since"]) == (False, 1)


@pytest.mark.complete
def test_the_batteries_stand_as_the_flights_have_them(client: TestClient, database: Database) -> None:
    campaign = fly_campaign(client, database, sag_v=0.75)
    with database.write() as session:
        row = session.scalars(select(FlightRow)).first()
        assert row is not None
        columns = {one.key: getattr(row, one.key) for one in FlightRow.__table__.columns if one.key != "id"}
        session.add(FlightRow(**columns | {"state": FlightState.CANCELLED}))
    trials = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    flights = [get(client, f"/api/trials/{trial['id']}")["flight"] for trial in trials]
    card = about(client, campaign, "figures/batteries")
    rows = card["table"]["rows"]
    assert rows == [
        [place, "no label", flight["battery_v_before"], flight["battery_v_after"]]
        for place, flight in enumerate(flights, start=1)
    ]
    assert all(row[2] - row[3] == pytest.approx(0.75, abs=0.1) for row in rows)


def test_of_a_vehicle_that_has_not_flown_nothing_is_known(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database, definition={"strategy": "calibrated"})
    known = about(client, campaign, "calibration")
    assert (known["estimates"], known["retune"]["due"], known["retune"]["since"]) == ([], False, None)
    assert [about(client, campaign, f"figures/{name}")["state"] for name in ("calibration", "batteries")] == [
        "waiting",
        "waiting",
    ]


def test_unknown_vehicles_and_figures_are_refused(client: TestClient, database: Database) -> None:
    for what in ("calibration", "figures/calibration", "figures/batteries"):
        assert client.get(f"/api/vehicles/999/{what}").status_code == 404
    campaign = create_ready_campaign(client, database)
    assert client.get(f"/api/vehicles/{campaign['vehicle']['id']}/figures/hearts").status_code == 422
