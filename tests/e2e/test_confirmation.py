"""The best gains of a campaign: a candidate, confirmed by further flights, and confirmed again after a review."""

import re

import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.e2e.test_verdict import open_flight

FINISHED = re.compile("^(Converged|Flight budget used)")
CANDIDATE = "Candidate: not yet confirmed by repeat flights."
CONFIRMED = "Confirmed: better than the first gains in repeat flights."


def fly_on(dashboard: Dashboard, campaign_id: int) -> None:
    """Fly what is recommended until the campaign is finished."""
    page = dashboard.page
    finished = page.get_by_role("heading", name=FINISHED)
    for _ in range(12):
        flown = [trial["number"] for trial in dashboard.trials(campaign_id) if trial["error"] is not None]
        number = max(flown, default=0) + 1
        card = page.locator("section").filter(has=page.get_by_role("heading", name=re.compile(rf"\b{number}\b")))
        fly = card.get_by_role("button", name=re.compile(rf"^Fly flight {number}$")).and_(page.locator(":enabled"))
        expect(finished.or_(fly)).to_be_visible()
        if finished.is_visible():
            return
        fly.click()
        dashboard.wait_for_flight(number)
    raise AssertionError("the campaign does not end")


@pytest.mark.complete
def test_a_noisy_twin_is_flown_to_a_candidate_confirmed_reviewed_and_confirmed_again(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    campaign_id = states.campaign(strategy="calibrated")
    while dashboard.get(f"/campaigns/{campaign_id}")["state"] != "finished":
        states.fly(campaign_id)
    dashboard.open_campaign(campaign_id)
    assert dashboard.get(f"/campaigns/{campaign_id}")["standing"] == "candidate"
    expect(page.get_by_text(CANDIDATE)).to_be_visible()

    flown = len(dashboard.trials(campaign_id))
    dashboard.button("Confirm with 2 flights").click()
    expect(page.get_by_role("heading", name=f"Flight {flown + 1} is planned")).to_be_visible()
    dashboard.choose_speed("Max")
    fly_on(dashboard, campaign_id)
    expect(page.get_by_text(CONFIRMED)).to_be_visible()
    trials = dashboard.trials(campaign_id)
    assert [trial["kind"] for trial in trials[flown:]] == ["repeat", "baseline"]

    review = open_flight(dashboard, trials[-2])
    review.get_by_role("button", name="Mark invalid").click()
    review.get_by_text("Wind gust").click()
    review.get_by_role("button", name="Mark invalid").click()
    expect(review.get_by_text("Invalid", exact=True)).to_be_visible()
    dashboard.open_campaign(campaign_id)
    expect(page.get_by_role("heading", name=f"Next: flight {len(trials) + 1}")).to_be_visible()
    fly_on(dashboard, campaign_id)
    expect(page.get_by_text(CONFIRMED)).to_be_visible()
