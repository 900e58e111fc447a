"""Every page, in three sizes and both themes: readable by everybody, fitting its screen, asking nobody but its server.

With GAINLINE_SCREENSHOTS=1 each is kept in var/screenshots in every size and theme, and on a wide screen too.
"""

import gzip
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import FloatRect, Page, expect

from tests.e2e.conftest import Opener, Server
from tests.e2e.dashboard import DESK, PHONE, TABLET, WIDE, Dashboard, Theme
from tests.e2e.states import States

ROOT = Path(__file__).parents[2]
SCREENSHOTS = ROOT / "var" / "screenshots"
IMAGES = ROOT / "docs" / "images"
ROUTES = ROOT / "frontend" / "src" / "app.tsx"
SIZES = {"desk": DESK, "tablet": TABLET, "phone": PHONE, "wide": WIDE}
ARE_KEPT = "GAINLINE_SCREENSHOTS" in os.environ


@dataclass(frozen=True)
class Look:
    """How a page is looked at."""

    size: str
    theme: Theme
    rules: bool = True
    """Whether axe is asked: once in each theme, on whose colours its answer depends."""


THEMES: tuple[Theme, ...] = ("light", "dark")
LOOKS: tuple[Look, ...] = (
    tuple(Look(size, theme) for size, theme in product(SIZES, THEMES))
    if ARE_KEPT
    else (Look("desk", "light"), Look("tablet", "light", rules=False), Look("phone", "dark"))
)
UI_BYTES_GZIPPED = 256_000
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]

TOO_WIDE = "all => all.filter(one => one.scrollWidth > one.clientWidth + 1).map(one => one.innerText)"


GAINS = {"kp": 300, "ki": 13, "kd": 82}
WRAPPING = {"kp": 283, "ki": 1356, "kd": 82}


class Pages:
    """The path of a page in each interesting state, by a word for it; what it needs is written when it is asked for."""

    def __init__(self, states: States) -> None:
        self._states = states

    def path(self, name: str) -> str:
        fixed = FIXED.get(name)
        return fixed if fixed is not None else str(getattr(self, name.replace("-", "_")))

    def _campaign(self, campaign_id: int) -> str:
        self._states.survey(campaign_id)
        return f"/campaigns/{campaign_id}"

    @cached_property
    def flights_under_way(self) -> tuple[int, list[int]]:
        """A campaign with three flights, the first of them ruled out; and the flights."""
        campaign_id = self._states.campaign(seed=3)
        flights = self._states.fly(campaign_id, 3)
        self._states.classify(flights[0], "invalid", "Wind gust")
        return campaign_id, flights

    @cached_property
    def flights_finished(self) -> tuple[int, list[int]]:
        campaign_id = self._states.campaign("jsbsim", stop={"kind": "budget", "max_flights": 4})
        return campaign_id, self._states.fly(campaign_id, 4)

    @cached_property
    def list(self) -> str:
        _ = self.flights_under_way, self.flights_finished
        return "/"

    @cached_property
    def ready(self) -> str:
        return self._campaign(self._states.campaign(seed=2))

    @cached_property
    def under_way(self) -> str:
        return self._campaign(self.flights_under_way[0])

    @cached_property
    def finished(self) -> str:
        return f"/campaigns/{self.flights_finished[0]}"

    @cached_property
    def elsewhere(self) -> str:
        return self._campaign(self._states.campaign("import"))

    @cached_property
    def overruled(self) -> str:
        """Calibrated, with a repeat, and a flight that the checks had refused."""
        patient = {"kind": "budget", "max_flights": 20}
        campaign_id = self._states.campaign(strategy="calibrated", seed=3, stop=patient, flights=2)
        self._states.repeat(campaign_id)
        self._states.fly_gains(campaign_id, WRAPPING, overrule="the paper flew these gains")
        return self._campaign(campaign_id)

    @cached_property
    def pitch(self) -> str:
        """The F-16, with six gains that are no whole numbers."""
        return self._campaign(
            self._states.campaign("lti", experiment="pitch-tracking", strategy="identified", flights=2)
        )

    @cached_property
    def flight(self) -> str:
        campaign_id, flights = self.flights_under_way
        return f"/campaigns/{campaign_id}/flights/{flights[2]}"

    @cached_property
    def vehicle_id(self) -> int:
        """A vehicle that has never been connected."""
        return self._states.vehicle("Bee", options={"address": "udp:127.0.0.1:14997@14996", "simulated": True})

    @cached_property
    def vehicles(self) -> str:
        _ = self.flights_under_way, self.vehicle_id
        return "/vehicles"

    @cached_property
    def vehicle(self) -> str:
        return f"/vehicles/{self.vehicle_id}"

    @cached_property
    def edit_vehicle(self) -> str:
        return f"/vehicles/{self.vehicle_id}/edit"

    @cached_property
    def shared_vehicle(self) -> str:
        return f"/vehicles/{self._states.vehicle_of(self.flights_under_way[0])}"

    @cached_property
    def fly(self) -> str:
        """A flight that has not begun."""
        return f"/fly/{self._states.plan(self._states.campaign(seed=5), GAINS)}"

    @cached_property
    def reproductions(self) -> str:
        self._states.reproduce("controller")
        return "/reproductions"

    @cached_property
    def compare(self) -> str:
        return f"/compare?trial={self.flights_under_way[1][1]}&trial={self.flights_finished[1][0]}"

    @cached_property
    def kept_log(self) -> tuple[int, int]:
        """A vehicle with two logs, and the later one."""
        earlier, later = self._states.store_logs(logs=2)
        self._states.keep_log(earlier, "Bee")
        return self._states.keep_log(later, "Bee"), later

    @cached_property
    def log_analysis(self) -> str:
        _ = self.kept_log
        return "/log-analysis"

    @cached_property
    def log(self) -> str:
        return f"/log-analysis/{self.kept_log[1]}"

    @cached_property
    def logged_vehicle(self) -> str:
        return f"/log-analysis/vehicles/{self.kept_log[0]}"

    @cached_property
    def jobs(self) -> str:
        _ = self.under_way, self.reproductions
        return "/jobs"


FIXED = {
    "new": "/new",
    "no-logs": "/controller",
    "failure-shapes": "/failure-shapes",
    "new-vehicle": "/vehicles/new",
    "settings": "/settings",
    "missing": "/no/such/page",
}
NAMES: dict[str, tuple[str, ...]] = {
    "": ("list",),
    "new": ("new",),
    "campaigns/:campaignId": ("ready", "under-way", "finished", "elsewhere", "overruled", "pitch"),
    "campaigns/:campaignId/flights/:trialId": ("flight",),
    "compare": ("compare",),
    "fly/:trialId": ("fly",),
    "vehicles": ("vehicles",),
    "vehicles/new": ("new-vehicle",),
    "vehicles/:vehicleId": ("vehicle", "shared-vehicle"),
    "vehicles/:vehicleId/edit": ("edit-vehicle",),
    "reproductions": ("reproductions",),
    "controller/*?": ("no-logs",),
    "log-analysis": ("log-analysis",),
    "log-analysis/:logId": ("log",),
    "log-analysis/vehicles/:vehicleId": ("logged-vehicle",),
    "failure-shapes": ("failure-shapes",),
    "jobs": ("jobs",),
    "settings": ("settings",),
    "*": ("missing",),
}
"""By route of the dashboard."""
WITH_TABS = NAMES["campaigns/:campaignId"]


@pytest.fixture(scope="module")
def pages(states: States) -> Pages:
    """Of a server that holds nothing else."""
    states.clear()
    return Pages(states)


def overflow(dashboard: Dashboard, page: str) -> list[str]:
    """What to say of a page that is wider than its screen, or of figures that reach into each other."""
    wide = dashboard.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    figures = dashboard.page.locator("dd:visible").evaluate_all(TOO_WIDE)
    return ([f"{page} scrolls sideways by {wide} px"] if wide else []) + [f"{page}: no room for {it}" for it in figures]


def open_everything(dashboard: Dashboard) -> None:
    for button in dashboard.page.locator("button[aria-expanded=false]:not([aria-haspopup]):visible").element_handles():
        button.evaluate("one => { one.dataset.openedByTest = '' }")
        button.click()
    dashboard.page.evaluate(
        """document.querySelectorAll('details:not([open])').forEach(one => {
          one.dataset.openedByTest = '';
          one.open = true;
        })"""
    )


def close_it_again(dashboard: Dashboard) -> None:
    dashboard.page.evaluate(
        """document.querySelectorAll('[data-opened-by-test]').forEach(one => {
          if (one.tagName === 'DETAILS') one.open = false;
          else if (one.ariaExpanded === 'true') one.click();
          delete one.dataset.openedByTest;
        })"""
    )


def show(dashboard: Dashboard, look: Look) -> None:
    """As the system's theme and the window's size are changed while the page is open."""
    dashboard.page.set_viewport_size(SIZES[look.size])
    dashboard.page.emulate_media(color_scheme=look.theme)
    dashboard.settled(look.theme)
    assert dashboard.page.evaluate("document.documentElement.dataset.mantineColorScheme") == look.theme


def violations(page: Page) -> list[str]:
    """What keeps somebody from reading it. Without the elements that pass, which take longer to list than to find."""
    page.evaluate("scrollTo(0, 0)")  # what has been scrolled under the header is covered on every page
    page.mouse.move(0, 0)
    options = {"runOnly": {"type": "tag", "values": RULES}, "resultTypes": ["violations"]}
    found = Axe().run(page, options=options)
    return [found.generate_report()] if found.violations_count else []


@pytest.mark.parametrize("name", [name for names in NAMES.values() for name in names])
def test_a_page_can_be_read_by_everybody_and_fits_its_screen(
    open_dashboard: Opener, shared_server: Server, pages: Pages, name: str
) -> None:
    """It is loaded once, and follows the system's theme and the window's size."""
    dashboard = open_dashboard(shared_server.url, viewport=DESK)
    page = dashboard.page
    dashboard.open(pages.path(name))
    refused = []
    for look in LOOKS:
        state = f"{name}-{look.size}-{look.theme}"
        show(dashboard, look)
        refused += overflow(dashboard, state)
        if name == "under-way":
            refused += [f"{state}: too small for a finger: {button}" for button in too_small(page)]
        if ARE_KEPT:
            page.screenshot(path=SCREENSHOTS / f"{state}.png", full_page=True)
        open_everything(dashboard)
        dashboard.settled(look.theme)
        refused += overflow(dashboard, f"{state}, all of it opened,")
        if look.rules:
            refused += [f"{state}: {found}" for found in violations_beside_an_answer(page)]
        close_it_again(dashboard)
        if name in WITH_TABS:
            dashboard.open_tab("Statistics")
            dashboard.settled(look.theme)
            refused += overflow(dashboard, f"{state}, statistics,")
            dashboard.open_tab("Flights")
            page.mouse.move(0, 0)
            dashboard.settled(look.theme)
            refused += [*overflow(dashboard, f"{state}, flights,"), *(violations(page) if look.rules else [])]
            dashboard.open_tab("Error and gains")
            page.mouse.move(0, 0)
    if name in WITH_TABS and name not in {"finished", "pitch"}:  # these have ended, without a proposal
        for details in ("Explanation", "Error landscape"):
            page.get_by_text(details, exact=True).click()
        expect(dashboard.plot("Error landscape")).to_be_visible()
    assert refused == []


def too_small(page: Page) -> list[tuple[str | None, float]]:
    """What is pressed beside a drone, and its height in pixels."""
    return [
        (button.inner_text() or button.get_attribute("aria-label"), box["height"])
        for button in page.locator("button:visible:not(.modebar-btn), summary:visible").all()
        if (box := button.bounding_box()) is not None and box["height"] < 44 and button.inner_text() != "Settings"
    ]


def violations_beside_an_answer(page: Page) -> list[str]:
    """With the answer to the first question that the page explains, if there is one."""
    questions = page.locator("button[aria-haspopup=dialog]:visible").all()[:1]
    for question in questions:
        question.click()
    found = violations(page)
    for _ in questions:
        page.keyboard.press("Escape")
        page.mouse.move(0, 0)  # else it may point at a chart, which shows its tools then
    return found


def test_every_route_of_the_dashboard_is_among_these_pages() -> None:
    assert set(re.findall(r'<Route path="/([^"]*)"', ROUTES.read_text())) == set(NAMES) - {"*"}


@pytest.mark.skipif(
    not os.environ.get("GAINLINE_README_IMAGE"), reason="set GAINLINE_README_IMAGE=1 to renew the image"
)
def test_the_images_of_the_readme_are_taken(dashboard: Dashboard, states: States) -> None:
    pages = {
        "campaign": f"/campaigns/{states.campaign(name='AR.Drone takeoff to 3 m, twin', seed=4, flights=4)}",
        "log": f"/log-analysis/{states.store_logs()[0]}",
    }
    for name, path in pages.items():
        dashboard.open(path)
        dashboard.settled()
        clip = FloatRect(x=0, y=0, width=1024, height=1120)
        dashboard.page.screenshot(path=IMAGES / f"{name}.png", clip=clip, full_page=True)


def test_the_theme_is_switched_and_kept_and_no_chart_offers_to_upload_itself(
    dashboard: Dashboard, pages: Pages
) -> None:
    dashboard.open(pages.path("under-way"))
    dashboard.settled("light")
    dashboard.button("Switch to the dark theme").click()
    dashboard.settled("dark")
    dashboard.page.reload()
    expect(dashboard.button("Switch to the light theme")).to_be_visible()
    expect(dashboard.plot("takeoffs")).to_be_visible()
    dashboard.settled("dark")
    dashboard.plot("takeoffs").hover()
    settings = dashboard.plot("takeoffs").evaluate("gd => [gd._context.showSendToCloud, gd._context.plotlyServerURL]")
    assert settings == [False, ""]
    titles = dashboard.page.locator(".modebar-btn").evaluate_all("all => all.map(one => one.dataset.title)")
    assert not [title for title in titles if title and ("share" in title.lower() or "cloud" in title.lower())]


def test_the_ui_stays_light_before_its_charts() -> None:
    assets = ROOT / "frontend" / "dist" / "assets"
    size: Callable[[Path], int] = lambda path: len(gzip.compress(path.read_bytes(), 9))  # noqa: E731
    first = [path for path in assets.iterdir() if path.suffix in {".js", ".css"} and "plotly" not in path.name]
    assert sum(map(size, first)) <= UI_BYTES_GZIPPED, {path.name: size(path) for path in first}


@pytest.mark.parametrize("path", ["/campaigns/999999", "/campaigns/abc", "/campaigns/1/flights/999999"])
def test_an_unknown_address_shows_not_found(dashboard: Dashboard, path: str) -> None:
    dashboard.open(path)
    main = dashboard.page.get_by_role("main")
    expect(main.get_by_text(re.compile("^(There is no|Page not found)")).first).to_be_visible()
