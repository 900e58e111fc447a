"""A whole flight-test day with a REAL vehicle as in docs/guide.md, whose pictures it takes."""

import os
import re
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json, printed
from tests.e2e.flying_by_hand import (
    DRONE_SPEED,
    abort,
    disconnect,
    hold_until_it_flies,
    in_state,
    line_of,
    register,
    see_it_fly,
    stage,
    take_control,
    word,
)
from tests.e2e.states import States
from tests.e2e.test_pages import ROOT, SCREENSHOTS
from tests.runtime.drones import SAFE, Drone

pytestmark = pytest.mark.real_time

PICTURES: Final = ROOT / "docs" / "images" / "day" if os.environ.get("GAINLINE_README_IMAGE") else SCREENSHOTS / "day"
"""Of the guide with GAINLINE_README_IMAGE=1, else to look at."""
NAME: Final = "Takeoff to 3 m, Number 1"
IMPROVEMENT_PERCENT: Final = 20
FLIGHTS_AT_MOST: Final = 9
DECIDED: Final = "Ada and Ben, from the flights of this campaign"
CHARTS: Final = re.compile("^[34]$")
"""Takeoffs, errors and gains; the landscape as well if it has been computed by then."""
OPEN: Final = "Open fly screen"


@pytest.fixture
def drone() -> Iterator[Drone]:
    with Drone(speed=DRONE_SPEED) as one:
        yield one


@pytest.mark.timeout(480, func_only=True)
def test_a_day_from_the_wizard_to_the_report(
    open_dashboard: Opener, empty_server: Server, states: States, drone: Drone
) -> None:
    dashboard = open_dashboard(empty_server.url, alone=True)
    dashboard.page.clock.install()
    dashboard.open("/vehicles")
    vehicle_id = register(dashboard, drone)
    campaign_id = create(dashboard, vehicle_id)
    rehearse(dashboard, states, campaign_id)
    first = fly_the_first(dashboard, campaign_id, vehicle_id)
    abort_the_second(dashboard, campaign_id, vehicle_id)
    mark_the_third_invalid(dashboard, campaign_id, first)
    fly_another(dashboard, campaign_id, lambda: press(dashboard, OPEN))
    repeat_the_best(dashboard, campaign_id)
    while not is_over(dashboard, campaign_id):
        fly_another(dashboard, campaign_id, lambda: press(dashboard, OPEN))
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


def press(dashboard: Dashboard, label: str | re.Pattern[str]) -> None:
    dashboard.page.get_by_role("button", name=label).click()


def planned(dashboard: Dashboard, campaign_id: int, choose: Callable[[], None]) -> Json:
    """The trial that the press of a button plans, its fly screen open."""
    dashboard.when_ready(campaign_id)
    choose()
    expect(dashboard.page).to_have_url(re.compile(r"/fly/\d+$"))
    expect(dashboard.button("Stage gains")).to_be_visible()
    trial: Json = dashboard.get(f"/trials/{dashboard.page.url.rsplit('/', 1)[1]}")
    return trial


def proposed(dashboard: Dashboard, campaign_id: int) -> Json:
    """The trial of the proposed gains, its fly screen open."""
    dashboard.when_ready(campaign_id)
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]

    def stage_the_step() -> None:
        dashboard.choose_proposed(campaign_id)
        press(dashboard, OPEN)

    trial = planned(dashboard, campaign_id, stage_the_step)
    assert trial["gains"] == proposal["gains"]
    return trial


def land(dashboard: Dashboard) -> None:
    expect(dashboard.page.get_by_text("Suggested: valid")).to_be_visible(timeout=60_000)
    expect(word(dashboard)).to_have_text("Landed")


def count_it(dashboard: Dashboard, trial_id: int) -> Json:
    """Count the flight as valid; its error is what the screen says then, and the campaign's page. After the last flight
    that one may show the result, with the mean of several, instead."""
    page = dashboard.page
    dashboard.button("Mark valid").click()
    expect(page.get_by_role("link", name="Next flight")).to_be_visible()
    trial: Json = dashboard.get(f"/trials/{trial_id}")
    assert trial["state"] == "valid"
    expect(page.locator("main")).to_contain_text(f"{trial['error']:.3f} m")
    page.get_by_role("link", name="Next flight").click()
    verdict = dashboard.panel(f"Flight {trial['number']}").filter(has_text=f"{trial['error']:.3f}")
    expect(verdict.or_(dashboard.panel("Converged")).first).to_be_visible()
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
    see_it_fly(dashboard, 250)
    picture(dashboard, "flying", at_rest=False)
    land(dashboard)
    picture(dashboard, "landed")
    flown = count_it(dashboard, trial["id"])
    dashboard.when_ready(campaign_id)
    expect(dashboard.panel("Next: flight 2")).to_be_visible()
    picture(dashboard, "verdict")
    return flown


def abort_the_second(dashboard: Dashboard, campaign_id: int, vehicle_id: int) -> None:
    trial = proposed(dashboard, campaign_id)
    assert trial["gains"] != SAFE
    stage(dashboard, len(trial["gains"]))
    expect(line_of(dashboard)).to_contain_text("[{kp:g} {ki:g} {kd:g}]safe [283 13 82]".format(**trial["gains"]))
    hold_until_it_flies(dashboard, trial["id"])
    see_it_fly(dashboard, 40)
    abort(dashboard)
    expect(word(dashboard)).to_have_text("Aborted")
    in_state(dashboard, vehicle_id, "ready")
    assert dashboard.get(f"/trials/{trial['id']}")["state"] == "aborted"
    assert dashboard.get(f"/vehicles/{vehicle_id}")["held"] == SAFE
    expect(line_of(dashboard)).to_contain_text("[283 13 82]safe")
    dashboard.page.get_by_role("link", name="Next flight").click()
    expect(dashboard.panel("Flight 2").first.get_by_text("Aborted", exact=True)).to_be_visible()


def mark_the_third_invalid(dashboard: Dashboard, campaign_id: int, best: Json) -> None:
    """A gust blew: the flight keeps its record, and nothing is computed from it."""
    page = dashboard.page
    trial = proposed(dashboard, campaign_id)
    stage(dashboard, len(trial["gains"]))
    hold_until_it_flies(dashboard, trial["id"])
    land(dashboard)
    dashboard.button("Mark invalid").click()
    page.get_by_text("Wind gust", exact=True).click()
    picture(dashboard, "invalid")
    dashboard.button("Mark invalid").click()
    page.get_by_role("link", name="Next flight").click()
    marked = dashboard.get(f"/trials/{trial['id']}")
    assert (marked["state"], marked["reason"]) == ("invalid", "Wind gust")
    verdict = dashboard.panel("Flight 3").first
    expect(verdict).to_contain_text("Wind gust")
    expect(verdict).to_contain_text(f"Flight {best['number']} is the best.")
    assert dashboard.get(f"/campaigns/{campaign_id}")["best"]["trial_id"] == best["id"]


def fly_another(dashboard: Dashboard, campaign_id: int, choose: Callable[[], None]) -> Json:
    trial = planned(dashboard, campaign_id, choose)
    stage(dashboard, len(trial["gains"]))
    hold_until_it_flies(dashboard, trial["id"])
    land(dashboard)
    return count_it(dashboard, trial["id"])


def repeat_the_best(dashboard: Dashboard, campaign_id: int) -> None:
    winner = dashboard.get(f"/campaigns/{campaign_id}")["winner"]

    def stage_a_repeat() -> None:
        dashboard.choose("Repeat")
        press(dashboard, OPEN)

    trial = fly_another(dashboard, campaign_id, stage_a_repeat)
    assert trial["gains"] == winner["gains"]
    groups = dashboard.get(f"/campaigns/{campaign_id}/statistics")["groups"]
    repeated = next(group for group in groups if group["gains"] == winner["gains"])
    assert repeated["trial_numbers"] == [*winner["trial_numbers"], trial["number"]]


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
    valid = [trial for trial in trials if trial["state"] == "valid"]
    assert [trial["state"] for trial in trials[:3]] == ["valid", "aborted", "invalid"]
    assert best["error"] == min(trial["error"] for trial in valid) < 0.8 * valid[0]["error"]
    result = dashboard.panel("Converged")
    expect(result).to_contain_text("Best gains (flight")
    expect(result).to_contain_text(error_of_best_gains(dashboard, campaign_id))
    dashboard.until(lambda: len((dashboard.trace("errors", "measured") or {"y": []})["y"]) == len(valid))
    measured = dashboard.trace("errors", "measured")
    assert measured is not None
    assert measured["y"] == pytest.approx([trial["error"] for trial in valid], abs=1e-6)
    picture(dashboard, "converged")


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
    """What the tablet shows now."""
    if at_rest:
        dashboard.settled()
        dashboard.page.evaluate("scrollTo(0, 0)")
    keep(dashboard.page, name)


def keep(page: Page, name: str) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{name}.png", animations="disabled")
