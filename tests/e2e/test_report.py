"""The report as whoever gets it opens it: a file, with no server and no network; and campaigns that travel as files."""

import re
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, FilePayload, Page, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import DESK, PHONE, TABLET, Dashboard, Viewport
from tests.e2e.test_pages import RULES, SCREENSHOTS

NAME = "<script>document.title = 'taken'</script> & <b>wing</b>"
CHARTS = ("takeoffs", "errors", "gains", "landscape")
DRAWN = str(len(CHARTS))


@pytest.fixture(scope="module")
def campaign_id(shared_server: Server, browser: Browser) -> int:
    """Three flights, one of them ruled out and with a photo; and the landscape of the next gains."""
    context = browser.new_context()
    dashboard = Dashboard(context.new_page(), shared_server.url)
    made = dashboard.create("twin", name=NAME, seed=6)
    dashboard.fly_headless(made, 3)
    second = dashboard.trials(made)[1]
    dashboard.post(f"/trials/{second['id']}/classify",
                   {"version": second["version"], "outcome": "invalid", "reason": "Gust"})  # fmt: skip
    dashboard.when_ready(made)
    picture = FilePayload(name="photo.jpg", mimeType="image/jpeg", buffer=dashboard.page.screenshot(type="jpeg"))
    added = context.request.post(f"{shared_server.url}/api/trials/{second['id']}/photos", multipart={"file": picture})
    assert added.ok, added.text()
    dashboard.until(lambda: dashboard.get(f"/campaigns/{made}/figures/landscape")["state"] == "ready")
    context.close()
    return made


@pytest.fixture(scope="module")
def file(shared_server: Server, browser: Browser, campaign_id: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    context = browser.new_context()
    answer = context.request.get(f"{shared_server.url}/api/campaigns/{campaign_id}/report.html")
    assert answer.ok
    saved = tmp_path_factory.mktemp("report") / "report.html"
    saved.write_bytes(answer.body())
    context.close()
    return saved


def opened(browser: Browser, file: Path, viewport: Viewport) -> tuple[Page, list[str]]:
    """The page, drawn, and whatever it asked for or complained about."""
    context = browser.new_context(viewport=viewport, offline=True)
    page = context.new_page()
    noted: list[str] = []
    page.on("request", lambda request: noted.append(request.url) if request.url != file.as_uri() else None)
    page.on("console", lambda message: noted.append(message.text))
    page.on("pageerror", lambda error: noted.append(str(error)))
    page.goto(file.as_uri())
    expect(page.locator("html")).to_have_attribute("data-drawn", DRAWN)
    return page, noted


@pytest.mark.parametrize("viewport", [DESK, TABLET, PHONE], ids=["desk", "tablet", "phone"])
def test_the_file_draws_its_charts_with_no_network_and_can_be_read_by_everybody(
    browser: Browser, file: Path, viewport: Viewport
) -> None:
    page, noted = opened(browser, file, viewport)
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
    page.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")
    found = Axe().run(page, options={"runOnly": {"type": "tag", "values": RULES}})
    assert found.violations_count == 0, found.generate_report()
    assert noted == []
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SCREENSHOTS / f"report-{viewport['width']}-light.png", full_page=True)
    page.context.close()


def test_the_file_draws_what_the_page_draws(
    browser: Browser, file: Path, open_dashboard: Opener, shared_server: Server, campaign_id: int
) -> None:
    dashboard = open_dashboard(shared_server.url)
    page, _ = opened(browser, file, TABLET)
    for chart in CHARTS:
        card = dashboard.get(f"/campaigns/{campaign_id}/figures/{chart}?stacked=true")
        ours = page.locator(f"#chart-{chart}").evaluate("one => one.data.map(trace => [trace.name, trace.y ?? []])")
        assert ours == [[trace.get("name"), trace.get("y") or []] for trace in card["figure"]["data"]]
    page.context.close()


def test_printed_from_any_browser_no_chart_is_cut(browser: Browser, file: Path) -> None:
    page, _ = opened(browser, file, PHONE)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    for chart in CHARTS:
        expect(page.locator(f"#chart-{chart} .main-svg").first).to_have_attribute("width", "680")
    printed = page.pdf(prefer_css_page_size=True)
    assert printed.startswith(b"%PDF-")
    page.context.close()


def test_served_the_report_runs_under_a_policy_of_its_own(
    open_dashboard: Opener, shared_server: Server, campaign_id: int
) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open_campaign(campaign_id)
    with dashboard.page.context.expect_page() as coming:
        dashboard.page.get_by_role("link", name="Report", exact=True).click()
    report = coming.value
    noted: list[str] = []
    report.on("console", lambda message: noted.append(message.text))
    expect(report.locator("html")).to_have_attribute("data-drawn", DRAWN)
    assert report.evaluate("origin") == "null", "the report shares the dashboard's origin"
    assert noted == []


def test_the_pdf_is_saved_from_the_campaign(
    open_dashboard: Opener, shared_server: Server, campaign_id: int, tmp_path: Path
) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open_campaign(campaign_id)
    with dashboard.page.expect_download(timeout=60_000) as coming:
        dashboard.button("PDF").click()
    assert coming.value.suggested_filename == f"campaign-{campaign_id}-report.pdf"
    coming.value.save_as(tmp_path / "report.pdf")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF-")


def test_a_campaign_travels_as_a_file(
    open_dashboard: Opener, shared_server: Server, own_server: Server, campaign_id: int, tmp_path: Path
) -> None:
    dashboard = open_dashboard(shared_server.url)
    dashboard.open_campaign(campaign_id)
    with dashboard.page.expect_download() as coming:
        dashboard.page.get_by_role("button", name="Download bundle").click()
    bundle = tmp_path / "campaign.zip"
    coming.value.save_as(bundle)
    there = open_dashboard(own_server.url)
    there.open()
    expect(there.page.get_by_role("heading", name="Tune a takeoff in a handful of flights")).to_be_visible()
    there.page.locator("input[type=file]").set_input_files(bundle)
    expect(there.page).to_have_url(re.compile(r"/campaigns/\d+$"))
    expect(there.page.get_by_role("heading", level=1)).to_have_text(NAME)
    ours = dashboard.get(f"/campaigns/{campaign_id}/statistics")
    assert there.get(f"/campaigns/{there.campaign_id}/statistics") == ours
    there.open()
    (tmp_path / "spoiled.zip").write_bytes(bundle.read_bytes()[:-40])
    there.page.locator("input[type=file]").set_input_files(tmp_path / "spoiled.zip")
    expect(there.page.get_by_role("alert")).to_contain_text("nothing was stored")
