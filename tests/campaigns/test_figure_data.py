"""The figures over HTTP: what is stored is what is drawn."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from scipy.stats import t

from app.db.session import Database
from tests.builders import (
    climb_error,
    create_climb,
    create_flown_campaign,
    create_imported_trial,
    create_ready_campaign,
    create_record,
    csv_of,
    fly_trial,
    get,
)

Json = dict[str, Any]


def traces(client: TestClient, path: str) -> list[Json]:
    card = get(client, path)
    assert card["state"] == "ready", card["reason"]
    drawn: list[Json] = card["figure"]["data"]
    return drawn


def trace(drawn: list[Json], role: str, **meta: object) -> Json:
    [found] = [one for one in drawn if one["meta"].items() >= {"role": role, **meta}.items()]
    return found


@pytest.fixture
def campaign_id(client: TestClient, database: Database) -> int:
    """A campaign with two flights, the second one better."""
    return int(create_flown_campaign(client, database, 2.0, 1.0)["id"])


def test_the_takeoff_curves_are_the_stored_records(client: TestClient, campaign_id: int) -> None:
    drawn = traces(client, f"/api/campaigns/{campaign_id}/figures/takeoffs")
    for number, settling_s in ((1, 2.0), (2, 1.0)):
        curve = trace(drawn, "flight", trial=number)
        flown = create_climb(settling_s)
        np.testing.assert_allclose(curve["y"], np.interp(curve["x"], flown.time_s, flown["altitude_m"]), atol=2e-3)
    assert trace(drawn, "flight", trial=2)["meta"]["standing"] == "best"
    assert set(trace(drawn, "target")["y"]) == {3.0}
    assert trace(drawn, "reference")["y"][-1] == pytest.approx(3.0, abs=0.01)


def test_the_prediction_of_the_next_flight_is_drawn_until_it_has_flown(client: TestClient, database: Database) -> None:
    path = f"/api/campaigns/{create_ready_campaign(client, database)['id']}"
    predicted = trace(traces(client, f"{path}/figures/takeoffs"), "prediction")
    assert (predicted["name"], predicted["line"]["dash"]) == ("Model, not calibrated", "dash")
    assert 3.0 < max(predicted["y"]) < 4.0


def test_errors_and_gains_are_those_of_the_trials(client: TestClient, campaign_id: int) -> None:
    trials = get(client, f"/api/campaigns/{campaign_id}/trials")["items"]
    measured = trace(traces(client, f"/api/campaigns/{campaign_id}/figures/errors"), "measured")
    assert measured["y"] == pytest.approx([trial["error"] for trial in trials], abs=1e-6)
    gains = traces(client, f"/api/campaigns/{campaign_id}/figures/gains")
    assert trace(gains, "flown", gain="ki")["y"] == [trial["gains"]["ki"] for trial in trials]


def test_the_band_holds_another_flight_of_the_best_gains(client: TestClient, database: Database) -> None:
    """90 %, by Student's t of two flights and the experiment's prior, 0.0105 m worth four degrees of freedom."""
    definition = {"strategy": "manual", "stop": {"kind": "budget", "max_flights": 50}}
    campaign_id = create_ready_campaign(client, database, definition=definition)["id"]
    for settling_s in (1.0, 1.1):
        fly_trial(client, database, campaign_id, create_record(settling_s), gains={"kp": 283, "ki": 13, "kd": 82})
    [low, _, high, *_] = trace(traces(client, f"/api/campaigns/{campaign_id}/figures/errors"), "noise")["y"]
    errors = [climb_error(1.0), climb_error(1.1)]
    sigma = np.sqrt((4 * 0.0105**2 + np.var(errors) * 2) / 5)
    half = t.ppf(0.95, 5) * sigma * np.sqrt(1.0 + 1.0 / 2.0)
    assert (low, high) == pytest.approx((np.mean(errors) - half, np.mean(errors) + half), abs=1e-4)


def test_a_flight_by_itself_is_drawn_over_the_best(client: TestClient, campaign_id: int) -> None:
    first = get(client, f"/api/campaigns/{campaign_id}/trials")["items"][0]
    drawn = traces(client, f"/api/trials/{first['id']}/figure?theme=dark")
    assert trace(drawn, "best")["name"] == "Flight 2 · best"
    assert max(trace(drawn, "flight")["y"]) == pytest.approx(create_climb(2.0)["altitude_m"].max(), abs=1e-3)


def test_an_imported_flight_shows_its_own_reference_reported_throttle_and_glitches(
    client: TestClient, database: Database
) -> None:
    """What an autopilot's log contains beside the altitude."""
    campaign = create_ready_campaign(client, database, vehicle="import")
    climb = create_climb()
    altitude_m = climb["altitude_m"].copy()
    altitude_m[500:510] += 1.0
    full = np.where((climb.time_s > 1.0) & (climb.time_s < 2.0), 1.0, 0.62)
    channels = {"altitude_m": altitude_m, "reference_m": np.minimum(climb.time_s, 3.0), "throttle": full}
    trial = create_imported_trial(client, campaign["id"], csv_of({"time_s": climb.time_s, **channels}))
    card = get(client, f"/api/trials/{trial['id']}/figure")
    drawn, layout = card["figure"]["data"], card["figure"]["layout"]
    assert trace(drawn, "reference")["y"][-1] == 3.0
    assert trace(drawn, "reference")["x"][0] == 0.0
    assert "Reported throttle" in [one["name"] for one in drawn if one["meta"]["role"] == "input"]
    saturated = trace(drawn, "saturated")["x"]
    assert (saturated[0], saturated[-1]) == (pytest.approx(1.0, abs=0.03), pytest.approx(2.0, abs=0.03))
    assert [one["text"] for one in layout["annotations"]] == ["Command", "Lift-off", "Glitch"]
    assert layout["annotations"][2]["x"] == pytest.approx(10.0, abs=0.05)


def test_throttle_reported_once_a_second_is_not_drawn_as_zero_after_the_command(
    client: TestClient, database: Database
) -> None:
    """Each report is held in the record until the next; the first one in flight came 1.3 s after the command."""
    campaign = create_ready_campaign(client, database, vehicle="import")
    climb = create_climb()
    reports = np.floor(climb.time_s + 0.7)
    throttle = np.where(climb.time_s < 1.3, 0.0, 0.6 + 0.01 * (reports % 2.0))
    channels = {"altitude_m": climb["altitude_m"], "throttle": throttle}
    trial = create_imported_trial(client, campaign["id"], csv_of({"time_s": climb.time_s, **channels}))
    figure = traces(client, f"/api/trials/{trial['id']}/figure")
    drawn = next(one for one in figure if one["name"] == "Reported throttle")
    assert not [x for x in drawn["x"] if 0.0 < x < 1.28]


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/api/campaigns/999/figures/takeoffs", 404),
        ("/api/campaigns/999/figures/landscape", 404),
        ("/api/trials/999/figure", 404),
        ("/api/campaigns/1/figures/pie", 422),
        ("/api/campaigns/1/figures/takeoffs?theme=pink", 422),
    ],
)
def test_a_figure_that_does_not_exist_is_refused(client: TestClient, path: str, status: int) -> None:
    assert client.get(path).status_code == status
