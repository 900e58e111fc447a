"""Time from a change of custom gains to the redrawn prediction, in Chromium.

    ./dev exec python -m bench.custom_gains [--changes 100] [--flights 4]

Runs a real server with a campaign on the twin, calibrated after some flights, and types gains into the card of the next
flight, one change after another. The time runs from the input event until the chart's dashed curve has been painted.
The answers of the server are timed as the browser sees them; the gate is asked once the gains are at rest. The first
changes load and compile what the others use and do not count. Exits with 1 if the 95th percentile is above its limit.
"""

import argparse
import contextlib
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from playwright.sync_api import Page, sync_playwright

from app.campaigns.schemas import Definition, StopRule
from app.client import Client
from bench.dashboard import FLAGS, find_chromium, server

LIMIT_MS: Final = 100.0
WARM_UP: Final = 5
PAUSE_MS: Final = 400
SEED: Final = 20261124

OBSERVE: Final = """() => {
  window.drawn = [];
  const shape = () => document.querySelector(".traceprediction path.js-line")?.getAttribute("d");
  let before = shape(), changed = null;
  addEventListener("input", () => { changed = performance.now(); }, {capture: true});
  new MutationObserver(() => {
    const now = shape();
    if (changed === null || !now || now === before) return;
    before = now;
    const since = changed;
    changed = null;
    requestAnimationFrame(() => setTimeout(() => drawn.push(performance.now() - since), 0));
  }).observe(document.querySelector(".js-plotly-plot"), {subtree: true, childList: true, attributes: true});
}"""
ANSWERS: Final = """what => performance.getEntriesByType("resource")
  .filter(one => one.name.endsWith(`/${what}`)).map(one => one.duration)"""


def fly(address: str, flights: int) -> int:
    """A campaign on the twin after so many flights; its id."""
    definition = Definition(strategy="calibrated", stop=StopRule(kind="budget", max_flights=flights + 1))
    with Client(address) as client:
        campaign = client.create_campaign("Custom gains", vehicle="twin", definition=definition)
        for _ in range(flights):
            client.wait(client.fly(campaign.id, client.ask(campaign.id)).id)
        client.ask(campaign.id)
        return campaign.id


def change_gains(page: Page, changes: int) -> None:
    """Type one value of kp after another."""
    page.get_by_role("radiogroup", name="Gains to fly").get_by_text("Custom gains").click()
    kp = page.get_by_role("textbox", name="kp")
    values = np.random.default_rng(SEED).choice(np.arange(300, 2500), changes, replace=False)
    for value in values.tolist():
        drawn = int(page.evaluate("drawn.length"))
        kp.fill(str(value))
        while page.evaluate("drawn.length") == drawn:
            page.wait_for_timeout(PAUSE_MS)


def percentiles(what: str, found_ms: Sequence[float]) -> float:
    """Print the times and return their 95th percentile."""
    middle, high = (float(part) for part in np.quantile(found_ms, [0.5, 0.95]))
    print(f"{what}: {len(found_ms)} times, p50 {middle:.0f}, p95 {high:.0f}, max {max(found_ms):.0f} ms", flush=True)
    return high


def main() -> int:
    asked = argparse.ArgumentParser(prog="bench.custom_gains")
    asked.add_argument("--changes", type=int, default=100, help="number of changes of a gain")
    asked.add_argument("--flights", type=int, default=4, help="flights before")
    options = asked.parse_args()
    if (chromium := find_chromium()) is None:
        return 1
    with contextlib.ExitStack() as stack:
        address = stack.enter_context(server(Path(stack.enter_context(tempfile.TemporaryDirectory()))))
        campaign_id = fly(address, options.flights)
        browser = stack.enter_context(sync_playwright()).chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = browser.new_page(base_url=address, viewport={"width": 1440, "height": 900})
        page.goto(f"/campaigns/{campaign_id}")
        page.locator(".traceprediction path.js-line").wait_for(state="attached")
        time.sleep(1.0)
        page.evaluate(OBSERVE)
        change_gains(page, options.changes + WARM_UP)
        drawn_ms, predicted_ms, checked_ms = (
            page.evaluate(script, name)[WARM_UP:]
            for script, name in (("() => drawn", None), (ANSWERS, "prediction"), (ANSWERS, "gate"))
        )
        browser.close()
    high = percentiles("change to drawn prediction", drawn_ms)
    percentiles("answer with the prediction", predicted_ms)
    percentiles("answer of the gate", checked_ms)
    print(f"limit of the 95th percentile, change to drawn prediction: {LIMIT_MS:g} ms")
    return int(high > LIMIT_MS)


if __name__ == "__main__":
    sys.exit(main())
