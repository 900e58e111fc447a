"""A whole flight-test day with a REAL vehicle as in docs/guide.md. With GAINLINE_README_IMAGE=1 it takes the guide's
pictures, of flights as long as the guide's."""

import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json, printed
from tests.e2e.flying_by_hand import (
    DRONE_SPEED,
    disconnect,
    hold_until_it_flies,
    line_of,
    register,
    see_it_fly,
    stage,
    take_control,
    word,
)
from tests.e2e.states import States
from tests.e2e.test_pages import ROOT
from tests.runtime.drones import Drone

pytestmark = pytest.mark.real_time("a drone flies in a process of its own, over real UDP", about_s=60)

PICTURES: Final = ROOT / "docs" / "images" / "day"
ARE_TAKEN: Final = bool(os.environ.get("GAINLINE_README_IMAGE"))
WINDOW_S: Final = 10
"""The shortest that may be scored: the drone flies in real time."""
NAME: Final = "Takeoff to 3 m, Number 1"
IMPROVEMENT_PERCENT: Final = 20
FLIGHTS_AT_MOST: Final = 9
DECIDED: Final = "Ada and Ben, from the flights of this campaign"
CHARTS: Final = re.compile("^[34]$")
"""Takeoffs, errors and gains; the landscape as well if it has been computed by then."""
OPEN: Final = "Open fly screen"
OF_A_CAMPAIGN: Final = re.compile("/api/campaigns/[0-9]+/(proposal|trials)")


@pytest.fixture
def drone() -> Iterator[Drone]:
    with Drone(speed=DRONE_SPEED) as one:
        yield one


def test_a_day_from_the_wizard_to_the_report(
    drone: Drone, open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url, alone=True)
    dashboard.page.clock.install()
    dashboard.open("/vehicles")
    vehicle_id = register(dashboard, drone)
    campaign_id = create(dashboard, vehicle_id)
    rehearse(dashboard, states, campaign_id)
    fly_the_first(dashboard, campaign_id, vehicle_id)
    while not is_over(dashboard, campaign_id):
        fly_another(dashboard, campaign_id)
    see_the_result(dashboard, campaign_id)
    promote(dashboard, campaign_id, vehicle_id)
    open_the_report(dashboard, campaign_id)
    see_the_list(dashboard, campaign_id)
    disconnect(dashboard, vehicle_id)


# ---- before the flights


def create(dashboard: Dashboard, vehicle_id: int) -> int:
    """From the vehicle's page, a campaign that ends once flights no longer improve much."""
    page = dashboard.page
    dashboard.open(f"/vehicles/{vehicle_id}")
    expect(line_of(dashboard)).to_contain_text("[283 13 82]safe")
    picture(dashboard, "vehicle")
    page.get_by_role("link", name="New campaign").click()
    expect(page.get_by_role("radio", name=re.compile("Number 1"))).to_be_checked()
    expect(page.get_by_text("the campaign must pass a rehearsal on a simulation")).to_be_visible()
    page.get_by_label("Name", exact=True).fill(NAME)
    picture(dashboard, "wizard")
    page.get_by_role("button", name=re.compile("^Advanced")).click()
    page.get_by_text("No improvement", exact=True).click()
    page.get_by_label("Maximum flights").fill(str(FLIGHTS_AT_MOST))
    page.get_by_label("Improvement threshold").fill(str(IMPROVEMENT_PERCENT))
    if not ARE_TAKEN:
        page.get_by_label("Scored window").fill(str(WINDOW_S))
    dashboard.button("Create campaign").click()
    expect(page.get_by_role("heading", level=1)).to_have_text(NAME)
    made = dashboard.get(f"/campaigns/{dashboard.campaign_id}")
    assert (made["vehicle"]["id"], made["vehicle"]["is_real"], made["rehearsal"]["state"]) == (
        vehicle_id, True, "missing")  # fmt: skip
    stop = made["definition"]["stop"]
    assert (stop["kind"], stop["max_flights"]) == ("paper", FLIGHTS_AT_MOST)
    assert stop["improvement"] == pytest.approx(IMPROVEMENT_PERCENT / 100)
    return dashboard.when_ready(dashboard.campaign_id)


def rehearse(dashboard: Dashboard, states: States, campaign_id: int) -> None:
    """Begun and ended on the page; its flights are written."""
    page = dashboard.page
    expect(dashboard.panel("Rehearse first")).to_contain_text("Not passed yet")
    expect(page.get_by_role("button", name=OPEN)).to_have_count(0)
    picture(dashboard, "rehearse")
    dashboard.button("Rehearse on a simulation").click()
    expect(page.get_by_text("This is a rehearsal")).to_be_visible()
    assert dashboard.get(f"/campaigns/{dashboard.campaign_id}")["rehearses"] == campaign_id
    dashboard.when_ready(dashboard.campaign_id)
    states.rehearse(campaign_id)
    expect(page.get_by_text("Rehearsal passed")).to_be_visible()
    page.get_by_role("link", name=f"Open {NAME}").click()
    expect(page.get_by_role("button", name=OPEN)).to_be_visible()


# ---- at the vehicle


def proposed(dashboard: Dashboard, campaign_id: int) -> Json:
    """The trial of the proposed gains, its fly screen open."""
    dashboard.when_ready(campaign_id)
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    dashboard.choose_proposed(campaign_id)
    dashboard.button(OPEN).click()
    expect(dashboard.page).to_have_url(re.compile(r"/fly/\d+$"))
    expect(dashboard.button("Stage gains")).to_be_visible()
    trial: Json = dashboard.get(f"/trials/{dashboard.page.url.rsplit('/', 1)[1]}")
    assert trial["gains"] == proposal["gains"]
    return trial


def land(dashboard: Dashboard, trial: Json) -> None:
    """It waits for a person's word."""
    expect(dashboard.page.get_by_text("Suggested: valid")).to_be_visible()
    expect(word(dashboard)).to_have_text("Landed")
    assert dashboard.get(f"/trials/{trial['id']}")["state"] == "captured"


@contextmanager
def slow_answers(page: Page) -> Iterator[None]:
    """What is read of a campaign comes late, its list of flights last: so late that what is shown meanwhile is
    seen."""

    def late(route: Route) -> None:
        time.sleep(0.3)
        route.continue_()

    page.route(OF_A_CAMPAIGN, late)
    yield
    page.unroute(OF_A_CAMPAIGN, late)


def count_it(dashboard: Dashboard, trial_id: int) -> Json:
    """Count the flight as valid; its error is what the screen says then, and the campaign's page. After the last flight
    that one may show the result, with the mean of several, instead."""
    page = dashboard.page
    dashboard.button("Mark valid").click()
    expect(page.get_by_role("link", name="Next flight")).to_be_visible()
    trial: Json = dashboard.get(f"/trials/{trial_id}")
    assert trial["state"] == "valid"
    expect(page.locator("main")).to_contain_text(f"{trial['error']:.3f} m")
    verdict = dashboard.panel(f"Flight {trial['number']}").filter(has_text=f"{trial['error']:.3f}")
    headings, said = page.get_by_role("heading", level=2), set[str]()

    def is_told() -> bool:
        said.update(text.strip() for text in headings.all_inner_texts())
        return verdict.or_(dashboard.panel("Converged")).first.is_visible()

    with slow_answers(page):
        page.get_by_role("link", name="Next flight").click()
        dashboard.until(is_told)
    assert f"Review flight {trial['number']}" not in said
    assert_drawn_as_recorded(dashboard, trial)
    return trial


def assert_drawn_as_recorded(dashboard: Dashboard, trial: Json) -> None:
    dashboard.wait_for_flight(trial["number"])
    drawn = dashboard.trace("takeoffs", "flight", trial=trial["number"])
    assert drawn is not None
    time_s, altitude_m = dashboard.record(trial["id"])
    np.testing.assert_allclose(drawn["y"], np.interp(drawn["x"], time_s, altitude_m), atol=2e-3)


def fly_the_first(dashboard: Dashboard, campaign_id: int, vehicle_id: int) -> Json:
    """With every look that a person takes: the gains read back, the curve as it grows, the verdict."""
    trial = proposed(dashboard, campaign_id)
    take_control(dashboard)
    stage(dashboard, len(trial["gains"]))
    staged, vehicle = dashboard.get(f"/trials/{trial['id']}"), dashboard.get(f"/vehicles/{vehicle_id}")
    assert staged["read_back"] == vehicle["held"] == trial["gains"]
    assert vehicle["control"]["operator"] == "Ada"
    picture(dashboard, "staged")
    hold_until_it_flies(dashboard, trial["id"])
    expect(word(dashboard)).to_have_text("In flight")
    see_it_fly(dashboard, 250 if ARE_TAKEN else 40)
    picture(dashboard, "flying", at_rest=False)
    land(dashboard, trial)
    dashboard.until(lambda: dashboard.trace("Live curve", "flight", trial=1, standing="unjudged") is not None)
    picture(dashboard, "landed")
    in_sight_and_large_enough(dashboard)
    flown = count_it(dashboard, trial["id"])
    dashboard.when_ready(campaign_id)
    expect(dashboard.panel("Next: flight 2")).to_be_visible()
    picture(dashboard, "verdict")
    return flown


def in_sight_and_large_enough(dashboard: Dashboard) -> None:
    """The reasons for which a flight does not count, and the way back, on the fly screen."""
    dashboard.button("Mark invalid").click()
    labels = dashboard.page.get_by_label("Next action").locator("form label:visible").filter(has_not_text="Reason")
    for label in labels.all():
        box = label.bounding_box()
        assert box is not None
        assert box["height"] >= 48, label.inner_text()
    expect(dashboard.button("Cancel")).to_be_in_viewport(ratio=1)
    picture(dashboard, "invalid")
    dashboard.button("Cancel").click()


def fly_another(dashboard: Dashboard, campaign_id: int) -> Json:
    trial = proposed(dashboard, campaign_id)
    stage(dashboard, len(trial["gains"]))
    hold_until_it_flies(dashboard, trial["id"])
    land(dashboard, trial)
    return count_it(dashboard, trial["id"])


def is_over(dashboard: Dashboard, campaign_id: int) -> bool:
    """Whether it has ended, once that or the next gains are known."""

    def known() -> bool:
        finished: bool = dashboard.get(f"/campaigns/{campaign_id}")["state"] == "finished"
        is_ready: bool = dashboard.get(f"/campaigns/{campaign_id}/proposal")["state"] == "ready"
        return finished or is_ready

    dashboard.until(known)
    return bool(dashboard.get(f"/campaigns/{campaign_id}")["state"] == "finished")


# ---- after the flights


def see_the_result(dashboard: Dashboard, campaign_id: int) -> None:
    campaign = dashboard.get(f"/campaigns/{campaign_id}")
    assert campaign["outcome"] == "converged"
    best, trials = campaign["best"], dashboard.trials(campaign_id)
    errors = [trial["error"] for trial in trials]
    assert {trial["state"] for trial in trials} == {"valid"}
    assert best["error"] == min(errors) < 0.8 * errors[0]
    result = dashboard.panel("Converged")
    expect(result).to_contain_text("Best gains (flight")
    expect(result).to_contain_text(error_of_best_gains(dashboard, campaign_id))
    dashboard.until(lambda: len((dashboard.trace("errors", "measured") or {"y": []})["y"]) == len(errors))
    measured = dashboard.trace("errors", "measured")
    assert measured is not None
    assert measured["y"] == pytest.approx(errors, abs=1e-6)
    picture(dashboard, "converged")
    load(dashboard, campaign)


def load(dashboard: Dashboard, campaign: Json) -> None:
    """The file has the best gains; the vehicle, which holds its safe gains again, does not."""
    kp = campaign["winner"]["gains"]["kp"]
    row = dashboard.panel("Converged").get_by_role("row", name="kp")
    expect(row).to_have_text(f"kp283{kp:g}differs: 283")
    with dashboard.page.expect_download() as download:
        dashboard.button("Download parameter file").click()
    assert download.value.suggested_filename == campaign["parameter_file"] == f"campaign-{campaign['id']}.xml"
    assert f'<define name="HOVER_KP" value="{kp:g}"/>' in download.value.path().read_text()


def error_of_best_gains(dashboard: Dashboard, campaign_id: int) -> str:
    """Their mean, as it should be printed."""
    groups = dashboard.get(f"/campaigns/{campaign_id}/statistics")["groups"]
    (best,) = [group for group in groups if group["is_best"]]
    return printed(best["mean"], best["standard_error"])


def promote(dashboard: Dashboard, campaign_id: int, vehicle_id: int) -> None:
    """The statistics say "better": the best gains become those that the vehicle is left with."""
    campaign = dashboard.get(f"/campaigns/{campaign_id}")
    assert campaign["winner"]["verdict"] == "better"
    dashboard.button("Set best gains as safe gains").click()
    dashboard.page.get_by_label("Decided by, and based on which flights").fill(DECIDED)
    dashboard.button("Save safe gains").click()
    told = dashboard.page.get_by_text("The best gains are the safe gains of Number 1.")
    expect(told).to_contain_text("Number 1 still holds [283 13 82]")
    assert dashboard.get(f"/vehicles/{vehicle_id}")["safe_gains"] == campaign["winner"]["gains"]


def open_the_report(dashboard: Dashboard, campaign_id: int) -> None:
    """It has the numbers of the API."""
    with dashboard.page.context.expect_page() as coming:
        dashboard.page.get_by_role("link", name="Open report", exact=True).click()
    report = coming.value
    expect(report.locator("html")).to_have_attribute("data-drawn", CHARTS)
    statistics = dashboard.get(f"/campaigns/{campaign_id}/statistics")
    expect(report.get_by_role("heading", level=1)).to_have_text(NAME)
    expect(report.locator(".headline")).to_contain_text(error_of_best_gains(dashboard, campaign_id))
    expect(report.locator(".verdict")).to_have_text(statistics["comparison"]["sentence"])
    assert runs_of(report) == [runs_row(trial, statistics["sigma"]) for trial in dashboard.trials(campaign_id)]
    keep(report, "report")
    report.close()


def runs_row(trial: Json, sigma: float) -> list[str]:
    """Gains and error of a flight as they should be printed."""
    gains = [f"{trial['gains'][name]:g}" for name in ("kp", "ki", "kd")]
    return [*gains, "–" if trial["error"] is None else printed(trial["error"], sigma, "").strip()]


def runs_of(report: Page) -> list[list[str]]:
    rows = report.locator("#runs-table tbody tr:has(th)").all()
    return [[cell.strip() for cell in row.locator("td").all_inner_texts()[:4]] for row in rows]


def see_the_list(dashboard: Dashboard, campaign_id: int) -> None:
    dashboard.page.get_by_role("link", name="Campaigns").first.click()
    card = dashboard.page.get_by_role("listitem").filter(
        has=dashboard.page.get_by_role("heading", name=NAME, exact=True)
    )
    expect(card).to_contain_text(error_of_best_gains(dashboard, campaign_id))
    expect(card).to_contain_text("Converged")
    picture(dashboard, "list")


# ---- pictures


def picture(dashboard: Dashboard, name: str, *, at_rest: bool = True) -> None:
    """What the tablet shows now, where pictures are taken."""
    if at_rest and ARE_TAKEN:
        dashboard.settled()
        dashboard.page.evaluate("scrollTo(0, 0)")
    keep(dashboard.page, name)


def keep(page: Page, name: str) -> None:
    if ARE_TAKEN:
        page.screenshot(path=PICTURES / f"{name}.png", animations="disabled")
