"""Comparison of flights of several campaigns: selection, figure, verdict, shared address and exported files."""

import csv
import re
import struct
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from urllib.parse import parse_qs, urlsplit
from xml.etree import ElementTree

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import PHONE, Dashboard, Json, printed
from tests.e2e.states import States

CURVES = "Curves"
MANUAL: Json = {"strategy": "manual", "stop": {"kind": "budget", "max_flights": 50}}
OTHER = {"kp": 400, "ki": 60, "kd": 100}


@dataclass(frozen=True)
class Flown:
    """Campaigns with flights, and the trials' ids in their order."""

    morning: int
    early: list[int]
    late: list[int]
    pitch: int


@pytest.fixture(scope="module")
def flown(states: States) -> Flown:
    """Two campaigns of the twin, the second with other gains, and one of another experiment."""
    morning = states.campaign(name="Compared in the morning", seed=3, **MANUAL)
    early = [states.fly_gains(morning, gains) for gains in (FIRST, FIRST, OTHER)]
    evening = states.campaign(name="Compared in the evening", seed=4, **MANUAL)
    late = [states.fly_gains(evening, OTHER) for _ in range(2)]
    pitch = states.campaign("lti", experiment="pitch-tracking", strategy="identified")
    return Flown(morning, early, late, states.fly(pitch)[0])


FIRST = {"kp": 283, "ki": 13, "kd": 82}


def address(trials: list[int], path: str = "/compare") -> str:
    return f"{path}?" + "&".join(f"trial={trial}" for trial in trials)


def chosen(page: Page) -> list[int]:
    return [int(one) for one in parse_qs(urlsplit(page.url).query).get("trial", [])]


def pick(flight: Locator) -> None:
    """What is chosen stands in the address, and is drawn from there."""
    flight.click()
    expect(flight).to_be_checked()


def row(page: Page, number: int) -> Locator:
    return page.get_by_role("region", name="Flights compared").locator("tbody tr").nth(number)


def compare(dashboard: Dashboard, trials: list[int]) -> Json:
    """Open the comparison, wait until it is drawn, and return what the API says of it."""
    dashboard.open(address(trials))
    expect(dashboard.plot(CURVES)).to_be_visible()
    found: Json = dashboard.get(address(trials))
    return found


def test_flights_are_picked_from_their_campaigns_and_drawn_as_they_are_stored(
    dashboard: Dashboard, flown: Flown
) -> None:
    page = dashboard.page
    dashboard.open(f"/campaigns/{flown.morning}")
    page.get_by_role("link", name="Compare flight 3").click()
    best = dashboard.get(f"/campaigns/{flown.morning}")["best"]["trial_id"]
    reference = flown.early[0] if best == flown.early[2] else best
    dashboard.until(lambda: chosen(page) == [reference, flown.early[2]])
    dashboard.button("Clear selection").click()
    pick(page.get_by_role("checkbox", name=re.compile("^Flight 3 ")))
    pick(page.get_by_role("checkbox", name=re.compile("^Flight 1 ")))
    page.get_by_text(re.compile("^Compared in the evening")).first.click()
    pick(page.get_by_role("checkbox", name=re.compile("^Flight 2 .*400 60 100")).last)
    wanted = [flown.early[2], flown.early[0], flown.late[1]]
    expect(dashboard.plot(CURVES)).to_be_visible()
    dashboard.until(lambda: dashboard.trace(CURVES, "flight", trial=wanted[2]) is not None)
    assert chosen(page) == wanted
    first_s, first_m = dashboard.record(wanted[0])
    pens = set()
    for trial in wanted:
        drawn = dashboard.trace(CURVES, "flight", trial=trial)
        assert drawn is not None
        pens.add(drawn["dash"])
        time_s, altitude_m = dashboard.record(trial)
        np.testing.assert_allclose(drawn["y"], np.interp(drawn["x"], time_s, altitude_m), atol=2e-3)
        below = dashboard.trace(CURVES, "difference", trial=trial)
        if trial == wanted[0]:
            assert below is None
            continue
        assert below is not None
        x = np.array(below["x"])
        np.testing.assert_allclose(
            below["y"], np.interp(x, time_s, altitude_m) - np.interp(x, first_s, first_m), atol=5e-3
        )
    assert len(pens) == 3, "not by colour alone"


def test_the_verdict_and_what_differs_are_the_apis_and_curves_and_figure_are_taken_along_as_files(
    dashboard: Dashboard, flown: Flown, tmp_path: Path
) -> None:
    page = dashboard.page
    trials = [flown.early[0], flown.early[1], flown.late[0]]
    found = compare(dashboard, trials)
    verdict = page.get_by_role("region", name="Verdict")
    expect(verdict).to_contain_text(found["sentence"])
    for note in found["notes"]:
        expect(verdict).to_contain_text(note)
    for index, flight in enumerate(found["flights"]):
        line = row(page, index)
        expect(line).to_contain_text(f"{flight['label']}Flight {flight['number']}")
        expect(line).to_contain_text(printed(flight["group"]["mean"], flight["group"]["standard_error"]))
    pair = next(one for one in found["pairs"] if (one["against_id"], one["trial_id"]) == (trials[0], trials[2]))
    assert pair["verdict"] in {"better", "worse"}, pair
    expect(row(page, 2)).to_contain_text(pair["verdict"].capitalize())
    expect(row(page, 2)).to_contain_text(printed(abs(pair["difference"]), pair["standard_error"]))
    expect(row(page, 1)).to_contain_text("Same gains")
    titles = page.get_by_role("region", name="Flights compared").locator("thead th").all_inner_texts()
    step_response = ["Rise time", "Settling time", "Overshoot", "Steady-state error"]
    shown = [title.split(" (")[0].strip() for title in titles][3:-1]
    assert shown == step_response + [one["title"] for one in found["gains"]]
    settings = page.get_by_role("region", name="Settings that differ").locator("tbody tr")
    for index, difference in enumerate(found["settings"]):
        expect(settings.nth(index)).to_contain_text(difference["title"])
        expect(settings.nth(index)).to_contain_text(str(difference["values"][2]))
    assert [one["title"] for one in found["settings"]] == ["Seed of the campaign"]
    expect(row(page, 2)).to_contain_text("+117")
    page.get_by_text("Comparisons with A").click()
    expect(page.get_by_text(pair["sentence"]).last).to_be_visible()
    stem = found["file_stem"]

    def download(name: str, ending: str) -> Path:
        with dashboard.page.expect_download() as caught:
            dashboard.page.get_by_label(name, exact=True).click()
        assert caught.value.suggested_filename == f"{stem}.{ending}"
        file = tmp_path / caught.value.suggested_filename
        caught.value.save_as(file)
        return file

    rows = list(csv.reader(download("Curves as CSV", "csv").read_text().splitlines()))
    assert rows[0][:2] == ["time_s", "set_point_m"]
    values = np.array([[float(cell) if cell else np.nan for cell in line] for line in rows[1:]])
    for column, trial in enumerate(trials, start=2):
        time_s, altitude_m = dashboard.record(trial)
        inside = ~np.isnan(values[:, column])
        expected = np.interp(values[inside, 0], time_s, altitude_m)
        np.testing.assert_allclose(values[inside, column], expected, atol=1e-4)
        assert inside.sum() > 1500
    png = download("Figure as PNG", "png").read_bytes()
    assert png.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", png[16:24]) == (2560, 1600)
    drawn = ElementTree.parse(download("Figure as SVG", "svg")).getroot()
    assert drawn.tag == "{http://www.w3.org/2000/svg}svg"
    words = " ".join(text for text in drawn.itertext() if text.strip())
    assert "A · flight 1 of Compared in th" in words
    assert "Altitude (m)" in words


def test_the_address_can_be_sent_and_another_flight_made_the_first(
    open_dashboard: Opener, shared_server: Server, flown: Flown
) -> None:
    dashboard = open_dashboard(shared_server.url)
    page = dashboard.page
    one, other = flown.early[0], flown.late[0]
    compare(dashboard, [one, other])
    dashboard.button("Use flight 1 of Compared in the evening as reference").click()
    dashboard.until(lambda: chosen(page) == [other, one])
    dashboard.until(lambda: dashboard.trace(CURVES, "difference", trial=one) is not None)
    expect(row(page, 0)).to_contain_text("reference")
    page.get_by_role("link", name="Gainline, all campaigns").click()
    expect(page.get_by_role("heading", name="Campaigns", exact=True)).to_be_visible()
    page.goto("/compare")
    dashboard.until(lambda: chosen(page) == [other, one])
    dashboard.button("Remove flight 1 of Compared in the morning").click()
    expect(page.get_by_text("Flight 1 is selected.")).to_be_visible()
    dashboard.button("Clear selection").click()
    expect(page.get_by_text("Select two or more flights.")).to_be_visible()
    assert chosen(page) == []
    elsewhere = open_dashboard(shared_server.url, theme="dark", viewport=PHONE)
    compare(elsewhere, [other, one])
    assert elsewhere.trace(CURVES, "flight", trial=one) is not None


def test_what_cannot_be_compared_is_said_and_can_be_left_out_also_a_flight_of_a_deleted_campaign(
    dashboard: Dashboard, states: States, flown: Flown
) -> None:
    page = dashboard.page
    one, other = flown.early[0], flown.early[2]
    dashboard.open(address([one, flown.pitch, other]))
    expect(page.get_by_role("alert")).to_contain_text("is in rad·s, that of flight 1")
    dashboard.button("Remove 1 flight").click()
    expect(dashboard.plot(CURVES)).to_be_visible()
    assert chosen(page) == [one, other]
    doomed = states.campaign("import", name="Deleted soon")
    proposal = dashboard.get(f"/campaigns/{doomed}/proposal")["proposal"]
    gone = dashboard.post(f"/campaigns/{doomed}/trials", {"proposal_id": proposal["id"]})["id"]
    dashboard.open(address([one, gone]))
    expect(page.get_by_role("alert")).to_contain_text("has not flown: it is planned")
    version = dashboard.get(f"/campaigns/{doomed}")["version"]
    assert page.request.delete(f"{dashboard.url}/api/campaigns/{doomed}?version={version}").ok
    dashboard.open(address([one, gone, other]))
    expect(page.get_by_role("alert")).to_contain_text(f"there is no trial {gone}")
    dashboard.button("Remove 1 flight").click()
    expect(dashboard.plot(CURVES)).to_be_visible()
    dashboard.open(address([gone]))
    expect(page.get_by_role("alert")).to_contain_text(f"There is no trial {gone}.")


def test_an_empty_page_teaches_and_finds_campaigns_by_name(dashboard: Dashboard, flown: Flown) -> None:
    page = dashboard.page
    dashboard.open("/")
    dashboard.button("More pages").click()
    page.get_by_role("link", name="Compare", exact=True).click()
    expect(page.get_by_text("The first is the reference.")).to_be_visible()
    page.get_by_role("textbox", name="Search campaigns by name").fill("evening")
    expect(page.get_by_text(re.compile("^Compared in the morning"))).to_have_count(0)
    page.get_by_text(re.compile("^Compared in the evening")).first.click()
    expect(page.get_by_role("checkbox")).to_have_count(len(flown.late))
    page.get_by_role("textbox", name="Search campaigns by name").fill("no such campaign")
    expect(page.get_by_text("No campaigns with flights match.")).to_be_visible()


def test_flights_are_shown_selected_and_compared_by_keys(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(strategy="calibrated", flights=3)
    trials = dashboard.trials(campaign_id)
    dashboard.open_campaign(campaign_id)
    page = dashboard.page
    expect(dashboard.panel("Flight 3")).to_be_visible()
    slash = "new KeyboardEvent('keydown', {key: '/', bubbles: true, cancelable: true})"
    assert page.evaluate(f"document.body.dispatchEvent({slash})"), "the browser's own, without a search field"
    page.keyboard.press("k")
    expect(dashboard.panel("Flight 2")).to_be_visible()
    page.keyboard.press("x")
    expect(page.get_by_role("tab", name="Flights (1 selected)")).to_be_visible()
    dashboard.open_tab("Flights")
    expect(page.get_by_role("checkbox", name="Select flight 2")).to_be_checked()
    page.keyboard.press("j")
    expect(dashboard.panel("Flight 3")).to_be_visible()
    dashboard.open_tab("Statistics")
    page.keyboard.press("x")
    dashboard.open_tab("Flights")
    page.get_by_role("checkbox", name="Select flight 1").check()
    page.get_by_role("checkbox", name="Select flight 1").uncheck()
    page.keyboard.press("c")
    expect(page).to_have_url(re.compile(rf"trial={trials[1]['id']}&trial={trials[2]['id']}$"))
    page.goto(f"/campaigns/{campaign_id}/flights/{trials[2]['id']}")
    expect(page.get_by_role("heading", name="Flight 3", level=1)).to_be_visible()
    dashboard.settled()
    page.keyboard.press("k")
    expect(page).to_have_url(re.compile(rf"flights/{trials[1]['id']}$"))


def test_the_table_of_runs_sorts_hides_columns_and_compares_the_selected_flights(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign(strategy="calibrated", flights=3)
    trials = dashboard.trials(campaign_id)
    dashboard.open_campaign(campaign_id)
    dashboard.open_tab("Flights")
    table = dashboard.page.get_by_role("region", name="All flights")
    rows = table.locator("tbody tr[data-flight]")

    def is_ordered(expected: list[int]) -> bool:
        shown = rows.evaluate_all("all => all.map(one => one.dataset.flight)")
        return [int(number) for number in shown] == expected

    by_error = [one["number"] for one in sorted(trials, key=lambda one: one["error"])]
    heading = table.get_by_role("columnheader", name="Error", exact=False).first
    for expected, sort in ((by_error, "ascending"), (by_error[::-1], "descending"), ([1, 2, 3], None)):
        heading.get_by_role("button", name="Error", exact=True).click()
        dashboard.until(partial(is_ordered, expected))
        if sort is None:
            expect(heading).not_to_have_attribute("aria-sort", re.compile("."))
        else:
            expect(heading).to_have_attribute("aria-sort", sort)
    dashboard.page.get_by_text("Columns", exact=True).click()
    dashboard.page.get_by_role("checkbox", name="Overshoot").uncheck()
    expect(table.get_by_role("columnheader", name="Overshoot")).to_have_count(0)
    dashboard.page.reload()
    expect(table.get_by_role("columnheader", name="Settling time")).to_be_visible()
    expect(table.get_by_role("columnheader", name="Overshoot")).to_have_count(0)
    for number in (3, 1):
        table.get_by_role("checkbox", name=f"Select flight {number}").check()
    dashboard.page.get_by_role("link", name="Compare 2 selected flights").click()
    expect(dashboard.page).to_have_url(re.compile(rf"trial={trials[2]['id']}&trial={trials[0]['id']}$"))
    compared = dashboard.page.get_by_role("region", name="Flights compared")
    expect(compared).to_contain_text(f"{trials[2]['rise_time_s']:.2f} s")
    dashboard.page.go_back()
    expect(dashboard.page.get_by_role("tab", name="Flights")).to_have_attribute("aria-selected", "true")
