"""The page of a campaign in its states: at most two screens long, cards that end with their row, each fact once."""

import re
from collections import Counter
from functools import cached_property

import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import DESK, TABLET, WIDE, Dashboard
from tests.e2e.states import States

SCREENS = {"desk": (DESK, 2.0), "wide": (WIDE, 2.0), "tablet": (TABLET, 2.6)}
"""Sizes, and how many screens the page may take there."""

HEIGHT = "document.documentElement.scrollHeight"
ROW_ENDS = """() => {
  const tabs = document.querySelector('[role=tablist]').getBoundingClientRect().top;
  const rows = {above: {}, below: {}};
  for (const card of document.querySelectorAll('main section:has(> div > h2)')) {
    if (!card.checkVisibility()) continue;
    const {left, top, bottom} = card.getBoundingClientRect();
    const ends = rows[top < tabs ? 'above' : 'below'];
    ends[Math.round(left)] = Math.max(ends[Math.round(left)] ?? 0, Math.round(bottom));
  }
  return Object.values(rows).map(ends => Object.values(ends));
}"""
"""Where the columns of cards end that stand beside each other, above the tabs and in the open one."""
TOLD = """() => {
  const words = [];
  const walker = document.createTreeWalker(document.querySelector('main'), NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const parent = walker.currentNode.parentElement;
    const isAside = parent.closest('table, [role=group], .visually-hidden, svg') !== null;
    if (!isAside && parent.checkVisibility()) words.push(walker.currentNode.data);
  }
  return words.join(' ');
}"""
"""What the page says outside of tables and charts."""
ERROR = re.compile(r"(?<!± )\b\d+\.\d{3}(?!\d)")
PREDICTED = re.compile(r"Predicted(?: error)?\s+[\d.]+ m\s+[\d.]+ … [\d.]+ m")
"""Another fact, though its number may be the same."""
SHARE = re.compile(r"\d+\s%(?! confidence|\))")


class Campaigns:
    """The campaigns of these tests, made when they are asked for."""

    def __init__(self, states: States) -> None:
        self._states = states

    @cached_property
    def new(self) -> int:
        return self._states.campaign(seed=2)

    @cached_property
    def two_flights(self) -> int:
        return self._flown(2)

    @cached_property
    def seven_flights(self) -> int:
        return self._flown(7)

    @cached_property
    def finished(self) -> int:
        return self._states.campaign(seed=4, stop={"kind": "budget", "max_flights": 3}, flights=3)

    def _flown(self, flights: int) -> int:
        return self._states.campaign(seed=4, stop={"kind": "budget", "max_flights": 20}, flights=flights)


@pytest.fixture(scope="module")
def campaigns(states: States) -> Campaigns:
    return Campaigns(states)


def check_layout(dashboard: Dashboard) -> None:
    for size, (viewport, screens) in SCREENS.items():
        dashboard.page.set_viewport_size(viewport)
        dashboard.until(lambda: all(len(ends) == 2 for ends in dashboard.page.evaluate(ROW_ENDS)))
        dashboard.settled()
        assert dashboard.page.evaluate(HEIGHT) <= screens * viewport["height"], size
        for left, right in dashboard.page.evaluate(ROW_ENDS):
            assert left == right, size


@pytest.mark.parametrize("state", ["new", "two_flights", "seven_flights", "finished"])
def test_the_page_is_two_screens_long_its_cards_end_with_their_row_and_each_fact_is_told_once(
    open_dashboard: Opener, shared_server: Server, campaigns: Campaigns, state: str
) -> None:
    dashboard = open_dashboard(shared_server.url, viewport=DESK)
    campaign_id = getattr(campaigns, state)
    dashboard.open_campaign(campaign_id)
    check_layout(dashboard)
    if (best := dashboard.get(f"/campaigns/{campaign_id}")["best"]) is not None:
        check_facts(dashboard, best["error"])


def check_facts(dashboard: Dashboard, best: float) -> None:
    told = PREDICTED.sub("", dashboard.page.evaluate(TOLD))
    errors, shares = Counter(ERROR.findall(told)), Counter(SHARE.findall(told))
    assert errors[f"{best:.3f}"] == 1, told
    assert {error for error, times in errors.items() if times > 1} == set(), told
    assert {share for share, times in shares.items() if times > 1} == set(), told


def test_a_flight_under_way_keeps_the_layout(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(seed=6, flights=2)
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("1×")
    dashboard.fly()
    expect(dashboard.page.get_by_role("heading", name="Flight 3: in flight")).to_be_visible()
    check_layout(dashboard)
    dashboard.page.keyboard.press("Space")
    dashboard.until(lambda: dashboard.get(f"/campaigns/{campaign_id}")["flying"] is None)


def test_the_next_flight_takes_the_place_of_the_one_that_was_selected(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(seed=6, flights=2)
    dashboard.open_campaign(campaign_id)
    dashboard.settled()
    dashboard.page.keyboard.press("k")
    expect(dashboard.panel("Flight 1")).to_be_visible()
    dashboard.choose_speed("Max")
    dashboard.fly()
    dashboard.wait_for_flight(3)
    expect(dashboard.panel("Flight 3")).to_be_visible()
    expect(dashboard.panel("Flight 1")).to_have_count(0)


def test_a_flight_of_a_finished_campaign_is_shown_beside_its_result_once_it_is_selected(
    dashboard: Dashboard, campaigns: Campaigns
) -> None:
    dashboard.open_campaign(campaigns.finished)
    dashboard.settled()
    expect(dashboard.panel("Flight 3")).to_have_count(0)
    dashboard.page.keyboard.press("k")
    expect(dashboard.panel("Flight 3")).to_be_visible()
    dashboard.page.keyboard.press("k")
    expect(dashboard.panel("Flight 2")).to_be_visible()


def test_an_address_of_a_tab_that_is_no_longer_there_shows_the_first_tab(
    dashboard: Dashboard, campaigns: Campaigns
) -> None:
    dashboard.open(f"/campaigns/{campaigns.finished}?tab=landscape")
    expect(dashboard.page.get_by_role("tab", name="Error and gains")).to_have_attribute("aria-selected", "true")
