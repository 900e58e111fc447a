"""While something flies: the live curve, the abort, and reloads."""

import re

import numpy as np
import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json
from tests.e2e.states import States


@pytest.fixture
def campaign_id(dashboard: Dashboard, states: States) -> int:
    """A campaign on a vehicle that nothing else flies meanwhile, its page open."""
    created = states.campaign("jsbsim")
    dashboard.open_campaign(created)
    return created


def wait_for_live(dashboard: Dashboard, points: int) -> None:
    dashboard.until(lambda: dashboard.live_points() >= points)


def aborted(dashboard: Dashboard, campaign_id: int) -> bool:
    return bool(dashboard.trials(campaign_id)[-1]["state"] == "aborted")


def test_the_live_curve_grows_while_it_flies_and_the_button_aborts_at_once(
    dashboard: Dashboard, campaign_id: int
) -> None:
    dashboard.choose_speed("1×")
    dashboard.fly()
    lengths: list[int] = []

    def has_grown() -> bool:
        lengths.append(dashboard.live_points())
        return len(set(lengths) - {0}) >= 20

    dashboard.until(has_grown)
    assert lengths == sorted(lengths)
    dashboard.page.get_by_role("button", name=re.compile("^ABORT")).click()
    dashboard.until(lambda: aborted(dashboard, campaign_id))
    expect(dashboard.panel("Flight 1").get_by_text("Aborted", exact=True)).to_be_visible()
    expect(dashboard.page.get_by_role("button", name=re.compile("^ABORT"))).to_have_count(0)
    [trial] = dashboard.trials(campaign_id)
    assert trial["speed"] == 1
    assert trial["record"]["duration_s"] < 30


def test_what_is_drawn_live_is_what_was_measured_and_becomes_the_record(dashboard: Dashboard, campaign_id: int) -> None:
    dashboard.fly()

    def drawn_live() -> Json | None:
        curve = dashboard.trace("takeoffs", "live")
        return curve if curve is not None and len(curve["x"]) >= 200 else None

    live = dashboard.until(drawn_live)
    dashboard.until(lambda: dashboard.trials(campaign_id)[0]["state"] == "valid")
    [trial] = dashboard.trials(campaign_id)
    assert trial["speed"] == 10
    time_s, altitude_m = dashboard.record(trial["id"])
    np.testing.assert_allclose(live["y"], np.interp(live["x"], time_s, altitude_m), atol=5e-3)
    dashboard.wait_for_flight(1)
    drawn = dashboard.trace("takeoffs", "flight", trial=1)
    assert drawn is not None
    np.testing.assert_allclose(drawn["y"], np.interp(drawn["x"], time_s, altitude_m), atol=2e-3)


def test_a_flight_that_is_down_is_not_shown_flying_while_what_comes_next_is_awaited(
    dashboard: Dashboard, campaign_id: int
) -> None:
    dashboard.choose_speed("1×")
    dashboard.fly()
    expect(dashboard.panel("Flight 1: in flight")).to_be_visible()
    proposal = f"**/api/campaigns/{campaign_id}/proposal"
    dashboard.page.route(proposal, lambda _: None)
    dashboard.page.get_by_role("button", name=re.compile("^ABORT")).click()
    expect(dashboard.panel("Flight 1").get_by_text("Aborted", exact=True)).to_be_visible()
    expect(dashboard.panel("Flight 1: in flight")).to_have_count(0)
    expect(dashboard.page.get_by_text("Computing the next gains")).to_be_visible()
    dashboard.page.unroute(proposal)
    expect(dashboard.fly_button).to_be_visible()


def test_space_aborts_whatever_has_the_focus(dashboard: Dashboard, campaign_id: int) -> None:
    dashboard.choose_speed("1×")
    dashboard.fly()
    wait_for_live(dashboard, 20)
    dashboard.button("Rename campaign").focus()
    dashboard.page.keyboard.press("Space")
    dashboard.until(lambda: aborted(dashboard, campaign_id))
    expect(dashboard.page.get_by_label("Campaign name")).to_have_count(0)


def test_space_aborts_from_a_text_too_because_losing_a_blank_is_cheaper(dashboard: Dashboard, campaign_id: int) -> None:
    dashboard.choose_speed("1×")
    dashboard.button("Rename campaign").click()
    dashboard.fly()
    wait_for_live(dashboard, 5)
    name = dashboard.page.get_by_label("Campaign name")
    name.fill("Two")
    name.press("Space")
    expect(name).to_have_value("Two")
    dashboard.until(lambda: aborted(dashboard, campaign_id))
    assert dashboard.trials(campaign_id)[0]["read_back"] is not None


def test_a_reload_and_a_second_tab_show_the_same_flight(
    open_dashboard: Opener, dashboard: Dashboard, campaign_id: int, shared_server: Server
) -> None:
    dashboard.choose_speed("1×")
    dashboard.fly()
    wait_for_live(dashboard, 50)
    dashboard.page.reload()
    second = open_dashboard(shared_server.url)
    second.open("/")
    for tab in (dashboard, second):
        expect(tab.page.get_by_role("region", name="Flight in progress: On jsbsim")).to_be_visible()
    wait_for_live(dashboard, 100)
    live = dashboard.trace("takeoffs", "live")
    assert live is not None
    assert live["x"][0] < 0.5, "the curve before the reload is missing"
    second.page.get_by_role("button", name=re.compile("^ABORT")).click()
    dashboard.until(lambda: aborted(dashboard, campaign_id))
    expect(dashboard.page.get_by_role("button", name=re.compile("^ABORT"))).to_have_count(0)
