"""Loading and interaction times of the dashboard in Chromium, with up to a thousand flights.

    ./dev exec python -m bench.dashboard [--rounds 3] [--flights 1000]

Runs a real server on a database with a campaign of 50 flights, one of a thousand (16 700 samples each) and 2000 small
ones (`bench.seeding`). The server has been up for ten seconds, so that its worker has loaded its modules. Each figure
is measured in a new Chromium profile.

- Interactive: the search field of the list accepts a letter.
- Drawn: all three charts of the campaign have been painted.
- Interactions: a scripted session on the campaign of a thousand flights (pointing along curves, markers and rows,
  selecting rows and markers, switching the time range, zooming and resetting, opening tables). The browser reports the
  time from each event to the next paint if it is 16 ms or more (Event Timing). Quicker events are not reported, so the
  95th percentile is that of the slower ones.
- Weight: scripts and styles that the page loads, compressed, without the chart library.

The quickest of several rounds counts, because the machine may be busy. Prints the figures; exits with 1 if one is above
its limit.
"""

import argparse
import contextlib
import gzip
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from playwright.sync_api import Browser, Page, Request, sync_playwright

from bench.seeding import seed_database

T = TypeVar("T")

FIRST_PAGE_S: Final = 1.5
FIFTY_S: Final = 2.0
THOUSAND_S: Final = 3.0
INTERACTION_MS: Final = 200.0
WEIGHT_KB: Final = 256.0
LIST_MS: Final = 200.0
CAMPAIGNS: Final = 2000
PATIENCE_MS: Final = 60_000
STARTED_S: Final = 10.0
NAMES: Final = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS: Final = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking")
CHARTS: Final = ("Takeoff curves", "Error per flight", "Gains per flight")

OBSERVE: Final = """
window.told = [];
window.seen = {};
const looks = {charts: () => document.querySelectorAll('[data-drawn]').length > 2,
               rows: () => document.querySelector('tbody tr[data-flight]') !== null};
(function look() {
  for (const [name, holds] of Object.entries(looks)) {
    if (!(name in seen) && holds()) {
      seen[name] = 0;
      requestAnimationFrame(() => setTimeout(() => { seen[name] = performance.now(); }, 0));
    }
  }
  requestAnimationFrame(look);
})();
new PerformanceObserver(list => {
  for (const entry of list.getEntries()) {
    told.push([entry.name, entry.duration, entry.interactionId, entry.startTime]);
  }
}).observe({type: 'event', durationThreshold: 16, buffered: true});
"""
PAINTED: Final = "() => new Promise(done => requestAnimationFrame(() => setTimeout(() => done(performance.now()), 0)))"


@contextlib.contextmanager
def server(data_dir: Path) -> Iterator[str]:
    """Run `gainline serve` in another process, wait until it has started, and yield its address."""
    gainline = Path(sys.executable).with_name("gainline")
    command = [str(gainline), "serve", "--port", "0", "--data-dir", str(data_dir)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout is not None
        address = next(
            (found.group() for line in process.stdout if (found := re.search(r"http://\S+:\d+", line)) is not None),
            None,
        )
        assert address is not None, "the server did not start"
        try:
            time.sleep(STARTED_S)
            yield address
        finally:
            process.send_signal(signal.SIGTERM)
            process.communicate(timeout=30)


@contextlib.contextmanager
def tab(browser: Browser, address: str) -> Iterator[Page]:
    """Open a page in a new browser profile, so that nothing is cached."""
    context = browser.new_context(base_url=address, viewport={"width": 1440, "height": 900})
    context.add_init_script(OBSERVE)
    page = context.new_page()
    page.set_default_timeout(PATIENCE_MS)
    yield page
    context.close()


def first_page_s(page: Page) -> float:
    """Return the time until a letter typed into the search has been painted."""
    page.goto("/", wait_until="commit")
    search = page.get_by_label("Search campaigns by name")
    search.press("a")
    return float(page.evaluate(PAINTED)) / 1e3


def drawn_s(page: Page, campaign_id: int) -> tuple[float, float]:
    """Return the time until the three charts were painted, and until the rows of the table were there too."""
    page.goto(f"/campaigns/{campaign_id}", wait_until="commit")
    page.locator("[data-drawn]").nth(2).wait_for()
    page.locator("tbody tr[data-flight]").first.wait_for(state="attached")
    page.evaluate(PAINTED)
    seen: Mapping[str, float] = page.evaluate("seen")
    return seen["charts"] / 1e3, seen["rows"] / 1e3


def durations_ms(page: Page, campaign_id: int) -> tuple[list[float], list[float]]:
    """Return the times from interaction to paint, and from pointer movement to paint, that are 16 ms or more.

    An interaction (with an interactionId) is a click, a tap or a key; its events count as one.
    """
    drawn_s(page, campaign_id)
    page.wait_for_timeout(2000)
    page.evaluate("told.length = 0")
    use(page)
    page.wait_for_timeout(500)
    interactions: dict[float, float] = {}
    pointing: dict[tuple[str, int], float] = {}
    for name, duration, interaction, began in page.evaluate("told"):
        if interaction:
            interactions[interaction] = max(interactions.get(interaction, 0.0), float(duration))
        else:
            pointing[str(name), round(float(began))] = float(duration)
    return list(interactions.values()), list(pointing.values())


def use(page: Page) -> None:
    """Perform the session."""
    boxes = [page.get_by_role("group", name=re.compile(f"^{title}")) for title in CHARTS]
    for chart in boxes:
        chart.scroll_into_view_if_needed()
        box = chart.bounding_box()
        assert box is not None
        for share in np.linspace(0.1, 0.9, 25):
            page.mouse.move(box["x"] + share * box["width"], box["y"] + (0.3 + 0.3 * share) * box["height"])
            page.wait_for_timeout(30)
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        page.wait_for_timeout(300)
    page.get_by_role("tab", name="Flights").click()
    _rows(page)
    page.get_by_role("tab", name="Error and gains").click()
    boxes[0].scroll_into_view_if_needed()
    _zoom(page)
    for span in ("First 8 s", "Whole flight"):
        page.get_by_role("radiogroup", name="Time range").get_by_text(span, exact=True).click()
        page.wait_for_timeout(600)
    for title in CHARTS:
        for act in ("show the numbers as a table", "show the chart"):
            page.get_by_role("button", name=f"{title}: {act}").click()
            page.wait_for_timeout(400)


def _rows(page: Page) -> None:
    rows = page.locator("tbody tr[data-flight]")
    for index in range(0, 40, 4):
        rows.nth(index).hover()
        page.wait_for_timeout(200)
        if index % 8 == 0:
            rows.nth(index).get_by_role("button").click()
            page.wait_for_timeout(400)


def _zoom(page: Page) -> None:
    """Zoom to about 2 to 8 s, point along the curves, and reset."""
    box = page.get_by_role("group", name=re.compile(f"^{CHARTS[0]}")).locator(".nsewdrag").first.bounding_box()
    assert box is not None
    for first, last in ((0.1, 0.3), (0.4, 0.6)):
        middle = box["y"] + 0.4 * box["height"]
        page.mouse.move(box["x"] + first * box["width"], middle)
        page.mouse.down()
        page.mouse.move(box["x"] + last * box["width"], middle, steps=8)
        page.mouse.up()
        page.wait_for_timeout(1000)
    page.mouse.dblclick(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    page.wait_for_timeout(1000)


def weight_kb(page: Page, path: str, ready: str) -> float:
    """Return the gzip size of the scripts and styles that the page loads, without the chart library."""
    bodies: list[bytes] = []
    page.on("requestfinished", lambda request: _keep(request, bodies))
    page.goto(path)
    page.locator(ready).first.wait_for()
    page.wait_for_timeout(3000)
    return sum(len(gzip.compress(body, 6)) for body in bodies) / 1e3


def _keep(request: Request, bodies: list[bytes]) -> None:
    if request.resource_type not in {"script", "stylesheet"} or "plotly" in request.url:
        return
    if (answer := request.response()) is not None:
        bodies.append(answer.body())


LISTED: Final = """async order => {
  const began = performance.now();
  await (await fetch(`/api/campaigns?limit=24&sort=${order}`)).json();
  return performance.now() - began;
}"""


def listing_ms(page: Page, order: str) -> float:
    """Return the time of one page of the list of campaigns over HTTP, the quickest of five."""
    return min(float(page.evaluate(LISTED, order)) for _ in range(5))


def opening(browser: Browser, address: str, campaigns: Mapping[str, int], rounds: int) -> Iterator[bool]:
    """Measure the loading times of the pages, each round in a new profile; the quickest round counts."""
    with_each = [_in_new_tab(browser, address, first_page_s) for _ in range(rounds)]
    yield said("first page interactive", min(with_each), FIRST_PAGE_S, "s")
    for (name, campaign_id), limit_s in zip(campaigns.items(), (FIFTY_S, THOUSAND_S), strict=True):
        found = [_in_new_tab(browser, address, partial(drawn_s, campaign_id=campaign_id)) for _ in range(rounds)]
        charts_s, rows_s = (min(each) for each in zip(*found, strict=True))
        yield said(f"campaign of {name} drawn", charts_s, limit_s, "s")
        print(f"  with the rows of its table {rows_s:.2f} s")


def using(browser: Browser, address: str, campaign_id: int) -> Iterator[bool]:
    """Measure interactions on a campaign's page and the list of campaigns."""
    acts_ms, pointing_ms = _in_new_tab(browser, address, partial(durations_ms, campaign_id=campaign_id))
    yield said("interaction to next paint, p95", float(np.quantile(acts_ms, 0.95)), INTERACTION_MS, "ms")
    for what, found_ms in (("interactions", acts_ms), ("events of pointing", pointing_ms)):
        median_ms, high_ms = np.quantile(found_ms, [0.5, 0.95])
        print(
            f"  {len(found_ms)} {what} took 16 ms or more: "
            f"p50 {median_ms:.0f}, p95 {high_ms:.0f}, max {max(found_ms):.0f} ms"
        )
    with tab(browser, address) as page:
        page.goto("/")
        for order in ("-updated", "name", "error"):
            yield said(f"list of {CAMPAIGNS} campaigns, by {order}", listing_ms(page, order), LIST_MS, "ms")


def weighing(browser: Browser, address: str, campaign_id: int) -> Iterator[bool]:
    """Measure the scripts and styles of a page."""
    for path, ready in (("/", "ul[aria-label=Campaigns]"), (f"/campaigns/{campaign_id}", "[data-drawn]")):
        weight = _in_new_tab(browser, address, partial(weight_kb, path=path, ready=ready))
        yield said(f"scripts and styles of {path}, compressed", weight, WEIGHT_KB, "kB")


def _in_new_tab(browser: Browser, address: str, take: Callable[[Page], T]) -> T:
    with tab(browser, address) as page:
        return take(page)


def said(what: str, figure: float, limit: float, unit: str) -> bool:
    """Print a figure with its limit and return whether it is below."""
    print(f"{what}: {figure:.{2 if unit == 's' else 0}f} {unit} (limit {limit:g})", flush=True)
    return figure <= limit


def find_chromium() -> str | None:
    """Path of a Chromium; None if there is none, which is printed."""
    found = os.environ.get("CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        print("no Chromium found; install one, or name it in CHROMIUM")
    return found


def main() -> int:
    asked = argparse.ArgumentParser(prog="bench.dashboard")
    asked.add_argument("--rounds", type=int, default=3, help="number of rounds; the quickest counts")
    asked.add_argument("--flights", type=int, default=1000, help="flights of the large campaign")
    options = asked.parse_args()
    if (chromium := find_chromium()) is None:
        return 1
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        flights = {"50 flights": 50, f"{options.flights} flights": options.flights}
        campaigns = seed_database(folder, flights=flights, campaigns_of_five=CAMPAIGNS)
        address = stack.enter_context(server(folder))
        browser = stack.enter_context(sync_playwright()).chromium.launch(executable_path=chromium, args=list(FLAGS))
        many = campaigns[f"{options.flights} flights"]
        kept = [
            *opening(browser, address, campaigns, options.rounds),
            *using(browser, address, many),
            *weighing(browser, address, many),
        ]
        browser.close()
    return int(not all(kept))


if __name__ == "__main__":
    sys.exit(main())
