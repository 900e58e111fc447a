"""A browser that has opened no link: it may only watch a REAL vehicle, and the terminal's link unlocks it."""

import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import PHONE, TABLET, Dashboard
from tests.e2e.states import States
from tests.runtime.drones import TRIED
from tests.unlocking import new_link

WATCHING = "This browser has read-only access to Bee."


@pytest.fixture
def bee(empty_server: Server, states: States) -> int:
    """A REAL vehicle that has never been connected."""
    return states.vehicle("Bee", safe_gains_confirmed=True, statement="Ada has seen it fly on these")


def notice(dashboard: Dashboard) -> None:
    expect(dashboard.page.get_by_role("main")).to_contain_text(WATCHING)
    expect(dashboard.page.get_by_role("main")).to_contain_text("gainline unlock")
    expect(dashboard.page.get_by_role("main")).to_contain_text("Abort and Land still work from here.")


def test_every_page_of_a_real_vehicle_shows_that_a_locked_browser_may_only_watch(
    open_dashboard: Opener, shared_server: Server, states: States, bee: int
) -> None:
    campaign = states.campaign("mavlink", name="Up to 3 m", vehicle_id=bee)
    trial = states.plan(campaign, TRIED)
    dashboard = open_dashboard(shared_server.url, unlocked=False)
    for path in (f"/vehicles/{bee}", f"/campaigns/{campaign}", f"/fly/{trial}"):
        dashboard.open(path)
        notice(dashboard)
        for viewport in (PHONE, TABLET):
            dashboard.page.set_viewport_size(viewport)
            dashboard.settled()
            assert dashboard.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), path
        for name in ("Stage gains", "Take control", "Connect"):
            expect(dashboard.button(name)).to_have_count(0)
    expect(dashboard.page.get_by_role("button", name="Motors off – the drone falls")).to_be_disabled()
    dashboard.open("/campaigns")
    expect(dashboard.page.get_by_text("has read-only access")).to_have_count(0)


def test_opening_the_link_in_another_tab_unlocks_the_page_that_one_comes_back_to(
    open_dashboard: Opener, shared_server: Server, bee: int
) -> None:
    dashboard = open_dashboard(shared_server.url, unlocked=False)
    dashboard.open(f"/vehicles/{bee}")
    notice(dashboard)
    expect(dashboard.button("Connect")).to_have_count(0)
    link = new_link(shared_server.data_dir)
    tab = dashboard.page.context.new_page()
    tab.goto(f"{shared_server.url}{link}")
    expect(tab.get_by_role("status").filter(has_text="This browser may now command real vehicles.")).to_be_visible()
    tab.close()
    dashboard.page.bring_to_front()
    expect(dashboard.button("Connect")).to_be_visible()
    expect(dashboard.page.get_by_text("has read-only access")).to_have_count(0)


def test_a_used_link_shows_how_to_get_another(open_dashboard: Opener, shared_server: Server) -> None:
    dashboard = open_dashboard(shared_server.url, unlocked=False)
    dashboard.page.goto("/unlock?token=spent")
    expect(dashboard.page.get_by_role("heading", name="This link has been used or has expired")).to_be_visible()
    expect(dashboard.page.get_by_text("gainline unlock")).to_be_visible()
    dashboard.page.get_by_role("link", name="Open the dashboard").click()
    expect(dashboard.page.get_by_role("navigation").first).to_be_visible()
