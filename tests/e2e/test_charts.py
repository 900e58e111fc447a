"""The charts of a campaign with a thousand flights: one flight seen everywhere, a zoom that shows more, small pages."""

from functools import partial

import numpy as np
import pytest
from playwright.sync_api import Locator, expect

from bench.seeding import seed_database
from tests.e2e.conftest import Server
from tests.e2e.dashboard import DESK, PHONE, Dashboard, Json
from tests.e2e.states import States

FLIGHTS = 1000
SAMPLES = 4000
WHOLE_FLIGHT_S = pytest.approx([-0.326, 32.6], abs=0.01)
DWELL_MS = 300
"""The mouse rests for half as long before the curve of a row is asked for."""


@pytest.fixture(scope="module")
def crowd(shared_server: Server) -> int:
    """A campaign of a thousand flights."""
    return seed_database(shared_server.data_dir, flights={"Crowd": FLIGHTS}, samples=SAMPLES)["Crowd"]


@pytest.fixture
def page_of_many(dashboard: Dashboard, crowd: int) -> Dashboard:
    dashboard.open_campaign(crowd)
    for chart in ("errors", "gains"):
        expect(dashboard.plot(chart)).to_be_visible()
    expect(row(dashboard, FLIGHTS)).to_be_attached()
    dashboard.settled()
    return dashboard


def row(dashboard: Dashboard, flight: int) -> Locator:
    return dashboard.page.locator(f"tbody tr[data-flight='{flight}']")


def curve(dashboard: Dashboard, flight: int) -> Locator:
    return dashboard.plot("takeoffs").locator(f".traceflight-{flight}")


def lent_curve(dashboard: Dashboard, flight: int) -> Json | None:
    """That of a flight that has none of its own, while it is pointed at."""
    trace = dashboard.trace("takeoffs", "pointed")
    return trace if trace is not None and trace["name"] == f"Flight {flight}" else None


def lent_to_its_row(dashboard: Dashboard, flight: int) -> Json | None:
    """With the mouse moved onto the row anew: a row may move away from under it."""
    dashboard.page.mouse.move(5, 5)
    row(dashboard, flight).hover()
    dashboard.page.wait_for_timeout(DWELL_MS)
    return lent_curve(dashboard, flight)


def best_of(dashboard: Dashboard) -> Json:
    best: Json = dashboard.get(f"/campaigns/{dashboard.campaign_id}")["best"]
    return best


_POINTED = """chart => Array.from(chart.querySelectorAll("[data-pointed]"), curve => {
  const {role, trial} = curve.__data__[0].trace.meta;
  return [role, trial];
})"""
"""Role and flight of the highlighted curves: of what is drawn, not of what its element is called."""


def points_at(dashboard: Dashboard, flight: int) -> bool:
    """Whether both curves of the flight are highlighted, and nothing else."""
    pointed = dashboard.plot("takeoffs").evaluate(_POINTED)
    return sorted(pointed) == [["deviation", flight], ["flight", flight]]


def test_a_row_points_at_its_own_curves_after_flights_were_flown_on_the_open_page(
    dashboard: Dashboard, states: States
) -> None:
    """Seen: row 1 highlighted the set point and flight 4, until the page was loaded again."""
    campaign_id = states.campaign(strategy="calibrated", stop={"kind": "budget", "max_flights": 20}, flights=1)
    dashboard.open_campaign(campaign_id)
    dashboard.wait_for_flight(1)
    for number in (2, 3):
        dashboard.fly_headless(campaign_id, 1)
        dashboard.wait_for_flight(number)
    dashboard.settled()
    dashboard.open_tab("Flights")
    for flight in (1, 2, 3):
        dashboard.until(partial(is_pointed_at_by_its_row, dashboard, flight))


def test_the_legend_stays_above_the_curves_when_the_window_grows(dashboard: Dashboard, states: States) -> None:
    """Seen: the legend of the narrow layout over the curves."""
    dashboard.open_campaign(states.campaign(flights=1))
    dashboard.settled()
    for viewport in (PHONE, DESK):
        dashboard.page.set_viewport_size(viewport)
        dashboard.until(partial(has_its_legend_above, dashboard.plot("takeoffs")))


def has_its_legend_above(chart: Locator) -> bool:
    legend, curves = (chart.locator(part).first.bounding_box() for part in (".legend", ".nsewdrag"))
    assert legend is not None
    assert curves is not None
    return legend["y"] + legend["height"] <= curves["y"] + 1


def is_pointed_at_by_its_row(dashboard: Dashboard, flight: int) -> bool:
    """Whether its curves stand out, with the mouse moved onto its row anew: a row may move away from under it."""
    dashboard.page.mouse.move(5, 5)
    row(dashboard, flight).hover()
    dashboard.page.wait_for_timeout(100)
    return points_at(dashboard, flight)


def place_of(chart: Locator, flight: int) -> tuple[float, float]:
    """Where the mark of its error is drawn."""
    x, y = chart.evaluate(
        """(chart, number) => {
          const {xaxis, yaxis} = chart._fullLayout, box = chart.getBoundingClientRect();
          const marks = chart.data.find(trace => trace.meta.role === 'measured');
          const at = marks.x.indexOf(number);
          return [box.x + xaxis._offset + xaxis.l2p(number), box.y + yaxis._offset + yaxis.l2p(marks.y[at])];
        }""",
        flight,
    )
    return x, y


def brush(dashboard: Dashboard, first: tuple[float, float], last: tuple[float, float]) -> None:
    mouse = dashboard.page.mouse
    mouse.move(*first)
    mouse.down()
    mouse.move(*last, steps=5)
    mouse.up()


def point_at(dashboard: Dashboard, chart: Locator, flight: int) -> None:
    """Move the mouse to and fro until the flight is pointed at: Plotly ignores a hover while it draws."""

    def is_pointed_at() -> bool:
        x, y = place_of(chart, flight)
        dashboard.page.mouse.move(x - 3, y)
        dashboard.page.mouse.move(x, y)
        return curve(dashboard, flight).get_attribute("data-pointed") == ""

    dashboard.until(is_pointed_at)


def test_the_crowd_is_drawn_as_an_envelope_once_and_zoomed(page_of_many: Dashboard) -> None:
    finds_room_for_its_axes_and_draws_once(page_of_many)
    opens_at_the_first_8_s_and_shows_the_whole_flight_on_request(page_of_many)
    zooms_for_more_of_each_record_and_back_by_a_double_click(page_of_many)
    sees_an_envelope_with_those_that_matter(page_of_many)


def finds_room_for_its_axes_and_draws_once(page_of_many: Dashboard) -> None:
    """Where a label does not fit its margin, Plotly makes room, draws all of it again, and counts that."""
    for chart in ("takeoffs", "errors", "gains"):
        again = page_of_many.plot(chart).evaluate("chart => chart._fullLayout._redrawFromAutoMarginCount ?? null")
        assert again is None, chart


def opens_at_the_first_8_s_and_shows_the_whole_flight_on_request(page_of_many: Dashboard) -> None:
    def seconds() -> list[float]:
        shown: list[float] = page_of_many.plot("takeoffs").evaluate("chart => chart.layout.xaxis.range")
        return shown

    assert seconds() == [-0.3, 8]
    best = best_of(page_of_many)
    deviation = page_of_many.trace("takeoffs", "deviation", trial=best["trial_number"])
    assert deviation is not None
    time_s, altitude_m = page_of_many.record(best["trial_id"])
    np.testing.assert_allclose(deviation["y"], np.interp(deviation["x"], time_s, altitude_m - 3.0), atol=5e-3)
    spans = page_of_many.page.get_by_role("radiogroup", name="Time range")
    spans.get_by_text("Whole flight").click()
    page_of_many.until(lambda: seconds() == WHOLE_FLIGHT_S)
    spans.get_by_text("First 8 s").click()
    page_of_many.until(lambda: seconds() == [-0.3, 8])


def zooms_for_more_of_each_record_and_back_by_a_double_click(page_of_many: Dashboard) -> None:
    best = best_of(page_of_many)

    def drawn() -> Json:
        found = page_of_many.trace("takeoffs", "flight", trial=best["trial_number"])
        assert found is not None
        return found

    before = len(drawn()["x"])
    box = page_of_many.plot("takeoffs").locator(".nsewdrag").first.bounding_box()
    assert box is not None
    middle = box["y"] + 0.5 * box["height"]
    start, end = (box["x"] + share * box["width"] for share in (0.3, 0.4))
    brush(page_of_many, (start, middle), (end, middle))
    page_of_many.until(lambda: len(drawn()["x"]) != before)
    seconds = page_of_many.plot("takeoffs").evaluate("chart => chart.layout.xaxis.range")
    assert 1.9 < seconds[0] < seconds[1] < 3.3
    time_s, altitude_m = page_of_many.record(best["trial_id"])
    x, y = (np.array(drawn()[axis]) for axis in ("x", "y"))
    inside = (x >= seconds[0]) & (x <= seconds[1])
    recorded = (time_s >= seconds[0]) & (time_s <= seconds[1])
    assert inside.sum() == pytest.approx(min(500, recorded.sum()), abs=3)
    np.testing.assert_allclose(y[inside], np.interp(x[inside], time_s, altitude_m), atol=2e-3)
    centre = box["x"] + 0.5 * box["width"]

    def is_whole() -> bool:
        """After another double click: Plotly takes two clicks for one only if it sees both within 0.3 s. Another one
        before the page has followed would be one too many."""
        page_of_many.page.mouse.dblclick(centre, middle)
        for _ in range(30):
            seconds = page_of_many.plot("takeoffs").evaluate("chart => chart.layout.xaxis.range")
            if seconds == WHOLE_FLIGHT_S:
                return True
            page_of_many.page.wait_for_timeout(100)
        return False

    page_of_many.until(is_whole)
    page_of_many.until(lambda: len(drawn()["x"]) == 500)


def sees_an_envelope_with_those_that_matter(page_of_many: Dashboard) -> None:
    best = best_of(page_of_many)
    drawn = page_of_many.traces("takeoffs")
    roles = [trace["meta"]["role"] for trace in drawn]
    assert roles.count("envelope") == 3
    assert 5 < roles.count("flight") < 15
    mine = page_of_many.trace("takeoffs", "flight", trial=best["trial_number"], standing="best")
    assert mine is not None
    time_s, altitude_m = page_of_many.record(best["trial_id"])
    np.testing.assert_allclose(mine["y"], np.interp(mine["x"], time_s, altitude_m), atol=5e-3)
    measured = page_of_many.trace("errors", "measured")
    assert measured is not None
    first_page = {trial["number"]: trial["error"] for trial in page_of_many.trials(page_of_many.campaign_id)}
    shown = dict(zip(measured["x"], measured["y"], strict=True))
    assert all(shown[number] == pytest.approx(error, abs=1e-6) for number, error in first_page.items() if error)
    page_of_many.open_tab("Flights")
    rows = page_of_many.page.locator("tbody tr[data-flight]")
    expect(row(page_of_many, FLIGHTS)).to_be_visible()
    assert 50 <= rows.count() <= 52
    page_of_many.button(f"Show 200 earlier flights ({FLIGHTS - 50} hidden)").click()
    expect(row(page_of_many, FLIGHTS - 249)).to_be_attached()


def test_one_flight_of_the_crowd_is_pointed_at_and_chosen(page_of_many: Dashboard) -> None:
    points_at_a_mark_and_chooses_its_flight(page_of_many)
    points_at_a_row_and_its_curve_stands_out(page_of_many)
    chooses_a_flight_of_the_crowd_which_gets_a_curve(page_of_many)


def points_at_a_mark_and_chooses_its_flight(page_of_many: Dashboard) -> None:
    number = best_of(page_of_many)["trial_number"]
    chart = page_of_many.plot("errors")
    chart.scroll_into_view_if_needed()
    page_of_many.settled()
    x, y = place_of(chart, number)
    brush(page_of_many, (x - 15, y - 60), (x + 15, y - 60))  # else a pixel holds three flights
    page_of_many.settled()
    point_at(page_of_many, chart, number)
    label = page_of_many.plot("gains").locator(".hoverlayer .hovertext")
    expect(label.first).to_contain_text(f"Flight {number}")
    page_of_many.page.mouse.move(5, 5)
    expect(curve(page_of_many, number)).not_to_have_attribute("data-pointed", "")
    point_at(page_of_many, chart, number)
    page_of_many.page.mouse.click(*place_of(chart, number))
    expect(page_of_many.panel(f"Flight {number}")).to_be_visible()


def points_at_a_row_and_its_curve_stands_out(page_of_many: Dashboard) -> None:
    number = best_of(page_of_many)["trial_number"]
    page_of_many.open_tab("Flights")
    row(page_of_many, number).hover()
    expect(curve(page_of_many, number)).to_have_attribute("data-pointed", "")
    row(page_of_many, number).get_by_role("button").focus()
    expect(row(page_of_many, number)).to_have_attribute("data-pointed", "")
    plain = FLIGHTS - 20
    lent = page_of_many.until(lambda: lent_to_its_row(page_of_many, plain))
    best = best_of(page_of_many)
    time_s, altitude_m = page_of_many.record(best["trial_id"] - best["trial_number"] + plain)
    np.testing.assert_allclose(lent["y"], np.interp(lent["x"], time_s, altitude_m), atol=5e-3)


def chooses_a_flight_of_the_crowd_which_gets_a_curve(page_of_many: Dashboard) -> None:
    plain = FLIGHTS - 20
    page_of_many.open_tab("Flights")
    assert page_of_many.trace("takeoffs", "flight", trial=plain) is None
    row(page_of_many, plain).get_by_role("button").click()
    page_of_many.wait_for_flight(plain)
    others = [trace["width"] for trace in page_of_many.traces("takeoffs") if trace["meta"].get("standing") == "earlier"]
    chosen = page_of_many.trace("takeoffs", "flight", trial=plain)
    assert chosen is not None
    assert chosen["width"] == max(others)
