"""The best gains of a campaign: a candidate, confirmed by further flights, and confirmed again after a review."""

import re

import pytest
from playwright.sync_api import Locator, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.e2e.test_verdict import open_flight

FINISHED = re.compile("^(Converged|Flight budget used)")
RECOMMENDED = re.compile("^(Fly next trial|Repeat the best|Fly the baseline|Fly now)$")
CANDIDATE = "Candidate: not yet confirmed by repeat flights."
CONFIRMED = "Confirmed: better than the first gains in repeat flights."


def fly_on(dashboard: Dashboard, campaign_id: int, fly: Locator) -> None:
    """Click `fly` until the campaign is finished."""
    finished = dashboard.page.get_by_role("heading", name=FINISHED)
    fly = fly.and_(dashboard.page.locator(":enabled"))
    for _ in range(12):
        expect(finished.or_(fly)).to_be_visible(timeout=30_000)
        if finished.is_visible():
            return
        flown = sum(trial["error"] is not None for trial in dashboard.trials(campaign_id))
        fly.click()
        dashboard.wait_for_flight(flown + 1)
    raise AssertionError("the campaign does not end")


@pytest.mark.complete
def test_a_noisy_twin_is_flown_to_a_candidate_confirmed_reviewed_and_confirmed_again(
    open_dashboard: Opener, empty_server: Server
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    recommended = page.get_by_role("button", name=RECOMMENDED)
    campaign_id = dashboard.create("twin", strategy="calibrated")
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    fly_on(dashboard, campaign_id, dashboard.fly_button)
    assert dashboard.get(f"/campaigns/{campaign_id}")["standing"] == "candidate"
    expect(page.get_by_text(CANDIDATE)).to_be_visible()

    flown = len(dashboard.trials(campaign_id))
    dashboard.button("Confirm with 3 flights").click()
    expect(page.get_by_role("heading", name=f"Flight {flown + 1} is planned")).to_be_visible(timeout=30_000)
    fly_on(dashboard, campaign_id, recommended)
    expect(page.get_by_text(CONFIRMED)).to_be_visible()
    trials = dashboard.trials(campaign_id)
    assert [trial["kind"] for trial in trials[flown:]] == ["repeat", "baseline", "repeat"]

    review = open_flight(dashboard, trials[-2])
    review.get_by_role("button", name="Mark invalid").click()
    review.get_by_text("Wind gust").click()
    review.get_by_role("button", name="Mark invalid").click()
    dashboard.open_campaign(campaign_id)
    expect(page.get_by_role("heading", name=f"Next flight: {len(trials) + 1}")).to_be_visible(timeout=30_000)
    fly_on(dashboard, campaign_id, recommended)
    expect(page.get_by_text(CONFIRMED)).to_be_visible()


@pytest.mark.complete
def test_the_green_button_flies_the_gains_that_stand_above_it(dashboard: Dashboard, states: States) -> None:
    """Seen: “Repeat the best” flew 3968/922/139 while the table under it showed the step, 3911/1073/269."""
    campaign_id = states.campaign(strategy="calibrated", flights=2)
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    assert proposal["advice"]["kind"] == "repeat"
    assert proposal["advice"]["gains"] != proposal["gains"]
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    first, second = dashboard.panel("Next flight: 3").get_by_role("table", name="Gains now and proposed").all()
    assert [gains_in(first), gains_in(second)] == [proposal["advice"]["gains"], proposal["gains"]]
    dashboard.button("Repeat the best").click()
    dashboard.wait_for_flight(3)
    assert dashboard.trials(campaign_id)[2]["gains"] == proposal["advice"]["gains"]


def gains_in(table: Locator) -> dict[str, float]:
    """The next gains in a table, by name."""
    rows = table.locator("tbody tr").all()
    return {row.locator("th").inner_text().split()[0]: float(row.locator("td").nth(1).inner_text()) for row in rows}
