"""The presets of the paper's method, flown by whoever does nothing but follow the recommendation."""

import re

import pytest
from playwright.sync_api import Locator, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json
from tests.e2e.states import States

FINISHED = re.compile("^(Converged|Flight budget used)")
NOT_IMPROVING = "The last 2 consecutive flights did not improve on the best before them by more than 5\u00a0%."
NOTHING_BETTER = "The model predicts no improvement over the best flight."


def green_button(dashboard: Dashboard, number: int) -> Locator:
    """The only filled button of the page, as long as it flies that flight."""
    filled = dashboard.page.get_by_role("main").locator("button[data-variant=filled]:enabled")
    return filled.filter(has_text=re.compile(rf"^Fly flight {number}$"))


def create(dashboard: Dashboard, preset: str) -> int:
    dashboard.open("/new")
    dashboard.page.get_by_label("Preset").select_option(label=preset)
    expect(dashboard.page.get_by_label("Name", exact=True)).to_have_value(preset)
    dashboard.button("Create campaign").click()
    expect(dashboard.page.get_by_role("heading", name=preset, exact=True)).to_be_visible()
    return dashboard.when_ready(dashboard.campaign_id)


def fly_on_green(dashboard: Dashboard, campaign_id: int, before: int, most: int) -> list[Json]:
    """Click nothing but the green button until the campaign has ended; its trials."""
    finished = dashboard.page.get_by_role("heading", name=FINISHED)
    for number in range(before + 1, most + 2):
        green = green_button(dashboard, number)
        expect(finished.or_(green)).to_be_visible()
        if finished.is_visible():
            return dashboard.trials(campaign_id)
        green.click()
    raise AssertionError("the campaign does not end")


@pytest.mark.parametrize(
    ("preset", "before", "flights", "reason"),
    [
        ("The paper's method: AR.Drone takeoff", 0, 6, NOT_IMPROVING),
        ("The paper's method: AR.Drone takeoff, simplex start", 0, 2, NOTHING_BETTER),
        ("The paper's method: F-16", 24, 27, "All 27 flights of the budget have been flown."),
    ],
)
def test_the_papers_method_is_flown_to_its_stop_by_the_green_button_alone(
    open_dashboard: Opener, empty_server: Server, states: States, preset: str, before: int, flights: int, reason: str
) -> None:
    """After so many flights of what is recommended that are written. Reported: *Repeat* was preselected after flight 3,
    and from the simplex start the advice after flight 1 was to stop."""
    dashboard = open_dashboard(empty_server.url)
    campaign_id = create(dashboard, preset)
    for _ in range(before):
        assert recommended(dashboard, campaign_id)["proposed"]
        states.fly(campaign_id)
    dashboard.choose_speed("Max")
    trials = fly_on_green(dashboard, campaign_id, before, flights)
    assert [trial["state"] for trial in trials] == ["valid"] * flights
    assert trials[0]["kind"] == "start"
    assert {trial["kind"] for trial in trials[1:]} <= {"step", "shorter step"}
    gains = [tuple(trial["gains"].values()) for trial in trials]
    assert len(set(gains)) == flights, "no gains were flown twice"
    campaign = dashboard.get(f"/campaigns/{campaign_id}")
    assert (campaign["state"], campaign["stop_reason"]) == ("finished", reason)
    expect(dashboard.page.get_by_text(reason).first).to_be_visible()


def recommended(dashboard: Dashboard, campaign_id: int) -> Json:
    """The choice that the page preselects."""
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    [choice] = [each for each in proposal["choices"] if each["recommended"]]
    found: Json = choice
    return found
