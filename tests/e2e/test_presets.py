"""A preset of the paper's method, flown by whoever clicks nothing but the green button."""

import re

from playwright.sync_api import Locator, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json

FINISHED = re.compile("^(Converged|Flight budget used)")
PRESET = "The paper's method: AR.Drone takeoff, simplex start"
FLIGHTS = 2
NOTHING_BETTER = "The model predicts no improvement over the best flight."


def green_button(dashboard: Dashboard, number: int) -> Locator:
    """The only filled button of the page, as long as it flies that flight."""
    filled = dashboard.page.get_by_role("main").locator("button[data-variant=filled]:enabled")
    return filled.filter(has_text=re.compile(rf"^Fly flight {number}$"))


def fly_on_green(dashboard: Dashboard, campaign_id: int) -> list[Json]:
    """Click nothing but the green button until the campaign has ended; its trials."""
    finished = dashboard.page.get_by_role("heading", name=FINISHED)
    for number in range(1, FLIGHTS + 2):
        green = green_button(dashboard, number)
        expect(finished.or_(green)).to_be_visible()
        if finished.is_visible():
            return dashboard.trials(campaign_id)
        green.click()
    raise AssertionError("the campaign does not end")


def test_a_preset_is_created_and_flown_to_its_stop_by_the_green_button_alone(
    open_dashboard: Opener, empty_server: Server
) -> None:
    dashboard = open_dashboard(empty_server.url)
    dashboard.open("/new")
    dashboard.page.get_by_label("Preset").select_option(label=PRESET)
    expect(dashboard.page.get_by_label("Name", exact=True)).to_have_value(PRESET)
    dashboard.button("Create campaign").click()
    expect(dashboard.page.get_by_role("heading", name=PRESET, exact=True)).to_be_visible()
    campaign_id = dashboard.when_ready(dashboard.campaign_id)
    dashboard.choose_speed("Max")
    trials = fly_on_green(dashboard, campaign_id)
    assert [(trial["state"], trial["kind"]) for trial in trials] == [("valid", "start"), ("valid", "step")]
    campaign = dashboard.get(f"/campaigns/{campaign_id}")
    assert (campaign["state"], campaign["stop_reason"]) == ("finished", NOTHING_BETTER)
    expect(dashboard.page.get_by_text(NOTHING_BETTER).first).to_be_visible()
