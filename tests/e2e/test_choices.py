"""What to fly next is one choice: its gains, its prediction, its curve, and one button that flies them."""

import re

import numpy as np
import pytest
from playwright.sync_api import Locator, Route, expect

from tests.e2e.dashboard import DESK, TABLET, Dashboard, Json
from tests.e2e.states import States

PATIENT = {"kind": "budget", "max_flights": 20}
OWN = {"kp": 700, "ki": 60}
_DEVIATION_LINE = """chart => {
  const {xaxis, yaxis2} = chart._fullLayout;
  const line = chart.querySelector(".tracepredicted-deviation path.js-line").getAttribute("d");
  const points = line.slice(1).split("L").map(point => point.split(",").map(Number));
  return [points.map(([x]) => xaxis.p2l(x)), points.map(([, y]) => yaxis2.p2l(y))];
}"""
"""Seconds and deviations along the line as it is drawn, not as the chart was told."""


def gains_shown(dashboard: Dashboard) -> dict[str, float]:
    """The next gains in the card's table, by name, as a person reads them."""
    rows = dashboard.page.get_by_role("table", name=re.compile("^(Best|Safe) gains and next gains$")).get_by_role("row")
    found = {}
    for row in rows.filter(has=dashboard.page.get_by_role("rowheader")).all():
        cell = row.get_by_role("cell").nth(1)
        text = cell.get_by_role("textbox").input_value() if cell.get_by_role("textbox").count() else cell.inner_text()
        found[row.get_by_role("rowheader").inner_text().split()[0]] = float(text)
    return found


def card_of(dashboard: Dashboard, number: int) -> Locator:
    return dashboard.panel(f"Next: flight {number}")


def fly_what_is_shown(dashboard: Dashboard, campaign_id: int, number: int, choice: str) -> None:
    expect(card_of(dashboard, number)).to_be_visible()
    dashboard.choose(choice)
    if choice == "Custom gains":
        for name, value in OWN.items():
            dashboard.page.get_by_role("textbox", name=name).fill(str(value))
        dashboard.page.get_by_role("slider", name="Slider for kd").press("ArrowRight")
    expect(dashboard.fly_button).to_be_enabled()
    shown = gains_shown(dashboard)
    predicted = dashboard.post(f"/campaigns/{campaign_id}/prediction", {"gains": shown})
    expect(card_of(dashboard, number)).to_contain_text(f"{predicted['predicted_error']:.3f} m")
    dashboard.until(lambda: is_drawn(dashboard, predicted["curve"]["values"]))
    dashboard.until(lambda: is_deviation_drawn(dashboard, predicted["curve"]))
    dashboard.until(lambda: next_in_the_lower_charts(dashboard, number) == (predicted["predicted_error"], shown))
    dashboard.fly()
    dashboard.wait_for_flight(number)
    assert dashboard.trials(campaign_id)[number - 1]["gains"] == shown, choice


def is_drawn(dashboard: Dashboard, altitude_m: list[float]) -> bool:
    """Whether the dashed curve is that one, to the eye."""
    drawn = dashboard.trace("takeoffs", "prediction")
    return drawn is not None and drawn["y"][-1] == pytest.approx(altitude_m[-1], abs=1e-3)


def is_deviation_drawn(dashboard: Dashboard, curve: Json) -> bool:
    """Whether the dashed line in the lower panel shows that curve less the set point, 3 m."""
    time_s, deviation_m = dashboard.plot("takeoffs").evaluate(_DEVIATION_LINE)
    expected = np.interp(time_s, curve["time_s"], curve["values"]) - 3.0
    return bool(np.allclose(deviation_m, expected, atol=0.01))


def next_in_the_lower_charts(dashboard: Dashboard, number: int) -> tuple[object, dict[str, float]]:
    """Error and gains at the diamonds of the next flight."""
    error = dashboard.trace("errors", "predicted")
    assert error is not None
    gains = [trace for trace in dashboard.traces("gains") if trace["meta"]["role"] == "next"]
    assert [trace["x"] for trace in gains] == [[number]] * len(gains)
    drawn = dict(zip(error["x"], error["y"], strict=True)).get(number)
    return pytest.approx(drawn, abs=1e-6), {trace["meta"]["gain"]: trace["y"][0] for trace in gains}


def test_the_green_button_flies_the_gains_shown_whatever_is_chosen(dashboard: Dashboard, states: States) -> None:
    """Seen: it flew 3968/922/139, the best again, while the table under it showed the step, 3911/1073/269."""
    campaign_id = states.campaign(strategy="calibrated", stop=PATIENT, flights=2)
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    assert proposal["advice"]["kind"] == "step"
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    expect(dashboard.page.get_by_role("radio", name="Step (recommended)")).to_be_checked()
    assert gains_shown(dashboard) == proposal["gains"]
    for number, choice in enumerate(("Repeat", "Smaller step", "Step", "Baseline", "Custom gains"), start=3):
        fly_what_is_shown(dashboard, campaign_id, number, choice)
    kinds = [trial["kind"] for trial in dashboard.trials(campaign_id)]
    assert kinds[2:] == ["repeat", "shorter step", "step", "baseline", "manual"]


def test_an_answer_about_earlier_gains_never_stands_beside_newer_ones_nor_the_curve_of_gains_without_one(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign(strategy="calibrated", stop=PATIENT, flights=2)
    dashboard.open_campaign(campaign_id)
    dashboard.choose("Custom gains")
    expect(dashboard.fly_button).to_be_enabled()
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    dashboard.page.route("**/api/campaigns/*/prediction", hold)
    dashboard.page.get_by_role("textbox", name="kp").fill("701")
    expect(dashboard.page.get_by_text("Updating…")).to_be_visible()
    expect(dashboard.fly_button).to_be_disabled()
    dashboard.page.get_by_role("textbox", name="kp").fill("702")
    dashboard.page.get_by_role("textbox", name="kp").fill("703")
    dashboard.until(lambda: held)
    held.pop().continue_()
    dashboard.until(lambda: held)
    assert held[0].request.post_data_json == {"gains": {**gains_shown(dashboard), "kp": 703}}
    expect(dashboard.page.get_by_text("Updating…")).to_be_visible()
    expect(dashboard.fly_button).to_be_disabled()
    held.pop().continue_()
    expect(dashboard.page.get_by_text(re.compile("^Predicted error"))).to_be_visible()
    expect(dashboard.fly_button).to_be_enabled()
    assert dashboard.trials(campaign_id)[2:] == []
    dashboard.page.unroute("**/api/campaigns/*/prediction")
    chart = dashboard.panel("Takeoff curves")
    predicted, flown = (chart.locator(f"[class*=trace{role}] path.js-line") for role in ("prediction", "flight-"))
    expect(flown).to_have_count(2)
    for gain, is_predicted in (("701", True), ("99999", False), ("702", True), ("88888", False)):
        dashboard.page.get_by_role("textbox", name="kp").fill(gain)
        expect(predicted).to_have_count(int(is_predicted))
        expect(flown).to_have_count(2)


_BEYOND_ITS_CARD = """card => {
  const edge = card.getBoundingClientRect().right;
  return [...card.querySelectorAll("*")].filter(each => each.getBoundingClientRect().right > edge).length;
}"""


def test_every_choice_fits_its_card_on_a_tablet_with_the_fly_button_in_view(
    dashboard: Dashboard, states: States
) -> None:
    """Observed: typed gains and the source of a predicted error ran past the card's edge, and the button below it."""
    name = "AR.Drone takeoff to 3 m, a name that is longer than the line beside the exports"
    dashboard.open_campaign(states.campaign(name=name, seed=3, flights=1, stop=PATIENT))
    card = card_of(dashboard, 2)
    for choice in ("Step", "Repeat", "Custom gains"):
        dashboard.page.set_viewport_size(TABLET)
        dashboard.page.evaluate("scrollTo(0, 0)")
        dashboard.choose(choice)
        expect(dashboard.fly_button).to_be_enabled()
        assert card.evaluate(_BEYOND_ITS_CARD) == 0, choice
        if choice != "Custom gains":  # whoever types them scrolls with them
            expect(dashboard.fly_button).to_be_in_viewport(ratio=1.0)
            dashboard.page.set_viewport_size(DESK)
            expect(dashboard.fly_button).to_be_in_viewport(ratio=1.0)
