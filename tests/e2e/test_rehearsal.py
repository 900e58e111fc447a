"""A campaign on a real vehicle: the page asks for its rehearsal, and leads there and back."""

import re
from typing import Final

from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import PHONE, TABLET
from tests.e2e.states import States

REAL: Final = {
    "options": {"address": "udp:127.0.0.1:14987@14986"},
    "safe_gains_confirmed": True,
    "statement": "Ada has seen it fly on these",
}
"""An address without a vehicle."""


def test_a_real_campaign_is_rehearsed_first_and_then_offers_to_stage(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.open(f"/new?vehicle={states.vehicle('Number 1', **REAL)}")
    expect(page.get_by_text("the campaign must pass a rehearsal on a simulation")).to_be_visible()
    dashboard.button("Create campaign").click()
    asks = dashboard.panel("Rehearse first")
    expect(asks).to_contain_text("Not passed yet: it has not been flown on a simulation.")
    for viewport in (PHONE, TABLET):
        page.set_viewport_size(viewport)
        dashboard.settled()
        assert page.evaluate("document.documentElement.scrollWidth <= window.innerWidth"), viewport
    real = dashboard.when_ready(dashboard.campaign_id)
    expect(page.get_by_role("button", name=re.compile("^Stage"))).to_have_count(0)
    trial = dashboard.post(f"/campaigns/{real}/trials", {"gains": {"kp": 300, "ki": 13, "kd": 82}})
    refused = page.request.post(f"{dashboard.url}/api/trials/{trial['id']}/stage")
    assert (refused.status, "has not passed its rehearsal" in refused.json()["detail"]) == (409, True)

    dashboard.button("Rehearse on a simulation").click()
    expect(page.get_by_text("This is a rehearsal")).to_be_visible()
    rehearsal = dashboard.campaign_id
    assert rehearsal != real
    page.get_by_role("link", name="Number 1").last.click()
    expect(asks).to_contain_text("In progress: 0 of 3 valid flights.")
    page.get_by_role("link", name="Continue rehearsal").click()
    dashboard.when_ready(rehearsal)
    states.rehearse(real)
    expect(page.get_by_text("Rehearsal passed")).to_be_visible()
    expect(page.get_by_role("link", name=re.compile("^Open Takeoff to 3 m"))).to_be_visible()
    expect(page.get_by_role("main").locator("button[data-variant=filled]")).to_have_count(0)
    page.get_by_role("link", name="Number 1").last.click()
    expect(page.get_by_role("link", name="Open fly screen")).to_be_visible()
    assert dashboard.get(f"/campaigns/{real}")["rehearsal"]["state"] == "passed"
