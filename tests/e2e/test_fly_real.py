"""The fly screen with a REAL vehicle: a simulated drone over loopback UDP, registered as real and flown by hand."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.e2e.conftest import Opener, Server, new_context
from tests.e2e.dashboard import PHONE, TABLET, Dashboard
from tests.e2e.flying_by_hand import (
    DRONE_SPEED,
    HOLD_MS,
    abort,
    disconnect,
    hold,
    hold_button,
    hold_until_it_flies,
    in_state,
    line_of,
    middle_of,
    plan,
    register,
    see_it_fly,
    stage,
    state_of,
    take_control,
    word,
)
from tests.e2e.states import States
from tests.runtime.drones import SAFE, TRIED, Drone

pytestmark = pytest.mark.real_time("a drone flies in a process of its own, over real UDP", about_s=10)


@pytest.fixture(scope="module")
def vehicle_id(shared_server: Server, states: States, browser: Browser) -> Iterator[int]:
    """A drone on loopback, registered as REAL and connected."""
    states.clear()
    with Drone(speed=DRONE_SPEED) as drone, new_context(browser, shared_server.url) as context:
        office = Dashboard(context.new_page(), shared_server.url)
        vehicle = register(office, drone)
        yield vehicle
        disconnect(office, vehicle)


@pytest.fixture
def dashboard(open_dashboard: Opener, shared_server: Server) -> Dashboard:
    """Its page has a clock that can be put forward."""
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.page.clock.install()
    return dashboard


@pytest.fixture
def trial_id(dashboard: Dashboard, states: States, vehicle_id: int) -> Iterator[int]:
    """A trial of gains other than the safe ones, in a separate campaign, the fly screen open."""
    in_state(dashboard, vehicle_id, "ready")
    trial = plan(states, vehicle_id)
    dashboard.open(f"/fly/{trial}")
    yield trial
    if state_of(dashboard, trial) in {"staged", "flying"}:
        dashboard.post(f"/trials/{trial}/abort")


RECORD_SCREENS = """() => {
    window.screens = [];
    const read = () => window.screens.push({
        word: document.querySelector("h1").innerText,
        readings: [...document.querySelectorAll("dl")].map((list) => list.innerText).join("\\n"),
    });
    new MutationObserver(read).observe(document.body, {subtree: true, childList: true, characterData: true});
}"""
"""Keep what the fly screen shows from now on, with every change of it."""


def test_it_is_staged_held_flown_and_aborted_with_one_tap(dashboard: Dashboard, vehicle_id: int, trial_id: int) -> None:
    take_control(dashboard)
    stage(dashboard, len(TRIED))
    expect(dashboard.page.get_by_text("32.6 s", exact=True)).to_be_visible()
    assert dashboard.get(f"/vehicles/{vehicle_id}")["control"]["operator"] == "Ada"
    expect(line_of(dashboard)).to_contain_text("[300 20 90]safe [283 13 82]")
    hold_until_it_flies(dashboard, trial_id)
    expect(word(dashboard)).to_have_text("In flight")
    see_it_fly(dashboard, 40)
    throttle = dashboard.page.locator("dt", has_text="Throttle").locator("xpath=following-sibling::dd")
    expect(throttle).to_have_text(re.compile(r"^[1-9]\d*\s%$"))
    dashboard.page.evaluate(RECORD_SCREENS)
    abort(dashboard)
    expect(word(dashboard)).to_have_text("Aborted")
    screens = dashboard.page.evaluate("window.screens")
    descent = [screen for screen in screens if screen["word"] == "Aborted, landing"]
    assert descent
    assert not any("Ends in" in screen["readings"] for screen in descent)
    assert all("not scored" in screen["readings"] for screen in descent)
    assert "Starting" not in {screen["word"] for screen in screens}
    assert re.search(r"Record length\s*\d+\.\d s", screens[-1]["readings"])
    expect(dashboard.page.get_by_text("Safe gains restored and read back.")).to_be_visible()
    expect(dashboard.page.get_by_role("link", name="Next flight")).to_be_visible()
    trial = dashboard.get(f"/trials/{trial_id}")
    assert (trial["state"], trial["read_back"]) == ("aborted", TRIED)
    in_state(dashboard, vehicle_id, "ready")
    assert dashboard.get(f"/vehicles/{vehicle_id}")["held"] == SAFE
    expect(line_of(dashboard)).to_contain_text("[283 13 82]safe")


def test_nothing_but_a_whole_hold_lets_it_fly(dashboard: Dashboard, vehicle_id: int, trial_id: int) -> None:
    fits(dashboard)
    take_control(dashboard)
    stage(dashboard, len(TRIED))
    hold(dashboard, HOLD_MS - 300)
    told = dashboard.page.get_by_role("status").filter(has_text="Released early")
    expect(told).to_have_text("Released early: nothing was sent. Hold again.")
    hold_button(dashboard.page).focus()
    for key in ("Enter", "Space"):
        dashboard.page.keyboard.down(key)
        dashboard.page.clock.run_for(HOLD_MS + 500)
        dashboard.page.keyboard.up(key)
    asked = dashboard.page.request.post(f"{dashboard.url}/api/trials/{trial_id}/take-off")
    assert asked.status == 403
    assert state_of(dashboard, trial_id) == "staged"
    dashboard.button("Unstage (restore safe gains)").click()
    expect(dashboard.button("Stage gains")).to_be_enabled()
    assert dashboard.get(f"/vehicles/{vehicle_id}")["held"] == SAFE


def fits(dashboard: Dashboard) -> None:
    """All of it on a tablet, and never sideways on a phone."""
    page = dashboard.page
    expect(dashboard.button("Stage gains")).to_be_visible()
    assert page.evaluate("(m => m.scrollHeight <= m.clientHeight)(document.querySelector('main'))")
    assert page.evaluate("document.documentElement.scrollHeight <= window.innerHeight")
    for viewport in (PHONE, TABLET):
        page.set_viewport_size(viewport)
        dashboard.settled()
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), viewport


def test_one_operator_is_in_control_and_a_take_over_is_seen(
    open_dashboard: Opener, dashboard: Dashboard, vehicle_id: int, trial_id: int
) -> None:
    take_control(dashboard)
    stage(dashboard, len(TRIED))
    second = open_dashboard(dashboard.url)
    second.open(f"/fly/{trial_id}")
    expect(second.page.get_by_text("Ada is in control.")).to_be_visible()
    expect(hold_button(second.page)).to_be_disabled()
    second.page.get_by_label("Your name").fill("Ben")
    second.button("Take over").click()
    expect(hold_button(second.page)).to_be_enabled()
    expect(dashboard.page.get_by_text("Ben is in control.")).to_be_visible()
    expect(hold_button(dashboard.page)).to_be_disabled()
    second.button("Unstage (restore safe gains)").click()
    in_state(dashboard, vehicle_id, "ready")


def test_the_motors_stop_when_the_knob_is_slid_to_its_end_and_the_vehicle_is_to_be_inspected(
    dashboard: Dashboard, vehicle_id: int, trial_id: int
) -> None:
    page = dashboard.page
    knob = page.get_by_role("button", name="Motors off – the drone falls")
    expect(knob).to_be_disabled()
    take_control(dashboard)
    stage(dashboard, len(TRIED))
    hold_until_it_flies(dashboard, trial_id)
    expect(word(dashboard)).to_have_text("In flight")
    see_it_fly(dashboard, 40)
    knob.click()
    slide(page, knob, 150)
    assert orders(dashboard, vehicle_id) == []
    slide(page, knob, 400)
    dashboard.until(lambda: orders(dashboard, vehicle_id) == ["motors off"])
    dashboard.until(lambda: state_of(dashboard, trial_id) not in {"staged", "flying"})
    in_state(dashboard, vehicle_id, "quarantined")
    expect(page.get_by_role("heading", name="Do not fly")).to_be_visible()
    expect(page.get_by_label("Next action")).to_contain_text("above the ground: inspect it before it flies again.")
    stepper = page.get_by_role("list", name="Readiness").get_by_role("listitem")
    expect(stepper.filter(has_text="Landed")).to_have_attribute("data-standing", "lost")
    page.get_by_role("link", name="Inspect and release").click()
    page.get_by_label("Inspected by, and findings").fill("Ada: nothing is broken")
    dashboard.button("Release vehicle").click()
    in_state(dashboard, vehicle_id, "ready")


def orders(dashboard: Dashboard, vehicle_id: int) -> list[str]:
    """What it was told beside its flights."""
    acts = dashboard.get(f"/vehicles/{vehicle_id}/acts")["items"]
    return [act["kind"] for act in acts if act["kind"] in {"land", "motors off"}]


def slide(page: Page, knob: Locator, by_px: float) -> None:
    x, y = middle_of(page, knob)
    page.mouse.down()
    page.mouse.move(x + by_px, y, steps=8)
    page.mouse.up()
