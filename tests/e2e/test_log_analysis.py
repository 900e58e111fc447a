"""The page of a log analysis: a log dropped and chosen, its answer, the parameter file, and logs that are refused."""

import re
from base64 import b64encode
from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.logs.recorded import recorded
from tests.logs.written import ardupilot_log

DROP = """([name, content]) => {
  const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
  const data = new DataTransfer();
  data.items.add(new File([bytes], name));
  return data;
}"""


@pytest.fixture
def page_of_analysis(open_dashboard: Opener, empty_server: Server) -> Dashboard:
    dashboard = open_dashboard(empty_server.url)
    dashboard.open("/log-analysis")
    return dashboard


def choose(dashboard: Dashboard, name: str, content: bytes) -> None:
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Choose log").click()
    chooser.value.set_files([FilePayload(name=name, mimeType="application/octet-stream", buffer=content)])


def test_a_log_that_is_dropped_gives_gains_to_load(page_of_analysis: Dashboard, tmp_path: Path) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    content = b64encode(recorded("arducopter_steps.bin")).decode()
    dropped = page.evaluate_handle(DROP, ["steps.bin", content])
    page.get_by_role("heading", name="Log analysis").dispatch_event("drop", {"dataTransfer": dropped})
    article = page.get_by_role("article", name="Analysis of steps.bin")
    expect(article).to_contain_text("Mean deviation: 23.4 mm measured.")
    expect(article).to_contain_text("thrust slope 1.00 ± 0.01")
    rows = article.get_by_role("region", name="Gains compared").locator("tbody tr")
    expect(rows).to_have_count(6)
    expect(rows.nth(1)).to_contain_text("Proposed")
    assert {one["meta"]["line"] for one in dashboard.traces("The flight and its prediction")} == {
        "Reference",
        "Flown",
        "Predicted with the proposed gains",
    }
    with page.expect_download() as download:
        page.get_by_role("link", name="Download parameter file").click()
    assert download.value.suggested_filename == "steps.param"
    content_of_file = Path(download.value.path()).read_text().splitlines()
    lines = [line for line in content_of_file if not line.startswith("#")]
    assert [line.split(",")[0] for line in lines] == ["PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I"]
    proposed = rows.nth(1).locator("td").all_inner_texts()
    assert [line.split(",")[1] for line in lines] == proposed[1:5]
    expect(dashboard.button("Start campaign")).to_be_visible()


def test_a_telemetry_log_of_takeoffs_gives_a_section_of_the_airframe_file_and_starts_a_campaign(
    page_of_analysis: Dashboard,
) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    choose(dashboard, "takeoff.tlog", recorded("paparazzi_283_13_82.tlog"))
    article = page.get_by_role("article", name="Analysis of takeoff.tlog")
    expect(article).to_contain_text("Mean distance from 3 m: 0.330 m measured.")
    expect(article).to_contain_text("hover throttle 0.63")
    rows = article.get_by_role("region", name="Gains compared").locator("tbody tr")
    expect(rows).to_have_count(2)
    assert "Predicted with the proposed gains" in {
        one["meta"]["line"] for one in dashboard.traces("The takeoff and its prediction")
    }
    with page.expect_download() as download:
        page.get_by_role("link", name="Download parameter file").click()
    assert download.value.suggested_filename == "takeoff.xml"
    content = Path(download.value.path()).read_text()
    kp = rows.nth(1).locator("td").all_inner_texts()[1]
    assert f'<define name="HOVER_KP" value="{kp}"/>' in content
    proposed = rows.nth(1).locator("td").all_inner_texts()[1:4]
    dashboard.button("Start campaign").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("takeoff")
    assert [trial["gains"] for trial in dashboard.trials(dashboard.campaign_id)] == [{"kp": 283, "ki": 13, "kd": 82}]
    dashboard.when_ready(dashboard.campaign_id)
    gains = dashboard.get(f"/campaigns/{dashboard.campaign_id}/proposal")["proposal"]["gains"]
    expect(page.get_by_role("heading", name="Next: flight 2")).to_be_visible()
    assert [f"{gains[name]:g}" for name in ("kp", "ki", "kd")] == proposed


def test_a_log_that_cannot_be_analysed_is_refused_and_the_next_one_is_not(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    choose(dashboard, "takeoff.bin", recorded("px4_takeoff.ulg"))
    expect(page.get_by_role("alert")).to_contain_text("Takeoffs are left out: their ramp decides, not the gains.")
    choose(dashboard, "flight.bin", ardupilot_log(simulated_flight(GUSTY)))
    expect(page.get_by_role("article", name="Analysis of flight.bin")).to_be_visible()
    expect(page.get_by_role("alert")).to_have_count(0)


def test_the_same_log_can_be_sent_again_and_another_theme_sends_nothing(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if "log-analyses" in request.url else None)
    for _ in range(2):
        with page.expect_response(lambda response: "log-analyses" in response.url):
            choose(dashboard, "notes.bin", b"hello")
        expect(page.get_by_role("alert")).to_contain_text("is not a log")
    page.evaluate("() => { dispatchEvent(new Event('focus')); document.dispatchEvent(new Event('visibilitychange')); }")
    page.get_by_role("button", name=re.compile("^Switch to the")).click()
    expect(page.get_by_role("alert")).to_contain_text("is not a log")
    assert len(sent) == 2
