"""An abort of a flight that is watched from several places; how soon it comes about: bench/abort.py."""

import threading

import pytest

from tests.runtime.processes import Serving, stream
from tests.waiting import Waits

pytestmark = pytest.mark.real_time("flights keep pace with the clock while they are watched")

WATCHERS = 5


class Watching:
    """Somebody who follows one flight on an event stream: how far its telemetry reached."""

    def __init__(self, url: str) -> None:
        self.reached_s = 0.0
        self.connected = threading.Event()
        self.in_the_air = threading.Event()
        self._thread = threading.Thread(target=self._follow, args=(url,))
        self._thread.start()
        assert self.connected.wait(Waits.at_most_s)

    def wait_for_the_end(self) -> None:
        self._thread.join(Waits.at_most_s)
        assert not self._thread.is_alive()

    def _follow(self, url: str) -> None:
        with stream(url) as events:
            for name, _, data in events:
                self.connected.set()
                if name == "telemetry":
                    self.reached_s = data["time_s"]
                    if data["time_s"] > 1.0:
                        self.in_the_air.set()
                elif name == "phase" and data["phase"] == "ended":
                    return


@pytest.mark.complete
@pytest.mark.parametrize("kind", ["twin", "jsbsim"])
def test_a_watched_flight_at_the_speed_of_life_is_computed_in_step_and_ends_by_its_abort(
    serving: Serving, kind: str
) -> None:
    campaign_id = serving.campaign(kind=kind)
    watchers = [Watching(serving.url) for _ in range(WATCHERS)]
    trial_id = serving.fly(campaign_id, speed=1.0)
    assert watchers[0].in_the_air.wait(Waits.at_most_s)
    assert serving.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
    assert serving.trial(trial_id, "aborted")["reason"] == "enough"
    for watcher in watchers:
        watcher.wait_for_the_end()
    for watcher in watchers:
        assert watcher.reached_s < 25.0, "the rest was never computed"
