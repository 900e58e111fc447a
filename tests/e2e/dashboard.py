"""The dashboard as a test sees it: what is on the page, what a chart has drawn, and what the API says."""

import re
from collections.abc import Callable
from functools import partial
from typing import Any, Final, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Locator, Page, ViewportSize, expect

from app.figures.theme import PALETTES
from tests.waiting import Waits, wait_for

T = TypeVar("T")
Theme = Literal["light", "dark"]
Viewport = ViewportSize
Json = dict[str, Any]

WIDE: Final = Viewport(width=1920, height=1080)
DESK: Final = Viewport(width=1440, height=900)
TABLET: Final = Viewport(width=1024, height=768)
PHONE: Final = Viewport(width=390, height=844)
CHARTS: Final = {"takeoffs": "Takeoff curves", "errors": "Error per flight", "gains": "Gains per flight",
                 "flight": "Record"}  # fmt: skip

POLL_MS: Final = 50

_READ_TRACES: Final = """
gd => gd.data.map(trace => ({
  meta: trace.meta, name: trace.name, x: Array.from(trace.x ?? []), y: Array.from(trace.y ?? []),
  dash: trace.line?.dash, width: trace.line?.width, bar: trace.error_y?.value, bars: trace.error_y?.array,
}))
"""

_SETTLED: Final = """async ([ink, within]) => {
  const until = performance.now() + within;
  const later = ms => new Promise(done => setTimeout(done, ms));
  const frame = () => Promise.race([new Promise(requestAnimationFrame), later(1000)]);
  const all = (what, within = document) => Array.from(within.querySelectorAll(what));
  const isDrawn = plot => plot.dataset.drawn && (!ink || !plot.layout || plot.layout.font.color === ink);
  const fits = plot =>
    !plot._fullLayout || !plot.clientWidth || Math.abs(plot._fullLayout.width - plot.clientWidth) < 2;
  const undrawn = () => all("[role=group] > div:last-child").filter(one => !isDrawn(one) || !fits(one));
  const waiting = () => [...all("[aria-busy=true]"), ...undrawn()];
  const places = () => all("main, main section, .js-plotly-plot").map(one => {
    const {x, y, width, height} = one.getBoundingClientRect();
    return [x, y, width, height].map(Math.round);
  }).join(";");
  const isMoving = () => document.getAnimations().some(
    one => one.playState === "running" && one.effect?.getComputedTiming().endTime < Infinity);
  await Promise.race([document.fonts.ready, later(within)]);
  const [x, y] = [scrollX, scrollY];
  window.seenInTest ??= new WeakSet();
  for (const section of all("main section").filter(one => !window.seenInTest.has(one))) {
    window.seenInTest.add(section);
    section.scrollIntoView();
    await frame();
    await frame();
  }
  for (let same = 0, last = ""; same < 3;) {
    await frame();
    const late = waiting();
    if (performance.now() > until) {
      const moving = document.getAnimations().map(one => one.animationName ?? one.transitionProperty);
      throw new Error(`not settled: ${late.map(one => one.outerHTML.slice(0, 300)).join("; ")} ${moving} ${last}`);
    }
    late[0]?.scrollIntoView();
    const now = places();
    same = late.length === 0 && now === last && !isMoving() ? same + 1 : 0;
    last = now;
  }
  scrollTo(x, y);
  await frame();
}"""
"""Until everything is fetched and drawn, in view or not, and nothing has moved for three frames. A frame that
the browser does not give is waited for one second."""


def printed(value: float, uncertainty: float | None, unit: str = "m") -> str:
    """`0.105 ± 0.012 m`: two digits of an uncertainty that begins with less than 3.55, else one.

    `0.105 m` where the repeats were identical, as those of a drone without scatter are on a quiet machine.
    """
    if not uncertainty:
        return f"{value:.3f} {unit}"
    power = int(np.floor(np.log10(uncertainty)))
    digits = max(0, 1 - power if uncertainty / 10.0**power < 3.55 else -power)
    return f"{value:.{digits}f} ± {uncertainty:.{digits}f} {unit}"


def open_details(page: Page) -> None:
    """Those that are there by now."""
    page.evaluate("document.querySelectorAll('details').forEach(one => { one.open = true })")


class Dashboard:
    """One tab."""

    def __init__(self, page: Page, url: str) -> None:
        self.page = page
        self.url = url

    # ---- pages

    def open(self, path: str = "/") -> None:
        self.page.goto(path)
        expect(self.page.get_by_text("Live", exact=True)).to_be_visible()

    def open_campaign(self, campaign_id: int) -> None:
        self.open(f"/campaigns/{campaign_id}")
        expect(self.plot("takeoffs")).to_be_visible()

    @property
    def campaign_id(self) -> int:
        """The campaign of the page."""
        found = re.search(r"/campaigns/(\d+)", self.page.url)
        assert found is not None, self.page.url
        return int(found.group(1))

    def button(self, name: str) -> Locator:
        return self.page.get_by_role("button", name=name, exact=True)

    def panel(self, title: str) -> Locator:
        """The panel with that heading, or one that begins so."""
        heading = self.page.get_by_role("heading", name=re.compile(rf"^{re.escape(title)}"))
        return self.page.locator("section").filter(has=heading)

    def open_tab(self, title: str) -> None:
        """One of the tabs below a campaign's charts."""
        self.page.get_by_role("tab", name=title).click()

    def choose_speed(self, label: Literal["1×", "10×", "Max"]) -> None:
        self.page.get_by_role("radiogroup", name="Simulation speed").get_by_text(label, exact=True).click()

    def fly(self) -> None:
        """Fly what is chosen, once the page shows what follows the last flight."""
        numbers = [trial["number"] for trial in self.trials(self.campaign_id)]
        self.button(f"Fly flight {max(numbers, default=0) + 1}").click()

    @property
    def fly_button(self) -> Locator:
        """Flies the gains that are chosen, the recommended ones at first."""
        return self.page.get_by_role("button", name=re.compile(r"^Fly flight \d+$"))

    def choose(self, choice: str) -> None:
        """Choose what to fly next: Step, Smaller step, Repeat, Baseline or Custom gains."""
        self.page.get_by_role("radiogroup", name="Gains to fly").get_by_text(re.compile(f"^{choice}")).click()

    def choose_proposed(self, campaign_id: int) -> None:
        """Choose what the strategy proposes, whether or not that is what is recommended."""
        choices = self.get(f"/campaigns/{campaign_id}/proposal")["proposal"]["choices"]
        self.choose(next(each["kind"] for each in choices if each["proposed"]).capitalize())

    # ---- charts

    def plot(self, chart: str) -> Locator:
        group = self.page.get_by_role("group", name=re.compile(rf"^{CHARTS.get(chart, chart)}"))
        return group.locator(".js-plotly-plot")

    def traces(self, chart: str) -> list[Json]:
        """What the chart has drawn, in order."""
        drawn: list[Json] = self.plot(chart).evaluate(_READ_TRACES)
        return drawn

    def trace(self, chart: str, role: str, **meta: object) -> Json | None:
        wanted = {"role": role, **meta}.items()
        return next((one for one in self.traces(chart) if one["meta"].items() >= wanted), None)

    def wait_for_flight(self, number: int) -> None:
        """Until the curve of that flight is drawn."""
        self.until(lambda: self.trace("takeoffs", "flight", trial=number) is not None)

    def live_points(self) -> int:
        live = self.trace("takeoffs", "live")
        return 0 if live is None else len(live["x"])

    def settled(self, theme: Theme | None = None) -> None:
        """Wait until nothing is being fetched or drawn any more, what is drawn once it is seen included, the charts in
        that theme's colours, and nothing moves."""
        self.page.evaluate(_SETTLED, [None if theme is None else PALETTES[theme].ink, 1000 * Waits.at_most_s])

    # ---- the API's own word

    def get(self, path: str) -> Any:
        # Again where the server had just closed the connection for having been idle.
        answer = self.page.request.get(f"{self.url}/api{path}", max_retries=2)
        assert answer.ok, answer.text()
        return answer.json()

    def post(self, path: str, body: Json | None = None) -> Any:
        answer = self.page.request.post(f"{self.url}/api{path}", data=body or {})
        assert answer.ok, answer.text()
        return answer.json()

    def create(self, vehicle: str = "twin", *, name: str = "", **definition: object) -> int:
        """A campaign under the paper's stop rule, unless another is named, whose first gains are computed."""
        defined = {"strategy": "gradient", "stop": {"kind": "paper"}, **definition}
        made = self.post(
            "/campaigns", {"name": name or f"On {vehicle}", "vehicle": {"kind": vehicle}, "definition": defined}
        )
        return self.when_ready(int(made["id"]))

    def when_ready(self, campaign_id: int) -> int:
        self.until(lambda: self.get(f"/campaigns/{campaign_id}/proposal")["state"] == "ready")
        return campaign_id

    def trials(self, campaign_id: int) -> list[Json]:
        found: list[Json] = self.get(f"/campaigns/{campaign_id}/trials?limit=200")["items"]
        return found

    def fly_headless(self, campaign_id: int, flights: int) -> None:
        """Fly so many proposals at full speed, over the API."""
        for number in range(1, flights + 1):
            self.when_ready(campaign_id)
            proposal = self.get(f"/campaigns/{campaign_id}/proposal")["proposal"]
            self.post(f"/campaigns/{campaign_id}/trials", {"proposal_id": proposal["id"], "fly": {"speed": None}})
            self.until(partial(self._classed, campaign_id, number))

    def _classed(self, campaign_id: int, number: int) -> bool:
        return any(trial["number"] == number and trial["state"] == "valid" for trial in self.trials(campaign_id))

    def fly_headless_body(self, campaign_id: int, body: Json) -> Json:
        """Fly gains or a variant at full speed, over the API; the trial as it then is."""
        self.when_ready(campaign_id)
        trial = self.post(f"/campaigns/{campaign_id}/trials", {**body, "fly": {"speed": None}})
        self.until(lambda: self.get(f"/trials/{trial['id']}")["state"] not in {"planned", "staged", "flying"})
        found: Json = self.get(f"/trials/{trial['id']}")
        return found

    def record(self, trial_id: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time and altitude of a flight as the API gives them."""
        record = self.get(f"/trials/{trial_id}/trajectory?points=20000")
        return np.array(record["time_s"]), np.array(record["channels"]["altitude_m"])

    # ---- waiting

    def until(self, holds: Callable[[], T | None]) -> T:
        """Wait until that gives something true, which is returned, letting the page live meanwhile."""
        return wait_for("this to hold", holds, lambda: self.page.wait_for_timeout(POLL_MS))
