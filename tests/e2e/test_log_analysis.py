"""The pages of log analysis: a log dropped and chosen, its answer, the parameter file, the comparison with the replica,
logs that are refused; and the library: kept logs of a vehicle, compared, shared and deleted."""

import re
from base64 import b64encode
from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard
from tests.e2e.states import States
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import recorded
from tests.logs.written import ardupilot_log

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
FEEDBACK = 16
"""Place of fb_cmd in a line of VERT_LOOP."""

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


def choose(dashboard: Dashboard, name: str, content: bytes, companion: str = "", *, button: str = "Choose log") -> None:
    files = {name: content} | ({"flight.log": companion.encode()} if companion else {})
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button(button).click()
    chooser.value.set_files(
        [FilePayload(name=each, mimeType="application/octet-stream", buffer=it) for each, it in files.items()]
    )


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
    expect(article).to_contain_text(
        "The replica agrees: all 238 logged rows are within the tolerances in all 5 signals."
    )
    signals = article.get_by_role("region", name="Difference of every signal").locator("tbody tr").all_inner_texts()
    assert [row.split(",")[0] for row in signals] == ["z_d_m", "v_d_m_s", "a_d_m_s2", "v_t_m_s", "throttle"]
    assert {one["meta"]["role"] for one in dashboard.traces("Shaped target")} == {"recorded", "replica"}


def test_a_telemetry_log_of_takeoffs_gives_a_section_of_the_airframe_file_and_starts_a_campaign(
    page_of_analysis: Dashboard,
) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    choose(dashboard, "takeoff.tlog", recorded("paparazzi_283_13_82.tlog"))
    article = page.get_by_role("article", name="Analysis of takeoff.tlog")
    expect(article).to_contain_text("Mean distance from 3 m: 0.330 m measured.")
    expect(article).to_contain_text("hover throttle 0.63")
    expect(article).to_contain_text("The log contains no VERT_LOOP, the loop's inputs and commands.")
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
    page.reload()  # its takeoffs are in the file alone
    choose(dashboard, "takeoff.tlog", recorded("paparazzi_283_13_82.tlog"), button="Choose file")
    dashboard.button("Start campaign").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("takeoff")
    assert [trial["gains"] for trial in dashboard.trials(dashboard.campaign_id)] == [{"kp": 283, "ki": 13, "kd": 82}]
    dashboard.when_ready(dashboard.campaign_id)
    gains = dashboard.get(f"/campaigns/{dashboard.campaign_id}/proposal")["proposal"]["gains"]
    expect(page.get_by_role("heading", name="Next: flight 2")).to_be_visible()
    assert [f"{gains[name]:g}" for name in ("kp", "ki", "kd")] == proposed


def test_a_log_that_gives_no_gains_says_why_and_tells_what_it_can(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    choose(dashboard, "takeoff.bin", recorded("px4_takeoff.ulg"))
    article = page.get_by_role("article", name="Analysis of takeoff.bin")
    expect(article.get_by_role("heading", level=1)).to_have_text("takeoff.bin")
    headings = article.get_by_role("heading", level=2)
    expect(headings.nth(1)).to_have_text("Gains")
    expect(headings.nth(2)).to_have_text("Replica of the controller")
    expect(article).to_contain_text("Partial answer")
    expect(article).to_contain_text("left out: 9.4 s (only takeoffs or landings)")
    expect(article.get_by_label("Whole flight")).to_contain_text("Hover throttle")
    expect(article.get_by_role("region", name="Gains compared").locator("tbody tr")).to_have_count(4)
    expect(article).to_contain_text("Takeoffs are left out: their ramp decides, not the gains.")
    choose(dashboard, "flight.bin", ardupilot_log(simulated_flight(GUSTY)))
    expect(page.get_by_role("article", name="Analysis of flight.bin")).to_be_visible()
    expect(page.get_by_text("Full answer")).to_be_visible()


def test_one_click_shows_what_an_answer_is(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    dashboard.button("Analyse example log").click()
    expect(page.get_by_text("The replica agrees: all 238 logged rows")).to_be_visible()
    told = dashboard.get(f"/log-analyses/{page.url.rpartition('/')[2]}")["figures"]["light"]
    for card in [*told["tuning"], *told["replica"]]:
        expect(dashboard.plot(card["title"])).to_be_visible()
        drawn = dashboard.traces(card["title"])
        assert [(one["meta"], one["x"], one["y"]) for one in drawn] == [
            (one["meta"], one["x"], one["y"]) for one in card["figure"]["data"]
        ]


def with_other_feedback(data: str, commands: int) -> str:
    """The log with a feedback that its loop cannot have computed in so many of its commands."""
    lines = [line.split() for line in data.splitlines()]
    for fields in [fields for fields in lines if fields[2] == "VERT_LOOP"][-commands:]:
        fields[FEEDBACK] = str(int(fields[FEEDBACK]) + 50)
    return "\n".join(" ".join(fields) for fields in lines) + "\n"


def test_a_log_of_another_loop_is_marked_where_it_differs(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    other = with_other_feedback(data_of(Flight(DEFAULT)), 200)
    choose(dashboard, "flight.data", other.encode(), COMPANION)
    expect(page.get_by_text("The replica differs: ")).to_be_visible()
    marks = dashboard.trace("Commands", "differs", line="Differs")
    assert marks is not None
    assert len(marks["x"]) == 200


def test_a_calm_log_asks_for_its_gains(page_of_analysis: Dashboard) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    lines = data_of(Flight(DEFAULT)).splitlines()
    calm = "\n".join(line for line in lines if float(line.split()[0]) > 40.0)
    choose(dashboard, "calm.data", calm.encode())
    expect(page.get_by_role("article")).to_contain_text("calm.data does not contain the gains flown")
    page.get_by_label("Gains flown: kp, ki, kd").fill("283, 13, 82")
    dashboard.button("Analyse calm.data with these gains").click()
    expect(page.get_by_role("article")).to_contain_text("The replica agrees: ")
    expect(page.get_by_role("article")).to_contain_text("gains kp 283, ki 13, kd 82, given")


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


def keep(dashboard: Dashboard, name: str) -> None:
    dashboard.page.get_by_label("Vehicle", exact=True).fill(name)
    dashboard.button("Keep").click()
    expect(dashboard.page.get_by_role("heading", name=f"Kept as a log of {name}")).to_be_visible()


def test_a_log_is_kept_found_again_compared_shared_and_deleted(
    page_of_analysis: Dashboard, open_dashboard: Opener, states: States
) -> None:
    dashboard, page = page_of_analysis, page_of_analysis.page
    [earlier] = states.store_logs()
    states.keep_log(earlier, "Bee")
    choose(dashboard, "steps.bin", recorded("arducopter_lateral_steps.bin"))
    article = page.get_by_role("article", name="Analysis of steps.bin")
    expect(article).to_contain_text("It is deleted seven days later")
    address = page.url
    page.get_by_label("Store the file too").check()
    keep(dashboard, "Bee")
    compared = dashboard.panel("Compared with")
    expect(compared.get_by_label("Compared with")).to_have_value(str(earlier))
    expect(compared.get_by_role("region", name="Numbers of both logs").locator("tbody tr")).to_have_count(4)
    with page.expect_download() as download:
        page.get_by_role("link", name="Log file").click()
    assert Path(download.value.path()).read_bytes() == recorded("arducopter_lateral_steps.bin")

    page.reload()
    expect(dashboard.panel("Kept as a log of Bee")).to_be_visible()
    shared = open_dashboard(dashboard.url, alone=True, unlocked=False)
    shared.open(address.removeprefix(dashboard.url))
    expect(shared.page.get_by_role("article")).to_contain_text("Kept as a log of Bee")
    shared.page.get_by_role("link", name="Bee").click()
    expect(shared.page.get_by_role("region", name="Logs of Bee").locator("tbody tr")).to_have_count(2)
    expect(shared.plot("Trend")).to_be_visible()
    shared.page.get_by_role("link", name="Compare", exact=True).click()
    expect(shared.panel("Compared with").get_by_label("Compared with")).to_have_value(str(earlier))

    choose(dashboard, "the same.bin", recorded("arducopter_lateral_steps.bin"))
    expect(page.get_by_text("Analysed before, on ")).to_be_visible()
    assert page.url == address
    dashboard.button("Delete log").click()
    dashboard.button("Delete log").click()
    expect(page.get_by_role("heading", name="Log analysis", level=1)).to_be_visible()
    expect(page.get_by_role("region", name="Kept logs", exact=True).locator("tbody tr")).to_have_count(1)
    shared.page.reload()
    expect(shared.page.get_by_role("heading", name="Page not found")).to_be_visible()


def test_a_campaign_starts_from_a_stored_log_once_a_vehicle_can_fly_it(dashboard: Dashboard, states: States) -> None:
    [log_id] = states.store_logs()
    dashboard.open(f"/log-analysis/{log_id}")
    dashboard.button("Start campaign").click()
    expect(dashboard.page.get_by_role("alert")).to_contain_text("Register the vehicle of the log")
    options = {"address": "udp:127.0.0.1:14997@14996", "autopilot": "ardupilot", "simulated": True}
    states.vehicle("Bee", options=options)
    dashboard.button("Start campaign").click()
    expect(dashboard.page.get_by_role("heading", level=1)).to_have_text("altitude_steps")


def test_a_vehicle_is_recognised_by_its_hardware_id_whatever_its_name_is_by_then(
    dashboard: Dashboard, states: States
) -> None:
    page = dashboard.page
    first, second = states.store_logs(hardware_id="0039004a3131510a34373830", logs=2)
    vehicle_id = states.keep_log(first, "Bee")
    dashboard.open(f"/log-analysis/{second}")
    expect(page.get_by_text("Recognised by its hardware id.")).to_be_visible()
    states.rename_logged_vehicle(vehicle_id, "Wasp")
    dashboard.button("Keep as a log of Bee").click()
    expect(page.get_by_role("alert")).to_contain_text("its hardware id is that of Wasp")
    dashboard.button("Keep as a log of Wasp").click()
    expect(page.get_by_role("heading", name="Kept as a log of Wasp")).to_be_visible()
    page.get_by_role("link", name="Wasp").click()
    page.get_by_text("Rename", exact=True).click()
    page.get_by_label("Name").fill("Hornet")
    dashboard.button("Save").click()
    expect(page.get_by_role("heading", name="Hornet")).to_be_visible()
