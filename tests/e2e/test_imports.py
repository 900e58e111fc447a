"""Logs of flights flown elsewhere, handed in through the page."""

import re

from playwright.sync_api import FilePayload, expect

from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import recorded

DEFAULT, TUNED = "paparazzi_283_13_82.tlog", "paparazzi_1624_1356_195.tlog"


def hand_in(dashboard: Dashboard, *files: tuple[str, bytes]) -> None:
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Upload flight record").click()
    chooser.value.set_files(
        [FilePayload(name=name, mimeType="application/octet-stream", buffer=content) for name, content in files]
    )


def test_of_several_takeoffs_one_is_chosen_and_gains_that_were_not_planned_are_confirmed(
    dashboard: Dashboard, states: States
) -> None:
    campaign_id = states.campaign("import")
    dashboard.open_campaign(campaign_id)
    hand_in(dashboard, ("both.tlog", recorded(DEFAULT) + recorded(TUNED)))
    choices = dashboard.page.get_by_role("button", name=re.compile(r"^Takeoff \d: "))
    expect(choices).to_have_count(2)
    choices.nth(1).click()
    expect(dashboard.page.get_by_text("The log was flown with kp 1624, ki 1356, kd 195")).to_be_visible()
    dashboard.button("Import with the gains in the log").click()
    dashboard.until(lambda: any(trial["state"] == "valid" for trial in dashboard.trials(campaign_id)))
    [trial] = dashboard.trials(campaign_id)
    assert (trial["gains"]["ki"], trial["kind"]) == (1356, "manual")


def test_a_ground_log_is_handed_in_together_with_its_companion(dashboard: Dashboard, states: States) -> None:
    campaign_id = states.campaign("import")
    dashboard.open_campaign(campaign_id)
    data = data_of(Flight({"kp": 283, "ki": 13, "kd": 82})).encode()
    hand_in(dashboard, ("flight.log", COMPANION.encode()), ("flight.data", data))
    dashboard.until(lambda: any(trial["state"] == "valid" for trial in dashboard.trials(campaign_id)))
    [trial] = dashboard.trials(campaign_id)
    assert trial["read_back"] == {"kp": 283, "ki": 13, "kd": 82}
