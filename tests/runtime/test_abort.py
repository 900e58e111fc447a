"""An abort of a flight that is watched from several places, measured from the request to the trial's end.

The figures: `./dev exec pytest tests/runtime/test_abort.py -n0 --log-cli-level=INFO`.
"""

import logging
import threading
import time
from collections.abc import Iterator

import pytest

from tests.runtime.processes import Serving, stream

log = logging.getLogger(__name__)

WATCHERS = 5
GENEROUS_S = 3.0
"""Far above what it takes; far below a flight at 1× that nobody hears: 30 s."""


@pytest.fixture(scope="module")
def serving(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    with Serving(tmp_path_factory.mktemp("abort") / "data") as one:
        yield one


class Watching:
    """Somebody who follows one flight on an event stream: when each telemetry came, and how far it reached."""

    def __init__(self, url: str) -> None:
        self.seen: list[tuple[float, float]] = []
        self.over_s = 0.0
        self.connected = threading.Event()
        self.in_the_air = threading.Event()
        self._thread = threading.Thread(target=self._follow, args=(url,))
        self._thread.start()
        assert self.connected.wait(10.0)

    def wait_for_the_end(self) -> None:
        self._thread.join(20.0)
        assert not self._thread.is_alive()

    def _follow(self, url: str) -> None:
        with stream(url) as events:
            for name, _, data in events:
                self.connected.set()
                if name == "telemetry":
                    self.seen.append((time.monotonic(), data["time_s"]))
                    if data["time_s"] > 1.0:
                        self.in_the_air.set()
                elif name == "phase" and data["phase"] == "ended":
                    self.over_s = time.monotonic()
                    return


@pytest.mark.parametrize("kind", ["twin", "jsbsim"])
def test_a_watched_flight_at_the_speed_of_life_is_computed_in_step_and_ends_soon_after_its_abort(
    serving: Serving, kind: str
) -> None:
    campaign_id = serving.campaign(kind=kind)
    watchers = [Watching(serving.url) for _ in range(WATCHERS)]
    trial_id = serving.fly(campaign_id, speed=1.0)
    assert watchers[0].in_the_air.wait(20.0)
    asked_s = time.monotonic()
    assert serving.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
    answered_s = time.monotonic()
    ended = serving.trial(trial_id, "aborted")
    stored_s = time.monotonic()
    for watcher in watchers:
        watcher.wait_for_the_end()
    told_s = max(watcher.over_s for watcher in watchers)
    figures = {"answered": answered_s - asked_s, "stored": stored_s - asked_s, "told": told_s - asked_s}
    log.info("%s, %d streams: %s", kind, WATCHERS, {name: f"{1000 * value:.0f} ms" for name, value in figures.items()})
    assert max(figures.values()) < GENEROUS_S
    assert ended["reason"] == "enough"
    for watcher in watchers:
        (first_s, began), (last_s, reached) = watcher.seen[0], watcher.seen[-1]
        # Held back while it is computed: what was seen in a second of wall time is no more than a second of flight,
        # but for what was on its way (the twenty-fifth of a second between messages, and a busy machine's delays).
        assert reached - began < last_s - first_s + 0.5
        assert reached < 25.0, "the rest was never computed"
