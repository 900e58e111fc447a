"""A whole campaign, clicked through; and everything that can come between."""

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from tests.builders import climb_error, create_climb, csv_of
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, printed
from tests.e2e.states import States

_COUNT = "window.clicks = 0; addEventListener('click', event => { if (event.isTrusted) window.clicks += 1 }, true)"
_COUNT_TOPS = "window.tops = 0; window.scrollTo = () => { window.tops += 1 }; undefined"


def clicks(page: Page) -> int:
    """Of a real pointer, since they were last set to zero."""
    counted: int = page.evaluate("window.clicks")
    return counted


def assert_drawn_as_recorded(dashboard: Dashboard, trial: dict[str, object]) -> None:
    """The curve on the page is the record of the API, to the tenth of a millimetre that figures are rounded to."""
    drawn = dashboard.trace("takeoffs", "flight", trial=trial["number"])
    assert drawn is not None, f"flight {trial['number']} is not drawn"
    time_s, altitude_m = dashboard.record(int(str(trial["id"])))
    assert len(drawn["x"]) > 100
    np.testing.assert_allclose(drawn["y"], np.interp(drawn["x"], time_s, altitude_m), atol=2e-3)
    assert max(drawn["y"]) == pytest.approx(altitude_m.max(), abs=2e-4)


def test_a_campaign_is_created_by_one_click_and_flown_to_its_stop(open_dashboard: Opener, empty_server: Server) -> None:
    """The first flight lands after three clicks at most, the next after two more."""
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    dashboard.open("/")
    page.evaluate(_COUNT)
    expect(page.get_by_role("heading", name="Tune a takeoff in a few flights")).to_be_visible()
    dashboard.button("Create “AR.Drone takeoff to 3 m, simulated”").click()
    expect(page.get_by_role("heading", name="AR.Drone takeoff to 3 m, simulated")).to_be_visible()
    campaign_id = dashboard.when_ready(dashboard.campaign_id)
    finished = page.get_by_role("heading", name=re.compile("^(Converged|Flight budget used)"))
    for number, most in enumerate((3, 2, 1, 1, 1, 1, 1), 1):
        dashboard.fly()
        dashboard.wait_for_flight(number)
        assert 1 <= clicks(page) <= most
        if number == 1:
            dashboard.choose_speed("Max")
            dashboard.open_tab("Flights")
        row = page.get_by_role("row").filter(has=page.get_by_role("rowheader", name=re.compile(rf"^Flight {number}\b")))
        expect(row.get_by_text("Valid", exact=True)).to_be_visible()
        trial = dashboard.trials(campaign_id)[number - 1]
        expect(row).to_contain_text(f"{trial['error']:.3f} m")
        assert_drawn_as_recorded(dashboard, trial)
        expect(finished.or_(dashboard.button(f"Fly flight {number + 1}"))).to_be_visible()
        if finished.is_visible():
            break
        page.evaluate("window.clicks = 0")
    trials = dashboard.trials(campaign_id)
    errors = [trial["error"] for trial in trials]
    assert min(errors) < 0.5 * errors[0]
    assert dashboard.get(f"/campaigns/{campaign_id}")["state"] == "finished"
    groups = dashboard.get(f"/campaigns/{campaign_id}/statistics")["groups"]
    winner = next(group for group in groups if group["is_best"])
    best = trials[int(np.argmin(errors))]
    expect(dashboard.panel("Converged").or_(dashboard.panel("Flight budget used"))).to_contain_text(
        f"{winner['mean']:.3f} m"  # without scatter, as the repeats of this simulation are identical
    )
    dashboard.open_tab("Error and gains")
    dashboard.until(lambda: len((dashboard.trace("errors", "measured") or {"y": []})["y"]) == len(errors))
    measured, running = dashboard.trace("errors", "measured"), dashboard.trace("errors", "best so far")
    assert measured is not None
    assert running is not None
    assert measured["y"] == pytest.approx(errors, abs=1e-6)
    assert running["y"] == pytest.approx(np.minimum.accumulate(errors), abs=1e-6)
    for name in ("kp", "ki", "kd"):
        flown = dashboard.trace("gains", "flown", gain=name)
        assert flown is not None
        assert flown["y"] == [trial["gains"][name] for trial in trials]
    emphasised = [one for one in dashboard.traces("takeoffs") if one["meta"].get("standing") == "best"]
    assert [one["meta"]["trial"] for one in emphasised] == [best["number"]] * 2, "altitude and deviation"


def test_the_wizard_creates_the_simulated_takeoff_with_one_click(open_dashboard: Opener, shared_server: Server) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open("/new")
    dashboard.page.evaluate(_COUNT)
    dashboard.button("Create campaign").click()
    expect(dashboard.page.get_by_role("heading", name="AR.Drone takeoff to 3 m, simulated")).to_be_visible()
    made = dashboard.get(f"/campaigns/{dashboard.campaign_id}")
    assert (clicks(dashboard.page), made["vehicle"]["kind"], made["definition"]["experiment"]) == (
        1,
        "jsbsim",
        "takeoff",
    )


def test_the_prediction_is_drawn_dashed_before_the_flight(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(strategy="calibrated", flights=1)
    dashboard.open_campaign(campaign_id)
    predicted = dashboard.until(lambda: dashboard.trace("takeoffs", "prediction"))
    assert (predicted["meta"]["trial"], predicted["dash"]) == (2, "dash")
    assert max(predicted["y"]) > 2.5
    proposal = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
    card = dashboard.panel("Next: flight 2")
    interval = proposal["interval"]
    expect(card).to_contain_text(f"{proposal['predicted_error']:.3f} m")
    expect(card).to_contain_text(f"{interval['lower']:.3f} … {interval['upper']:.3f} m (90 %)")
    for name, change in proposal["changes"].items():
        row = card.get_by_role("row", name=re.compile(rf"^{name} "))
        expect(row).to_contain_text(str(round(change["next"])))


def test_a_flight_of_custom_gains_goes_through_the_same_checks(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign("jsbsim")
    dashboard.open_campaign(campaign_id)
    dashboard.choose_speed("Max")
    dashboard.choose("Custom gains")
    kp = dashboard.page.get_by_role("textbox", name="kp")
    kp.fill("-5")
    expect(dashboard.page.get_by_text(re.compile("must be between 0 and 4000"))).to_be_visible()
    expect(dashboard.fly_button).to_be_disabled()
    kp.fill("400")
    dashboard.page.get_by_role("textbox", name="ki").fill("20")
    dashboard.fly()
    dashboard.until(lambda: [trial["state"] for trial in dashboard.trials(campaign_id)] == ["valid"])
    [trial] = dashboard.trials(campaign_id)
    assert (trial["kind"], trial["gains"]["kp"], trial["gains"]["ki"]) == ("manual", 400, 20)


def standing(dashboard: Dashboard, *, trial: int) -> str | None:
    drawn = dashboard.trace("takeoffs", "flight", trial=trial)
    return None if drawn is None else str(drawn["meta"]["standing"])


def test_a_flight_marked_invalid_is_left_out_and_can_be_taken_back(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(flights=2)
    dashboard.open_campaign(campaign_id)
    second = dashboard.trials(campaign_id)[1]
    verdict = dashboard.panel("Flight 2")
    expect(verdict).to_contain_text(f"{second['error']:.3f} ± ")
    verdict.get_by_role("button", name="Mark invalid").click()
    verdict.get_by_text("Tracking glitch").click()
    verdict.get_by_role("button", name="Mark invalid").click()
    expect(verdict.get_by_text("Invalid", exact=True)).to_be_visible()
    expect(verdict).to_contain_text("Tracking glitch")
    dashboard.until(lambda: dashboard.trace("errors", "not counted") is not None)
    not_counted = dashboard.trace("errors", "not counted")
    assert not_counted is not None
    assert not_counted["x"] == [2]
    dashboard.until(lambda: standing(dashboard, trial=2) == "invalid")
    verdict.get_by_role("button", name="Undo: mark valid").click()
    expect(verdict.get_by_text("Valid", exact=True)).to_be_visible()
    dashboard.until(lambda: dashboard.trace("errors", "not counted") is None)
    measured = dashboard.trace("errors", "measured")
    assert measured is not None
    assert measured["x"] == [1, 2]


def test_a_campaign_flown_elsewhere_takes_records_as_csv(dashboard: Dashboard, states: States) -> None:
    source = states.campaign(seed=5, flights=1)
    [flown] = dashboard.trials(source)
    record = dashboard.page.request.get(f"{dashboard.url}/api/trials/{flown['id']}/trajectory.csv").body()
    campaign_id = states.campaign("import")
    dashboard.open_campaign(campaign_id)
    expect(dashboard.page.get_by_text("REAL", exact=True).first).to_be_visible()

    def upload(content: bytes) -> None:
        with dashboard.page.expect_file_chooser() as chooser:
            dashboard.button("Upload flight record").click()
        chooser.value.set_files({"name": "flight.csv", "mimeType": "text/csv", "buffer": content})

    upload(b"time_s,altitude_m\n0.0,0.0\n0.1,nan\n0.2,0.3\n")
    refusal = dashboard.page.get_by_role("alert")
    expect(refusal).to_contain_text("altitude_m")
    expect(refusal).to_contain_text("3")
    upload(record)
    expect(dashboard.panel("Flight 1 · best so far")).to_contain_text(f"{flown['error']:.3f} ± ")
    [trial] = dashboard.trials(campaign_id)
    assert trial["error"] == pytest.approx(flown["error"], abs=1e-6)
    dashboard.wait_for_flight(1)
    assert_drawn_as_recorded(dashboard, trial)


def test_a_record_in_another_unit_and_datum_is_offered_to_be_read_so(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign("import")
    dashboard.open_campaign(campaign_id)
    climb = create_climb()
    content = csv_of({"time_s": climb.time_s, "altitude_m": climb["altitude_m"] / 0.3048 + 1417.0})
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Upload flight record").click()
    chooser.value.set_files({"name": "flight.csv", "mimeType": "text/csv", "buffer": content})
    expect(dashboard.page.get_by_role("alert")).to_contain_text("It looks like one with altitude in feet and")
    expect(dashboard.button("Store as an invalid flight")).to_be_visible()
    assert dashboard.trials(campaign_id) == []
    dashboard.button("Read it with altitude in feet, altitude above another level").click()
    dashboard.wait_for_flight(1)
    [trial] = dashboard.trials(campaign_id)
    assert (trial["state"], trial["error"]) == ("valid", pytest.approx(climb_error(1.0), abs=1e-3))


def test_the_record_of_a_flight_can_be_downloaded(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(flights=1)
    [trial] = dashboard.trials(campaign_id)
    dashboard.open(f"/campaigns/{campaign_id}/flights/{trial['id']}")
    drawn = dashboard.trace("flight", "flight")
    assert drawn is not None
    time_s, altitude_m = dashboard.record(trial["id"])
    np.testing.assert_allclose(drawn["y"], np.interp(drawn["x"], time_s, altitude_m), atol=2e-3)
    with dashboard.page.expect_download() as download:
        dashboard.page.get_by_role("link", name="Download record (CSV)").click()
    lines = download.value.path().read_text().splitlines()
    assert lines[0].startswith("time_s,")
    assert len(lines) == 1 + trial["record"]["samples"]


def test_a_flight_at_the_address_of_another_campaign_is_shown_in_its_own(dashboard: Dashboard, states: States) -> None:
    campaign_id, other = states.campaign(flights=1), states.campaign(flights=0)
    [trial] = dashboard.trials(campaign_id)
    dashboard.open(f"/campaigns/{other}/flights/{trial['id']}")
    expect(dashboard.page).to_have_url(re.compile(rf"/campaigns/{campaign_id}/flights/{trial['id']}$"))


def test_a_page_opens_at_its_top_wherever_the_one_before_was_scrolled_to(dashboard: Dashboard, states: States) -> None:
    dashboard.open(f"/campaigns/{states.campaign(flights=1)}")
    page = dashboard.page
    page.set_viewport_size({"width": 800, "height": 500})
    link = page.get_by_role("link", name="Open flight").first
    link.scroll_into_view_if_needed()
    page.mouse.wheel(0, 200)
    dashboard.until(lambda: page.evaluate("window.scrollY") > 100)
    link.click()
    expect(page).to_have_url(re.compile("/flights/"))
    dashboard.until(lambda: page.evaluate("window.scrollY") == 0)


def test_going_back_shows_a_page_where_it_was_left(dashboard: Dashboard, states: States) -> None:
    """Going back within a page, as to an address without `#main`, leaves the next one to open at its top."""
    dashboard.open(f"/campaigns/{states.campaign(flights=1)}")
    page = dashboard.page
    page.evaluate(_COUNT_TOPS)
    page.evaluate("history.pushState(null, '', '#main')")
    page.go_back()
    link = page.get_by_role("link", name="Open flight").first
    link.click()
    expect(page).to_have_url(re.compile("/flights/"))
    assert page.evaluate("window.tops") == 1
    page.go_back()
    expect(link).to_be_visible()
    assert page.evaluate("window.tops") == 1


def test_the_numbers_behind_a_chart_stand_in_a_table(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign(flights=1)
    [trial] = dashboard.trials(campaign_id)
    dashboard.open_campaign(campaign_id)
    dashboard.button("Error per flight: show the numbers as a table").click()
    table = dashboard.page.get_by_role("region", name="Error per flight, numbers")
    expect(table).to_contain_text(f"{trial['error']:.4f}")


def test_the_list_finds_campaigns_by_name_and_vehicle(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    flown = states.campaign(flights=2)
    states.campaign("jsbsim")
    dashboard.open("/")
    cards = dashboard.page.get_by_role("list", name="Campaigns").get_by_role("listitem")
    expect(cards).to_have_count(2)
    best = dashboard.get(f"/campaigns/{flown}")["best"]
    expect(cards.filter(has_text="On twin")).to_contain_text(printed(best["mean"], best["standard_error"]))
    expect(cards.filter(has_text="On twin").locator("svg path")).not_to_have_count(0)
    dashboard.page.get_by_label("Search campaigns by name").fill("jsb")
    expect(cards).to_have_count(1)
    dashboard.page.get_by_label("Search campaigns by name").fill("nothing like it")
    expect(dashboard.page.get_by_text("No campaigns match.")).to_be_visible()


def test_wrong_settings_are_refused_at_their_field(dashboard: Dashboard) -> None:
    dashboard.open("/new")
    page = dashboard.page
    before = dashboard.get("/campaigns")["total"]
    page.get_by_role("button", name=re.compile("^Advanced")).click()
    page.get_by_label("Maximum flights").fill("-3")
    page.get_by_label("kp minimum").fill("3000")
    page.get_by_label("kp maximum").fill("2000")
    page.get_by_label("Scored window").fill("5")
    dashboard.button("Create campaign").click()
    expect(page.get_by_label("Maximum flights")).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_label("Maximum flights")).to_be_focused()
    expect(page.get_by_role("alert")).to_have_text(
        "Correct the marked fields: Maximum flights, Scored window, bounds of kp."
    )
    page.get_by_label("Maximum flights").fill("7")
    dashboard.button("Create campaign").click()
    expect(page.get_by_label("kp maximum")).to_have_attribute("aria-invalid", "true")
    expect(page.get_by_text("must be between 10 and 60 s, got 5")).to_be_visible()
    assert dashboard.get("/campaigns")["total"] == before
    page.get_by_label("kp minimum").fill("0")
    page.get_by_label("Scored window").fill("20")
    dashboard.button("Create campaign").click()
    expect(page.get_by_role("heading", name="AR.Drone takeoff to 3 m, simulated")).to_be_visible()
    made = dashboard.get(f"/campaigns/{dashboard.campaign_id}")
    assert made["definition"]["bounds"] == {"kp": [0, 2000]}
    expect(page.get_by_text("Scored window: 20 s from the takeoff command")).to_be_visible()


def test_what_blocks_a_new_campaign_stands_beside_its_button(dashboard: Dashboard) -> None:
    dashboard.open("/new")
    page, create = dashboard.page, dashboard.button("Create campaign")
    blocked = page.get_by_role("main").get_by_role("status")
    page.get_by_role("button", name=re.compile("^Advanced")).click()
    page.get_by_label("kp maximum").fill("283,5")
    expect(page.get_by_text("Enter a whole number, without a comma.")).to_be_visible()
    name = page.get_by_label("Name", exact=True)
    name.fill(" ")
    expect(create).to_be_disabled()
    expect(blocked).to_have_text("Enter a name. Enter a valid number for kp maximum.")
    expect(blocked).to_be_in_viewport()
    expect(name).to_have_attribute("aria-invalid", "true")
    name.fill("Bee")
    page.get_by_label("kp maximum").fill("2000")
    expect(blocked).to_have_count(0)
    expect(create).to_be_enabled()
