"""The report as whoever gets it opens it: a file, with no server and no network; and campaigns that travel as files."""

import re
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from playwright.sync_api import Browser, Page, expect

from tests.campaigns.trials.test_photos import png
from tests.e2e.conftest import Opener, Server, served
from tests.e2e.dashboard import DESK, PHONE, TABLET, Dashboard, Viewport, open_details
from tests.e2e.states import States
from tests.e2e.test_pages import violations
from tests.waiting import Waits

NAME = "<script>document.title = 'taken'</script> & <b>wing</b>"
CHARTS = ("takeoffs", "errors", "gains")
DRAWN = str(len(CHARTS))


@pytest.fixture(scope="module")
def campaign_id(states: States) -> int:
    """Three flights, one of them ruled out and with a photo."""
    made = states.campaign(name=NAME, seed=6)
    _, second, _ = states.fly(made, 3)
    states.classify(second, "invalid", "Gust")
    states.photograph(second, png(400))
    return made


@pytest.fixture(scope="module")
def file(shared_server: Server, campaign_id: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    answer = httpx2.get(f"{shared_server.url}/api/campaigns/{campaign_id}/report.html", timeout=Waits.at_most_s)
    assert answer.is_success
    saved = tmp_path_factory.mktemp("report") / "report.html"
    saved.write_bytes(answer.content)
    return saved


class Reader:
    """A browser with no network that opens the file again and again, and what it asked for or complained about."""

    def __init__(self, browser: Browser, file: Path) -> None:
        self._file = file
        self.page = browser.new_context(offline=True).new_page()
        self.noted: list[str] = []
        self.page.on("request", lambda request: self._note(request.url, unless=file.as_uri()))
        self.page.on("console", lambda message: self._note(message.text))
        self.page.on("pageerror", lambda error: self._note(str(error)))

    def open(self, viewport: Viewport) -> Page:
        """The page, drawn."""
        self.noted.clear()
        self.page.set_viewport_size(viewport)
        self.page.emulate_media(media="screen")
        self.page.goto(self._file.as_uri())
        expect(self.page.locator("html")).to_have_attribute("data-drawn", DRAWN)
        return self.page

    def _note(self, what: str, unless: str = "") -> None:
        if what != unless:
            self.noted.append(what)


@pytest.fixture(scope="module")
def reader(browser: Browser, file: Path) -> Iterator[Reader]:
    one = Reader(browser, file)
    yield one
    one.page.context.close()


@pytest.mark.parametrize("viewport", [DESK, PHONE], ids=["desk", "phone"])
def test_the_file_draws_its_charts_with_no_network_and_can_be_read_by_everybody(
    reader: Reader, viewport: Viewport
) -> None:
    page = reader.open(viewport)
    assert page.title() == f"{NAME} · Gainline report"
    expect(page.get_by_role("heading", level=1)).to_have_text(NAME)
    for chart in CHARTS:
        assert page.locator(f"#chart-{chart} .main-svg").count() > 0
        drawn = page.locator(f"#chart-{chart}").evaluate("one => [one.data.length, one.clientWidth]")
        assert drawn[0] > 0
        assert 300 < drawn[1] <= viewport["width"]
    photo = page.get_by_role("img", name="Photo 1 of flight 2")
    assert 100 < photo.evaluate("one => one.complete && one.naturalWidth && one.clientWidth") < viewport["width"]
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    open_details(page)
    assert violations(page) == []
    assert reader.noted == []


def test_the_file_draws_what_the_page_draws_and_printed_from_any_browser_no_chart_is_cut(
    reader: Reader, dashboard: Dashboard, campaign_id: int
) -> None:
    page = reader.open(TABLET)
    for chart in CHARTS:
        card = dashboard.get(f"/campaigns/{campaign_id}/figures/{chart}")
        ours = page.locator(f"#chart-{chart}").evaluate("one => one.data.map(trace => [trace.name, trace.y ?? []])")
        assert ours == [[trace.get("name"), trace.get("y") or []] for trace in card["figure"]["data"]]
    page.set_viewport_size(PHONE)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    for chart in CHARTS:
        expect(page.locator(f"#chart-{chart} .main-svg").first).to_have_attribute("width", "680")
    printed = page.pdf(prefer_css_page_size=True)
    assert printed.startswith(b"%PDF-")


def test_served_the_report_runs_under_a_policy_of_its_own_and_is_saved_as_pdf(
    open_dashboard: Opener, shared_server: Server, campaign_id: int
) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open_campaign(campaign_id)
    with dashboard.page.context.expect_page() as coming:
        dashboard.page.get_by_role("link", name="Open report", exact=True).click()
    report = coming.value
    noted: list[str] = []
    report.on("console", lambda message: noted.append(message.text))
    expect(report.locator("html")).to_have_attribute("data-drawn", DRAWN)
    assert report.evaluate("origin") == "null", "the report shares the dashboard's origin"
    assert noted == []
    with dashboard.page.expect_download() as downloaded:
        dashboard.button("PDF").click()
    assert downloaded.value.suggested_filename == f"campaign-{campaign_id}-report.pdf"
    assert downloaded.value.path().read_bytes().startswith(b"%PDF-")


@pytest.fixture
def server_elsewhere(tmp_path: Path) -> Iterator[Server]:
    """Without a worker: nothing flies or is computed there."""
    with served(tmp_path / "data", 0, "--no-worker") as server:
        yield server


def test_a_campaign_travels_as_a_file(
    open_dashboard: Opener, shared_server: Server, server_elsewhere: Server, campaign_id: int, tmp_path: Path
) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open_campaign(campaign_id)
    with dashboard.page.expect_download() as coming:
        dashboard.page.get_by_role("button", name="Export bundle").click()
    bundle = tmp_path / "campaign.zip"
    coming.value.save_as(bundle)
    there = open_dashboard(server_elsewhere.url)
    there.page.goto("/")
    expect(there.page.get_by_role("heading", name="Tune a takeoff in a few flights")).to_be_visible()
    there.page.locator("input[type=file][accept='.zip']").set_input_files(bundle)
    expect(there.page).to_have_url(re.compile(r"/campaigns/\d+$"))
    expect(there.page.get_by_role("heading", level=1)).to_have_text(NAME)
    ours = dashboard.get(f"/campaigns/{campaign_id}/statistics")
    assert there.get(f"/campaigns/{there.campaign_id}/statistics") == ours
    there.page.goto("/")
    (tmp_path / "spoiled.zip").write_bytes(bundle.read_bytes()[:-40])
    there.page.locator("input[type=file][accept='.zip']").set_input_files(tmp_path / "spoiled.zip")
    expect(there.page.get_by_role("alert")).to_contain_text("nothing was stored")
