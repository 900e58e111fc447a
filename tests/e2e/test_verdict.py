"""What a flight is worth: marked with a chip, undone, flown again; what that changes; its note and photos."""

from typing import Any

import pytest
from playwright.sync_api import Locator, expect

from tests.campaigns.trials.test_photos import png
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import PHONE, Dashboard
from tests.e2e.states import States

Json = dict[str, Any]


@pytest.fixture
def campaign_id(states: States) -> int:
    """With three valid flights."""
    return states.campaign(stop={"kind": "budget", "max_flights": 12}, flights=3)


def by_error(dashboard: Dashboard, campaign_id: int) -> list[Json]:
    """The flights that count, the best first."""
    valid = [trial for trial in dashboard.trials(campaign_id) if trial["state"] == "valid"]
    return sorted(valid, key=lambda trial: (trial["error"], trial["number"]))


def open_flight(dashboard: Dashboard, trial: Json) -> Locator:
    dashboard.open(f"/campaigns/{trial['campaign_id']}/flights/{trial['id']}")
    return dashboard.panel(f"Flight {trial['number']}")


def test_marking_the_best_invalid_says_what_it_changes_before_and_after_and_is_undone(
    dashboard: Dashboard, campaign_id: int
) -> None:
    best, second, _ = by_error(dashboard, campaign_id)
    before = dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]["history_digest"]
    verdict = open_flight(dashboard, best)
    verdict.get_by_role("button", name="Mark invalid").click()
    expect(verdict).to_contain_text(
        f"Flight {best['number']} is the best. Without it, flight {second['number']} becomes the best, "
        "and the next gains are recomputed."
    )
    verdict.get_by_text("Wind gust").click()
    verdict.get_by_role("button", name="Mark invalid").click()
    expect(verdict).to_contain_text(
        f"Flight {second['number']} is the best. The next gains are computed without flight {best['number']}."
    )
    expect(verdict).to_contain_text("Wind gust")
    assert dashboard.get(f"/campaigns/{campaign_id}")["best"]["trial_number"] == second["number"]
    dashboard.when_ready(campaign_id)
    assert dashboard.get(f"/campaigns/{campaign_id}/proposal")["proposal"]["history_digest"] != before

    verdict.get_by_role("button", name="Undo: mark valid").click()
    expect(verdict.get_by_role("heading", name=f"Flight {best['number']} · best so far")).to_be_visible()
    assert dashboard.get(f"/campaigns/{campaign_id}")["best"]["trial_number"] == best["number"]


def test_a_flight_that_came_to_nothing_is_flown_again_with_its_gains(
    dashboard: Dashboard, states: States, campaign_id: int
) -> None:
    best = by_error(dashboard, campaign_id)[0]
    states.classify(best["id"], "invalid", "Wind gust")
    verdict = open_flight(dashboard, best)
    verdict.get_by_role("button", name="Fly these gains again").click()
    dashboard.until(lambda: len(dashboard.trials(campaign_id)) == 4)
    again = dashboard.trials(campaign_id)[-1]
    assert again["gains"] == best["gains"]
    dashboard.until(lambda: dashboard.get(f"/trials/{again['id']}")["state"] == "valid")


def test_one_tap_after_an_abort_says_whether_it_counts_against_the_gains(
    dashboard: Dashboard, states: States, campaign_id: int
) -> None:
    aborted = dashboard.get(f"/trials/{states.abort(campaign_id)}")
    verdict = open_flight(dashboard, aborted)
    expect(verdict).to_contain_text("It counts against its gains only if the cause was the vehicle's behaviour.")
    badly = verdict.get_by_role("button", name="Vehicle behaviour")
    box = badly.bounding_box()
    assert box is not None
    assert min(box["width"], box["height"]) >= 24
    badly.click()
    expect(verdict).to_contain_text("Aborted because of the vehicle's behaviour: the flight counts against its gains.")
    assert dashboard.get(f"/trials/{aborted['id']}")["abort_cause"] == "behaved badly"
    verdict.get_by_role("button", name="Other cause").click()
    expect(verdict).to_contain_text("the flight does not count against its gains.")
    expect(badly).to_be_visible()

    dashboard.open(f"/fly/{aborted['id']}")
    why = dashboard.page.get_by_role("region", name="Abort cause")
    why.get_by_role("button", name="Vehicle behaviour").click()
    expect(why).to_contain_text("the flight counts against its gains.")


def test_a_note_and_a_photo_stay_with_the_flight(dashboard: Dashboard, campaign_id: int) -> None:
    trial = dashboard.trials(campaign_id)[0]
    page, verdict = dashboard.page, open_flight(dashboard, trial)
    verdict.get_by_text("Note and photos").click()
    verdict.get_by_label("Note on flight 1").fill("Gust from the north at 4 s")
    verdict.get_by_role("button", name="Save note").click()
    expect(verdict.get_by_role("button", name="Save note")).to_have_count(0)
    assert dashboard.get(f"/trials/{trial['id']}")["note"] == "Gust from the north at 4 s"
    assert verdict.locator("input[type=file]").get_attribute("capture") == "environment"

    def choose(name: str, content: bytes) -> None:
        with page.expect_file_chooser() as chooser:
            verdict.get_by_role("button", name="Add photo").click()
        chooser.value.set_files({"name": name, "mimeType": "image/png", "buffer": content})

    choose("page.png", b"<script>alert(1)</script>")
    expect(verdict.get_by_role("alert")).to_contain_text("This is not a JPEG, PNG or WebP picture")
    choose("arena.png", png(64))
    photo = verdict.get_by_role("img", name="Flight 1, 1")
    expect(photo).to_be_visible()
    dashboard.until(lambda: photo.evaluate("image => image.complete && image.naturalWidth === 64"))
    dashboard.open(f"/campaigns/{campaign_id}/flights/{trial['id']}")
    expect(verdict.get_by_label("Note on flight 1")).to_have_value("Gust from the north at 4 s")
    expect(photo).to_be_visible()
    verdict.get_by_role("button", name="Delete photo 1 of flight 1").click()
    verdict.get_by_role("button", name="Cancel").click()
    expect(verdict.get_by_text("cannot be undone")).to_have_count(0)
    assert len(dashboard.get(f"/trials/{trial['id']}/photos")) == 1
    verdict.get_by_role("button", name="Delete photo 1 of flight 1").click()
    verdict.get_by_role("button", name="Delete photo 1", exact=True).click()
    expect(photo).to_have_count(0)
    assert dashboard.get(f"/trials/{trial['id']}/photos") == []


def test_a_note_that_is_being_written_outlives_a_verdict(dashboard: Dashboard, campaign_id: int) -> None:
    trial = dashboard.trials(campaign_id)[0]
    verdict = open_flight(dashboard, trial)
    verdict.get_by_text("Note and photos").click()
    verdict.get_by_label("Note on flight 1").fill("Gust from the north")
    dashboard.page.get_by_role("link", name="Gainline, all campaigns").click()
    expect(dashboard.page.get_by_role("heading", name="Campaigns", exact=True)).to_be_visible()
    dashboard.page.go_back()
    expect(verdict.get_by_label("Note on flight 1")).to_have_value("Gust from the north")
    verdict.get_by_role("button", name="Mark invalid").click()
    verdict.get_by_text("Wind gust").click()
    verdict.get_by_role("button", name="Mark invalid").click()
    expect(verdict.get_by_role("button", name="Undo: mark valid")).to_be_visible()
    expect(verdict.get_by_label("Note on flight 1")).to_have_value("Gust from the north")
    verdict.get_by_role("button", name="Save note").click()
    expect(verdict.get_by_role("button", name="Save note")).to_have_count(0)
    assert dashboard.get(f"/trials/{trial['id']}")["note"] == "Gust from the north"
    verdict.get_by_role("button", name="Undo: mark valid").click()
    verdict.get_by_role("button", name="Mark invalid").click()
    dashboard.page.set_viewport_size(PHONE)
    dashboard.settled()
    assert dashboard.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    verdict.get_by_label("Note on flight 1").fill("x" * 2001)
    expect(verdict.get_by_text("2001 of at most 2000 characters")).to_be_visible()
    expect(verdict.get_by_role("button", name="Save note")).to_be_disabled()


def test_a_card_clones_a_campaign_onto_another_vehicle_and_archives_a_finished_one(
    open_dashboard: Opener, empty_server: Server, states: States
) -> None:
    dashboard = open_dashboard(empty_server.url)
    page = dashboard.page
    campaign_id = states.campaign(name="On the twin", stop={"kind": "budget", "max_flights": 1}, flights=1)
    assert dashboard.get(f"/campaigns/{campaign_id}")["state"] == "finished"
    dashboard.open("/")
    card = page.get_by_role("listitem").filter(has=page.get_by_role("heading", name="On the twin", exact=True))
    card.get_by_text("Clone or archive").click()
    card.get_by_label("Clone to vehicle").select_option("jsbsim")
    card.get_by_role("button", name="Clone").click()
    expect(page.get_by_role("heading", name="On the twin (2)")).to_be_visible()
    assert dashboard.get(f"/campaigns/{dashboard.campaign_id}")["vehicle"]["kind"] == "jsbsim"
    dashboard.open("/")
    card.get_by_text("Clone or archive").click()
    card.get_by_role("button", name="Archive").click()
    expect(card).to_contain_text("not reopened")
    card.get_by_role("button", name="Archive").click()
    expect(card).to_have_count(0)
    assert dashboard.get(f"/campaigns/{campaign_id}")["state"] == "archived"
