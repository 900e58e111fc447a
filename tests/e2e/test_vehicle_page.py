"""What a vehicle's page draws of its wear and its batteries, against the API: one drone that was flown elsewhere and
has worn since it was tuned, and a simulation whose battery sags."""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, expect

from tests.builders import csv_of
from tests.core.flying import TAKEOFF, TWIN
from tests.e2e.conftest import Opener, Server, served
from tests.e2e.dashboard import PHONE, TABLET, Dashboard, Theme, Viewport
from tests.e2e.test_pages import RULES

Json = dict[str, Any]
WORN: Final = (0.68, *TWIN[1:])
"""Needs more throttle to hover than the twin: heavier, or with worn propellers."""
CALIBRATION, BATTERIES = "Calibration over the flights", "Batteries"


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with served(tmp_path_factory.mktemp("wear") / "data") as one:
        yield one


@pytest.fixture(scope="module")
def tab(server: Server, browser: Browser) -> Iterator[Dashboard]:
    """A tab that is only used for the API."""
    context = browser.new_context()
    yield Dashboard(context.new_page(), server.url)
    context.close()


@pytest.fixture(scope="module")
def worn(tab: Dashboard) -> int:
    """Tuned in one campaign of two flights, flown once more after it has worn."""
    upload_flights(tab, 2, TWIN)
    return vehicle_of(tab, upload_flights(tab, 1, WORN))


@pytest.fixture(scope="module")
def sagging(tab: Dashboard) -> int:
    """A simulation that has flown twice."""
    vehicle = {"kind": "twin", "options": {"battery_sag": 0.08}}
    definition = {"strategy": "calibrated", "stop": {"kind": "budget", "max_flights": 4}}
    order = {"name": "Sagging", "vehicle": vehicle, "definition": definition}
    campaign_id: int = tab.post("/campaigns", order)["id"]
    tab.fly_headless(campaign_id, 2)
    return vehicle_of(tab, campaign_id)


def upload_flights(dashboard: Dashboard, flights: int, model: Sequence[float]) -> int:
    """A campaign that ends with two flights, so many of which were made by `model` elsewhere."""
    campaign_id = dashboard.create("import", strategy="calibrated", stop={"kind": "budget", "max_flights": 2})
    for _ in range(flights):
        upload_flight(dashboard, campaign_id, model)
    return campaign_id


def upload_flight(dashboard: Dashboard, campaign_id: int, model: Sequence[float]) -> None:
    """The proposed gains, flown elsewhere by `model`; and the next gains, which have its calibration."""
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    trial = dashboard.post(f"/campaigns/{campaign_id}/trials", {"proposal_id": proposal["id"]})
    flown = TAKEOFF.simulate(TAKEOFF.space.vector(proposal["gains"]), np.array(model)).as_stored()
    content = csv_of({"time_s": flown.time_s, "altitude_m": flown.channels["altitude_m"]})
    answer = dashboard.page.request.post(f"{dashboard.url}/api/trials/{trial['id']}/trajectory", data=content,
                                         headers={"Content-Type": "text/csv"})  # fmt: skip
    assert answer.ok, answer.text()

    def is_judged() -> bool:
        found = dashboard.get(f"/campaigns/{campaign_id}/proposal")
        return bool(found["state"] == "ready" and found["proposal"]["id"] != proposal["id"])

    dashboard.until(is_judged)


def vehicle_of(dashboard: Dashboard, campaign_id: int) -> int:
    return int(dashboard.get(f"/campaigns/{campaign_id}")["vehicle"]["id"])


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


def test_the_chart_of_a_worn_vehicle_has_the_calibrations_and_the_page_says_what_changed(
    open_dashboard: Opener, server: Server, worn: int
) -> None:
    dashboard = open_dashboard(server.url)
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


def test_the_chart_of_the_batteries_has_the_voltages_of_the_flights(
    open_dashboard: Opener, server: Server, sagging: int
) -> None:
    dashboard = open_dashboard(server.url)
    dashboard.open(f"/vehicles/{sagging}")
    expect(dashboard.plot(BATTERIES)).to_be_visible()
    [campaign] = [one for one in dashboard.get("/campaigns")["items"] if one["vehicle"]["id"] == sagging]
    flights = [dashboard.get(f"/trials/{trial['id']}")["flight"] for trial in dashboard.trials(campaign["id"])]
    [drawn] = dashboard.traces(BATTERIES)
    ends = ("battery_v_before", "battery_v_after")
    assert drawn["x"] == [x for number in range(1, len(flights) + 1) for x in (number, number, None)]
    assert drawn["y"] == [voltage for one in flights for voltage in (*(one[end] for end in ends), None)]
    assert all(one["battery_v_after"] < one["battery_v_before"] for one in flights)


def test_a_flight_elsewhere_is_drawn_while_the_page_is_open(
    open_dashboard: Opener, server: Server, sagging: int
) -> None:
    dashboard = open_dashboard(server.url)
    dashboard.open(f"/vehicles/{sagging}")
    expect(dashboard.plot(BATTERIES)).to_be_visible()
    [campaign] = [one for one in dashboard.get("/campaigns")["items"] if one["vehicle"]["id"] == sagging]
    dashboard.when_ready(campaign["id"])
    proposal = dashboard.get(f"/campaigns/{campaign['id']}/proposal")["proposal"]
    flown = dashboard.fly_headless_body(campaign["id"], {"proposal_id": proposal["id"]})["number"]
    dashboard.until(lambda: flown in dashboard.traces(BATTERIES)[0]["x"])
    dashboard.until(lambda: flown in drawn_calibrations(dashboard)["hover_throttle"][0])


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [TABLET, PHONE], ids=["tablet", "phone"])
def test_the_page_of_a_worn_vehicle_can_be_read_by_everybody(
    open_dashboard: Opener, server: Server, worn: int, theme: Theme, size: Viewport
) -> None:
    dashboard = open_dashboard(server.url, theme=theme, viewport=size)
    dashboard.open(f"/vehicles/{worn}")
    expect(dashboard.plot(CALIBRATION)).to_have_attribute("data-drawn", "true")
    expect(dashboard.page.get_by_text("Re-tune due.")).to_be_visible()
    found = Axe().run(dashboard.page, options={"runOnly": {"type": "tag", "values": RULES}})
    assert found.violations_count == 0, found.generate_report()
    assert dashboard.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
