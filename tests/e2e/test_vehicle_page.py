"""What a vehicle's page draws of its wear and its batteries, against the API: one drone that was flown elsewhere and
has worn since it was tuned, and a simulation whose battery sags."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.builders import csv_of
from tests.core.tuning.flying import TAKEOFF, TWIN
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.e2e.test_pages import LOOKS, show, violations

Json = dict[str, Any]
WORN: Final = (0.68, *TWIN[1:])
"""Needs more throttle to hover than the twin: heavier, or with worn propellers."""
CALIBRATION, BATTERIES = "Calibration history", "Batteries"


@pytest.fixture(scope="module", autouse=True)
def _no_other_flights(states: States) -> None:
    """Campaigns share their simulated vehicles, and those that are flown elsewhere."""
    states.clear()


@pytest.fixture(scope="module")
def worn(states: States) -> int:
    """Tuned in one campaign of two flights, flown once more after it has worn."""
    take_records(states, 2, TWIN)
    return states.vehicle_of(take_records(states, 1, WORN))


@pytest.fixture(scope="module")
def sagging(states: States) -> int:
    """A campaign on a simulation whose battery sags, with two flights."""
    budget = {"kind": "budget", "max_flights": 4}
    return states.campaign(name="Sagging", options={"battery_sag": 0.08}, strategy="calibrated", stop=budget, flights=2)


def take_records(states: States, flights: int, model: Sequence[float]) -> int:
    """A campaign that ends with two flights, so many of which were made by `model` elsewhere; each with the next gains,
    which have its calibration."""

    def record(gains: Mapping[str, float]) -> bytes:
        flown = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array(model)).as_stored()
        return csv_of({"time_s": flown.time_s, "altitude_m": flown.channels["altitude_m"]})

    campaign_id = states.campaign("import", strategy="calibrated", stop={"kind": "budget", "max_flights": 2})
    for _ in range(flights):
        states.take_record(campaign_id, record)
    return campaign_id


def drawn_calibrations(dashboard: Dashboard) -> dict[str, tuple[list[int], list[float], list[float]]]:
    """By parameter: flights, values, and half their 95 % intervals, as the chart has them."""
    return {one["meta"]["parameter"]: (one["x"], one["y"], one["bars"]) for one in dashboard.traces(CALIBRATION)}


def known_calibrations(dashboard: Dashboard, vehicle_id: int) -> dict[str, tuple[list[int], list[float], list[Any]]]:
    """The same from the API."""
    found: dict[str, tuple[list[int], list[float], list[Any]]] = {}
    for estimate in dashboard.get(f"/vehicles/{vehicle_id}/calibration")["estimates"]:
        for one in estimate["fitted"]:
            flights, values, reaches = found.setdefault(one["name"], ([], [], []))
            flights.append(estimate["flight"])
            values.append(one["value"])
            reaches.append(pytest.approx(1.96 * one["standard_error"]))
    return found


def test_the_page_of_a_worn_vehicle_draws_its_calibrations_and_tells_everybody_what_changed(
    dashboard: Dashboard, worn: int
) -> None:
    dashboard.open(f"/vehicles/{worn}")
    expect(dashboard.plot(CALIBRATION)).to_be_visible()
    known = known_calibrations(dashboard, worn)
    assert known["hover_throttle"][0] == [1, 2, 3]
    dashboard.until(lambda: drawn_calibrations(dashboard) == known)
    retune = dashboard.get(f"/vehicles/{worn}/calibration")["retune"]
    assert retune["since"] == 2
    said = dashboard.page.get_by_role("status").filter(has_text="Re-tune due.")
    expect(said).to_contain_text(retune["sentence"])
    expect(said).to_contain_text("hover throttle from 0.6")
    for look in LOOKS:
        show(dashboard, look)
        expect(said).to_be_visible()
        assert dashboard.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), look
        assert not look.rules or violations(dashboard.page) == [], look


def test_the_chart_of_the_batteries_has_the_voltages_of_the_flights_also_of_one_flown_meanwhile(
    dashboard: Dashboard, states: States, sagging: int
) -> None:
    dashboard.open(f"/vehicles/{states.vehicle_of(sagging)}")
    expect(dashboard.plot(BATTERIES)).to_be_visible()
    flights = [dashboard.get(f"/trials/{trial['id']}")["flight"] for trial in dashboard.trials(sagging)]
    [drawn] = dashboard.traces(BATTERIES)
    ends = ("battery_v_before", "battery_v_after")
    assert drawn["x"] == [x for number in range(1, len(flights) + 1) for x in (number, number, None)]
    assert drawn["y"] == [voltage for one in flights for voltage in (*(one[end] for end in ends), None)]
    assert all(one["battery_v_after"] < one["battery_v_before"] for one in flights)
    flown = dashboard.get(f"/trials/{states.fly(sagging)[0]}")["number"]
    dashboard.until(lambda: flown in dashboard.traces(BATTERIES)[0]["x"])
    dashboard.until(lambda: flown in drawn_calibrations(dashboard)["hover_throttle"][0])
