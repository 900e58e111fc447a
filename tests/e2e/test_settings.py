"""Settings, the help for keys, explanations, and what is said aloud."""

import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import PHONE, Dashboard, open_details
from tests.e2e.states import States
from tests.runtime.processes import Serving

VOICE = """
window.said = [];
const voice = {speak: ({text}) => window.said.push(text), cancel: () => {}};
Object.defineProperty(window, "speechSynthesis", {value: voice});
window.SpeechSynthesisUtterance = class { constructor(text) { this.text = text; } };
"""
"""Stands in for the browser's voice: headless, it has none."""


def said(dashboard: Dashboard) -> list[str]:
    spoken: list[str] = dashboard.page.evaluate("window.said")
    return spoken


def theme_of(dashboard: Dashboard) -> object:
    return dashboard.page.evaluate("document.documentElement.dataset.mantineColorScheme")


def test_theme_and_name_are_kept_by_this_browser(dashboard: Dashboard) -> None:
    dashboard.open("/settings")
    dashboard.page.get_by_role("radiogroup", name="Appearance").get_by_text("Dark", exact=True).click()
    dashboard.page.get_by_label("Your name").fill("Jaime")
    dashboard.page.reload()
    expect(dashboard.page.get_by_label("Your name")).to_have_value("Jaime")
    assert theme_of(dashboard) == "dark"
    dashboard.page.get_by_role("radiogroup", name="Appearance").get_by_text("System", exact=True).click()
    dashboard.until(lambda: theme_of(dashboard) == "light")


def test_on_a_phone_settings_are_behind_a_menu_and_say_how_a_tablet_gets_in_and_what_the_server_is(
    open_dashboard: Opener, shared_server: Server
) -> None:
    dashboard = open_dashboard(shared_server.url, viewport=PHONE)
    dashboard.open("/vehicles")
    dashboard.button("More pages").click()
    dashboard.page.get_by_role("navigation", name="Pages").get_by_role("link", name="Settings").click()
    expect(dashboard.page.get_by_role("heading", name="Settings", level=1)).to_be_visible()
    panel = dashboard.panel("Open on a tablet")
    expect(panel).to_contain_text("gainline serve --host 0.0.0.0")
    expect(panel).to_contain_text("fly only from a browser on the computer that runs the server")
    expect(panel.locator("code", has_text="gainline unlock")).to_be_visible()
    expect(panel).not_to_contain_text("`")
    expect(panel.get_by_role("img")).to_have_count(0)
    system, server = dashboard.get("/system"), dashboard.panel("This server")
    for name in ("version", "database_revision", "data_dir"):
        expect(server).to_contain_text(system[name])
    expect(server.locator("dd", has_text="B").first).to_be_visible()


def test_a_server_that_others_reach_shows_its_address_to_a_camera(open_dashboard: Opener, tmp_path: Path) -> None:
    ui = {name: value for name, value in os.environ.items() if name == "GAINLINE_UI_DIR"}
    with Serving(tmp_path / "data", "--no-worker", "--host", "0.0.0.0", **ui) as server:
        addresses = [each["url"] for each in server.get("/system")["addresses"]]
        if not addresses:
            pytest.skip("this machine is in no network")
        dashboard = open_dashboard(server.url)
        dashboard.page.goto("/settings")
        panel = dashboard.panel("Open on a tablet")
        code = panel.get_by_role("img", name=f"QR code of {addresses[0]}")
        expect(code).to_be_visible()
        dashboard.until(lambda: bool(code.evaluate("image => image.naturalWidth > 0")))
        expect(panel.get_by_role("link", name=addresses[0])).to_be_visible()
        expect(panel).to_contain_text("anyone who can reach this computer")


def test_a_backup_holds_what_the_dashboard_shows_and_a_refused_one_shows_the_reason_instead(
    dashboard: Dashboard, states: States, tmp_path: Path
) -> None:
    campaign_id = states.campaign(name="Worth keeping")
    dashboard.open("/settings")
    with dashboard.page.expect_download() as waiting:
        dashboard.button("Download backup").click()
    assert waiting.value.suggested_filename.endswith(".sqlite3")
    waiting.value.save_as(tmp_path / "copy.sqlite3")
    with closing(sqlite3.connect(tmp_path / "copy.sqlite3")) as copy:
        found = copy.execute("SELECT name FROM campaign WHERE id = ?", (campaign_id,)).fetchone()
    assert found == ("Worth keeping",)
    problem = {"title": "Storage error", "status": 507, "detail": "There is too little disk space for a copy.",
               "hint": "Free some disk space."}  # fmt: skip
    dashboard.page.route("**/api/system/backup", lambda route: route.fulfill(status=507, json=problem))
    dashboard.button("Download backup").click()
    told = dashboard.panel("Backup").get_by_role("alert")
    expect(told).to_contain_text("There is too little disk space for a copy.")
    expect(told).to_contain_text("Free some disk space.")


def test_keys_are_explained_by_a_key_those_of_the_page_first_and_a_search_takes_it_as_text(
    dashboard: Dashboard, states: States
) -> None:
    states.campaign()
    dashboard.open("/")
    page = dashboard.page
    help_ = page.get_by_role("dialog", name="Keyboard shortcuts")
    page.keyboard.press("?")
    expect(help_).to_be_visible()
    expect(help_).to_be_focused()
    expect(help_.locator("kbd").first).to_have_text("/")
    expect(help_).to_contain_text("Abort the flight")
    page.keyboard.press("Escape")
    expect(help_).to_be_hidden()
    dashboard.button("Keyboard shortcuts").click()
    expect(help_).to_be_visible()
    page.keyboard.press("Escape")
    search = page.get_by_label("Search")
    expect(search).to_be_visible()
    page.keyboard.press("/")
    expect(search).to_be_focused()
    page.keyboard.type("what?")
    expect(search).to_have_value("what?")
    expect(help_).to_be_hidden()


def test_screen_readers_always_get_announcements_and_speech_only_when_switched_on(
    open_dashboard: Opener, shared_server: Server, states: States
) -> None:
    dashboard = open_dashboard(shared_server.url, alone=True)
    dashboard.page.add_init_script(VOICE)
    campaign_id = states.campaign()
    dashboard.open(f"/campaigns/{campaign_id}")
    region = dashboard.page.locator("[aria-live=polite]", has_text="Landed")
    dashboard.fly_headless(campaign_id, 1)
    expect(region).to_contain_text("Landed, valid, ")
    assert said(dashboard) == []

    dashboard.open("/settings")
    dashboard.page.get_by_role("checkbox", name="Spoken announcements").click()
    dashboard.until(lambda: said(dashboard) == ["Announcements are on."])
    dashboard.open(f"/campaigns/{campaign_id}")
    dashboard.fly_headless_body(campaign_id, {"variant": "repeat"})
    error = dashboard.trials(campaign_id)[-1]["error"]
    dashboard.until(lambda: f"Landed, valid, {error:.2f} metres." in said(dashboard))
    assert "Taking off." in said(dashboard)


ASKED = {
    "What is the error?", "What is the predicted error?", "What is the interval?", "What is the overshoot?",
    "What is the rise time?", "What is the settling time?", "What is the steady-state error?",
    "How do the flights correct the model?", "What does the gate check?", "What is the flight-to-flight scatter?",
    "What is the standard error?", "When is a difference significant?", "What do the lines mean?",
    "What does the next flight have to beat?", "What are the fitted parameters?",
}  # fmt: skip


def test_every_number_that_one_may_ask_about_is_explained_by_keyboard(dashboard: Dashboard, states: States) -> None:
    patient = {"kind": "budget", "max_flights": 20}
    campaign_id = states.campaign(strategy="calibrated", stop=patient, flights=2)
    states.repeat(campaign_id)
    dashboard.open_campaign(campaign_id)
    dashboard.choose_proposed(campaign_id)
    questions = dashboard.page.locator("main button[aria-haspopup=dialog]:visible")
    asked: set[str] = set()
    for tab in ("Error and gains", "Flights", "Statistics"):
        dashboard.open_tab(tab)
        dashboard.settled()
        open_details(dashboard.page)
        for question in questions.all():
            words = question.get_attribute("aria-label") or ""
            if words in asked:
                continue
            question.focus()
            dashboard.page.keyboard.press("Enter")
            answer = dashboard.page.locator(f"[role=dialog][aria-label='{words}']:popover-open")
            expect(answer).to_be_focused()
            assert len(answer.inner_text()) > 60, words
            dashboard.page.keyboard.press("Escape")
            expect(answer).to_have_count(0)
            expect(question).to_be_focused()
            asked.add(words)
    assert asked >= ASKED
