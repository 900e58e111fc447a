"""How many clicks it takes to fly: counted by the page itself, and only those of a real pointer."""

from playwright.sync_api import Page, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard

_COUNT = "window.clicks = 0; addEventListener('click', event => { if (event.isTrusted) window.clicks += 1 }, true)"


def clicks(page: Page) -> int:
    """Since the page was loaded."""
    counted: int = page.evaluate("window.clicks")
    return counted


def fly(dashboard: Dashboard) -> None:
    """Once the gains are there."""
    dashboard.when_ready(dashboard.campaign_id)
    dashboard.fly()


def landed(dashboard: Dashboard, number: int) -> None:
    """Wait until that flight is down and the page says what it was."""
    dashboard.until(lambda: [trial["state"] for trial in dashboard.trials(dashboard.campaign_id)] == ["valid"] * number)
    expect(dashboard.panel(f"Flight {number}")).to_be_visible()


def test_the_first_flight_lands_after_three_clicks_at_most_and_the_next_after_two_more(
    open_dashboard: Opener, empty_server: Server
) -> None:
    dashboard = open_dashboard(empty_server.url, alone=True)
    page = dashboard.page
    page.add_init_script(_COUNT)
    dashboard.open("/")
    dashboard.button("Create “AR.Drone takeoff to 3 m, simulated”").click()
    expect(dashboard.plot("takeoffs")).to_be_visible()
    fly(dashboard)
    landed(dashboard, 1)
    first = clicks(page)
    assert 1 <= first <= 3
    fly(dashboard)
    landed(dashboard, 2)
    assert 1 <= clicks(page) - first <= 2


def test_the_wizard_creates_the_simulated_takeoff_with_one_click(open_dashboard: Opener, shared_server: Server) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.page.add_init_script(_COUNT)
    dashboard.open("/new")
    dashboard.button("Create campaign").click()
    expect(dashboard.page.get_by_role("heading", name="AR.Drone takeoff to 3 m, simulated")).to_be_visible()
    made = dashboard.get(f"/campaigns/{dashboard.campaign_id}")
    assert (clicks(dashboard.page), made["vehicle"]["kind"], made["definition"]["experiment"]) == (
        1,
        "jsbsim",
        "takeoff",
    )
