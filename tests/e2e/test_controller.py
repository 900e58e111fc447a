"""The page of controller checks: the example, a log of one's own, gains asked for, a file that cannot be read."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import FilePayload, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import Dashboard, Json
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import recorded

TRACES = Path(__file__).parents[1] / "data" / "vertical_loop"
DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
_FEEDBACK = 16
"""Place of fb_cmd in a line of VERT_LOOP."""


@pytest.fixture
def page_of_checks(open_dashboard: Opener, empty_server: Server) -> Dashboard:
    dashboard = open_dashboard(empty_server.url)
    dashboard.open("/controller")
    return dashboard


def choose(dashboard: Dashboard, *files: FilePayload | Path) -> None:
    with dashboard.page.expect_file_chooser() as chooser:
        dashboard.button("Choose recording").click()
    chooser.value.set_files(list(files))  # type: ignore[arg-type]


def file_of(name: str, content: str) -> FilePayload:
    return FilePayload(name=name, mimeType="application/octet-stream", buffer=content.encode())


def newest(dashboard: Dashboard) -> Json:
    check_id = dashboard.get("/controller-checks")["items"][0]["id"]
    found: Json = dashboard.get(f"/controller-checks/{check_id}")
    return found


def assert_drawn_as_told(dashboard: Dashboard, check: Json) -> None:
    for figure in check["figures"]:
        told = dashboard.get(f"/controller-checks/{check['id']}/figures/{figure['name']}")["figure"]["data"]
        expect(dashboard.plot(figure["title"])).to_be_visible()
        drawn = dashboard.traces(figure["title"])
        assert [(one["meta"], one["x"], one["y"]) for one in drawn] == [
            (one["meta"], one["x"], one["y"]) for one in told
        ]


def test_one_click_shows_what_a_check_is(page_of_checks: Dashboard) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    expect(page.get_by_text("Every signal is compared with Gainline's replica of the controller")).to_be_visible()
    dashboard.button("Check example").click()
    expect(page.get_by_text("The replica agrees: all 8\N{NARROW NO-BREAK SPACE}192 steps are exact")).to_be_visible()
    check = newest(dashboard)
    assert page.url.endswith(f"/controller/{check['id']}")
    shown = page.get_by_role("region", name="Difference of every signal").locator("tbody tr").all_inner_texts()
    assert [row.split(",")[0] for row in shown] == [signal["name"] for signal in check["signals"]]
    assert all("0 counts" in row and "exact" in row for row in shown)
    assert_drawn_as_told(dashboard, check)
    page.reload()
    expect(page.get_by_text(check["sentence"])).to_be_visible()


def with_other_feedback(data: str, commands: int) -> str:
    """The log with a feedback that its loop cannot have computed in so many of its commands."""
    lines = [line.split() for line in data.splitlines()]
    for fields in [fields for fields in lines if fields[2] == "VERT_LOOP"][-commands:]:
        fields[_FEEDBACK] = str(int(fields[_FEEDBACK]) + 50)
    return "\n".join(" ".join(fields) for fields in lines) + "\n"


def test_a_log_of_another_loop_is_marked_where_it_differs(page_of_checks: Dashboard) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    flown = data_of(Flight(DEFAULT))
    choose(dashboard, file_of("flight.data", with_other_feedback(flown, 200)), file_of("flight.log", COMPANION))
    expect(page.get_by_text("The replica differs: ")).to_be_visible()
    check = newest(dashboard)
    assert (check["passed"], check["gains"]) == (False, None)
    assert_drawn_as_told(dashboard, check)
    marks = dashboard.trace("Commands", "differs", line="Differs")
    assert marks is not None
    assert len(marks["x"]) == 200
    choose(dashboard, file_of("flight.data", flown), file_of("flight.log", COMPANION))
    expect(page.get_by_text("The replica agrees: 669 of 669 commands are bit-exact.")).to_be_visible()
    checked = page.get_by_role("list", name="Earlier checks").get_by_role("listitem")
    expect(checked).to_have_count(2)
    expect(checked.first).to_contain_text("Agrees")
    expect(checked.last).to_contain_text("Differs")
    checked.last.get_by_role("link", name="flight.data").click()
    expect(page.get_by_text(check["sentence"])).to_be_visible()
    page.get_by_role("button", name="Delete the check of flight.data").last.click()
    expect(checked).to_have_count(1)
    assert page.url.endswith("/controller")


def test_a_calm_log_asks_for_its_gains(page_of_checks: Dashboard) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    lines = data_of(Flight(DEFAULT)).splitlines()
    choose(dashboard, file_of("calm.data", "\n".join(line for line in lines if float(line.split()[0]) > 40.0)))
    expect(page.get_by_role("alert")).to_contain_text("calm.data does not contain the gains flown")
    page.get_by_label("Gains flown: kp, ki, kd").fill("283, 13, 82")
    dashboard.button("Check calm.data with these gains").click()
    expect(page.get_by_text("The replica agrees: ")).to_be_visible()
    assert newest(dashboard)["gains_from"] == "given"


def test_the_log_of_an_arducopter_is_compared_with_its_own_replica(page_of_checks: Dashboard) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    content = recorded("arducopter_steps.bin")
    choose(dashboard, FilePayload(name="steps.bin", mimeType="application/octet-stream", buffer=content))
    article = page.get_by_role("article", name="Check of steps.bin")
    expect(article).to_contain_text(
        "The replica agrees: all 238 logged rows are within the tolerances in all 5 signals."
    )
    expect(article).to_contain_text("ArduCopter")
    check = newest(dashboard)
    assert (check["passed"], check["kind"], check["gains"]["PSC_VELZ_P"]) == (True, "log", 5.0)
    assert_drawn_as_told(dashboard, check)


def test_what_is_no_recording_is_refused_in_words_above_the_verdict_on_an_earlier_one(
    page_of_checks: Dashboard,
) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    choose(dashboard, FilePayload(name="cut.csv.gz", mimeType="application/gzip",
                                  buffer=(TRACES / "climb_rates.csv.gz").read_bytes()[:4000]))  # fmt: skip
    expect(page.get_by_role("alert")).to_contain_text("cut.csv.gz is damaged or not a text file")
    assert dashboard.get("/controller-checks")["total"] == 0
    dashboard.button("Check example").click()
    result = page.get_by_text(re.compile("^The replica agrees"))
    expect(result).to_be_visible()
    choose(dashboard, file_of("alive.data", "1.0 31 ALIVE 1\n"))
    heading = page.get_by_role("heading", name="alive.data was not checked")
    expect(heading).to_be_in_viewport()
    refusal, verdict = heading.bounding_box(), result.bounding_box()
    assert refusal is not None
    assert verdict is not None
    assert refusal["y"] < verdict["y"]
    expect(page.get_by_role("alert")).to_contain_text("contains no VERT_LOOP")
    assert dashboard.get("/controller-checks")["total"] == 1


def test_a_file_may_be_dropped_on_the_page(page_of_checks: Dashboard) -> None:
    dashboard, page = page_of_checks, page_of_checks.page
    dropped = page.evaluate_handle(
        """text => {
          const data = new DataTransfer();
          data.items.add(new File([text], "dropped.data"));
          return data;
        }""",
        data_of(Flight(DEFAULT, fly_s=12.0)),
    )
    page.get_by_role("heading", name="Controller check").dispatch_event("drop", {"dataTransfer": dropped})
    expect(page.get_by_role("article", name="Check of dropped.data")).to_be_visible()
    assert newest(dashboard)["gains_from"] == "computed from the commands"
