"""Readiness on the fly screen: taken back by every loss, with what it means and the way on, and given again. What is
lost and held in which state is the server's rule: tests/flights/test_readiness.py."""

import os
import re
import signal
from collections.abc import Iterator
from functools import partial

import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from app.common.states import TrialState, VehicleState
from app.flights.readiness import STEPS, readiness_of
from tests.e2e.conftest import Opener, Server, new_context
from tests.e2e.dashboard import Dashboard
from tests.e2e.flying_by_hand import (
    ASK_MS,
    disconnect,
    hold_button,
    in_state,
    line_of,
    plan,
    press,
    register,
    stage,
    state_of,
    stop_the_clock,
    take_control,
    word,
)
from tests.e2e.states import States
from tests.flights.test_readiness import GOOD, REACHED, REPORTS, standing
from tests.runtime.drones import TRIED, Drone

SILENT_FOR = """seconds => new Promise(done => {
    const stream = new EventSource("/api/events");
    stream.addEventListener("vehicle", event => {
        if (JSON.parse(event.data).packet_age_s <= seconds) return;
        stream.close();
        done();
    });
})"""
READINESS = re.compile("/readiness$")
READY, NOT_READY = "Staged, ready to fly", "Not ready to fly"


@pytest.fixture(scope="module")
def drone(states: States) -> Iterator[Drone]:
    """In real time, so that a silence leaves its clock and the ground's together."""
    states.clear()
    with Drone(speed=1.0) as one:
        yield one


@pytest.fixture(scope="module")
def vehicle_id(shared_server: Server, drone: Drone, browser: Browser) -> Iterator[int]:
    with new_context(browser, shared_server.url) as context:
        office = Dashboard(context.new_page(), shared_server.url)
        vehicle = register(office, drone)
        yield vehicle
        disconnect(office, vehicle)


@pytest.fixture
def dashboard(open_dashboard: Opener, shared_server: Server) -> Dashboard:
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.page.clock.install()
    return dashboard


@pytest.fixture
def trial_id(dashboard: Dashboard, states: States, vehicle_id: int) -> Iterator[int]:
    """A staged trial, by Ada, on the fly screen."""
    in_state(dashboard, vehicle_id, "ready")
    trial = plan(states, vehicle_id)
    dashboard.open(f"/fly/{trial}")
    take_control(dashboard)
    stage(dashboard, len(TRIED))
    yield trial
    if state_of(dashboard, trial) == "staged":
        dashboard.post(f"/trials/{trial}/unstage")
        in_state(dashboard, vehicle_id, "ready")


def stepper(page: Page) -> list[str]:
    """Standing of each step, in order."""
    items = page.get_by_role("list", name="Readiness").get_by_role("listitem")
    return [one.get_attribute("data-standing") or "" for one in items.all()]


def is_shown(page: Page, standings: list[str]) -> bool:
    return stepper(page) == standings


def losses(page: Page) -> Locator:
    return page.get_by_label("Next action").get_by_role("alert")


def show(page: Page, visibility: str) -> None:
    """Put the tab into the background, or bring it back."""
    page.evaluate(
        """visibility => {
            Object.defineProperty(document, "visibilityState", { configurable: true, get: () => visibility });
            document.dispatchEvent(new Event("visibilitychange", { bubbles: true }));
        }""",
        visibility,
    )


COUNT_QUESTIONS = """() => {
    const fetched = window.fetch;
    window.questions = 0;
    window.answers = 0;
    window.fetch = request => {
        if (!request.url.endsWith("/readiness")) return fetched(request);
        window.questions += 1;
        return fetched(request).finally(() => { window.answers += 1; });
    };
}"""
"""Counted in the page: that a request was sent is heard outside of it at some time later."""


def is_silent(page: Page) -> bool:
    """Whether the page asks nothing for three times as long as it waits otherwise, its last question answered."""
    asked = page.evaluate("window.answers")
    for _ in range(3):
        page.clock.run_for(ASK_MS)
        page.wait_for_timeout(50)
    return bool(page.evaluate("[window.questions, window.answers]") == [asked, asked])


def test_readiness_is_taken_back_by_a_stall_of_the_page_the_server_or_the_vehicle_and_given_again(
    dashboard: Dashboard, drone: Drone, vehicle_id: int, trial_id: int
) -> None:
    page = dashboard.page
    expect(word(dashboard)).to_have_text(READY)
    dashboard.until(partial(is_shown, page, ["done", "done", "open", "open", "open", "open"]))
    a_server_that_does_not_answer(page)
    a_hold_that_the_pages_own_stall_broke(dashboard, trial_id)
    a_page_that_stood_still(dashboard)
    a_tab_in_the_background(dashboard)
    a_link_that_is_gone_for_a_minute(dashboard, drone)
    a_restart_of_the_drone(dashboard, drone)
    assert state_of(dashboard, trial_id) == "planned"
    dashboard.open(f"/vehicles/{vehicle_id}")
    expect(dashboard.button("Check now")).to_be_enabled()


def a_server_that_does_not_answer(page: Page) -> None:
    page.route(READINESS, lambda route: route.abort())
    expect(losses(page)).to_contain_text(["The server is not responding."])
    expect(hold_button(page)).to_be_disabled()
    page.unroute(READINESS)
    expect(hold_button(page)).to_be_enabled()


def a_hold_that_the_pages_own_stall_broke(dashboard: Dashboard, trial_id: int) -> None:
    page = dashboard.page
    press(dashboard)
    page.clock.run_for(300)
    page.clock.fast_forward(1500)
    expect(page.get_by_role("status").filter(has_text="Hold interrupted")).to_have_text(
        "Hold interrupted: nothing was sent. Hold again."
    )
    page.mouse.up()
    assert dashboard.get(f"/trials/{trial_id}")["flight"]["take_off_at"] is None
    page.clock.resume()
    expect(word(dashboard)).to_have_text(READY)


def a_page_that_stood_still(dashboard: Dashboard) -> None:
    """It has to read the state again first."""
    page = dashboard.page
    page.route(READINESS, lambda route: route.abort())
    page.clock.pause_at(float(page.evaluate("Date.now()")) / 1000 + 30)
    expect(losses(page).first).to_contain_text(re.compile(r"This page was frozen for (29|3\d) s"))
    expect(word(dashboard)).to_have_text(NOT_READY)
    expect(hold_button(page)).to_be_disabled()
    page.clock.resume()
    expect(losses(page).first).to_contain_text("The server is not responding.")
    page.unroute(READINESS)
    expect(word(dashboard)).to_have_text(READY)


def a_tab_in_the_background(dashboard: Dashboard) -> None:
    """It asks nothing, and reads the state again before it is green."""
    page = dashboard.page
    page.evaluate(COUNT_QUESTIONS)
    stop_the_clock(dashboard)
    assert page.evaluate("window.questions") > 0
    show(page, "hidden")
    page.clock.run_for(100)
    expect(word(dashboard)).to_have_text(READY)
    dashboard.until(lambda: is_silent(page))
    page.clock.resume()
    page.route(READINESS, lambda route: route.abort())
    show(page, "visible")
    expect(losses(page).first).to_contain_text(re.compile(r"This page was frozen for \d+ s"))
    expect(word(dashboard)).to_have_text(NOT_READY)
    expect(hold_button(page)).to_be_disabled()
    page.unroute(READINESS)
    expect(word(dashboard)).to_have_text(READY)
    expect(hold_button(page)).to_be_enabled()


def a_link_that_is_gone_for_a_minute(dashboard: Dashboard, drone: Drone) -> None:
    """Observed defect: “Staged, ready to fly” was green and the hold button active."""
    page = dashboard.page
    os.kill(drone.pid, signal.SIGSTOP)
    try:
        expect(losses(page)).to_contain_text(
            "No current data has been received from the vehicle for more than 2 s. Check its power"
        )
        expect(word(dashboard)).to_have_text(NOT_READY)
        expect(hold_button(page)).to_be_disabled()
        dashboard.until(partial(is_shown, page, ["done", "lost", "open", "open", "open", "open"]))
        expect(page.get_by_label("read back")).to_have_count(0)
        page.clock.fast_forward(60_000)
        expect(losses(page)).to_contain_text(["No current data has been received from the vehicle for more than 2 s."])
        expect(word(dashboard)).to_have_text(NOT_READY)
        expect(hold_button(page)).to_be_disabled()
    finally:
        os.kill(drone.pid, signal.SIGCONT)
    expect(word(dashboard)).to_have_text(READY)
    expect(losses(page)).to_have_count(0)
    expect(page.get_by_label("read back")).to_have_count(len(TRIED))
    expect(hold_button(page)).to_be_enabled()


def a_restart_of_the_drone(dashboard: Dashboard, drone: Drone) -> None:
    """Observed defect: the old read-back kept its ticks, beside gains that it no longer held, and *Check now* was
    disabled."""
    page = dashboard.page
    drone.switch_off()
    page.evaluate(SILENT_FOR, 0.5)
    drone.switch_on()
    expect(
        page.get_by_text("The vehicle restarted. Press Stage gains so that they are written and read back again.")
    ).to_be_visible()
    expect(page.get_by_text("may or may not have been received")).to_have_count(0)
    expect(page.get_by_label("read back")).to_have_count(0)
    expect(dashboard.button("Stage gains")).to_be_enabled()
    expect(line_of(dashboard)).to_contain_text("[283 13 82]safe")


SHOWN: list[tuple[str, str | None]] = [
    *(("staged", loss) for loss in REPORTS),
    *((state, None) for state in ("planned", "held", "staged", "unstaging", "in flight", "lost", "fallen, cause open")),
]
"""Each loss, and states without one; those after which the page does not ask again come last."""


def test_states_and_losses_are_shown_as_the_server_says_them(dashboard: Dashboard, trial_id: int) -> None:
    page = dashboard.page
    shown = readiness_of(standing(TrialState.STAGED, {}), GOOD)

    def answer(route: Route) -> None:
        route.fulfill(status=200, content_type="application/json", body=shown.model_dump_json())

    page.route(READINESS, answer)
    for name, loss in SHOWN:
        state, flags, reached = REACHED[name]
        report, vehicle = (GOOD, VehicleState.READY) if loss is None else REPORTS[loss][:2]
        shown = readiness_of(standing(state, flags, vehicle), report)
        if state is TrialState.LOST or reached == "landed":  # the page does not ask again
            page.reload()
        page.clock.run_for(ASK_MS + 100)
        expected = ["done" if s in shown.steps else "lost" if s in shown.lost else "open" for s in STEPS]
        dashboard.until(partial(is_shown, page, expected))
        expect(losses(page)).to_have_text([f"{each.what} {each.way_on}".replace("`", "") for each in shown.losses])
        expect(hold_button(page)).to_be_enabled(enabled=shown.is_ready)
    page.unroute(READINESS)
