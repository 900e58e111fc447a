"""Aborts at a slow pace: whoever waits for vehicle time to pass listens meanwhile."""

import pytest

from app.vehicles.base import ShouldStop
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import open_vehicle
from app.vehicles.simulated import LISTEN_EVERY_S, Pacer
from tests.vehicles.flying import CAN_FLY, PROFILES, Watcher, fly, never


def after(questions: int) -> ShouldStop:
    """An abort that is wanted from so many questions on."""
    asked = iter(range(questions))
    return lambda: None if next(asked, None) is not None else StopRequest("enough")


@pytest.mark.parametrize("kind", CAN_FLY)
@pytest.mark.parametrize("speed", [0.001, 1e-300])
def test_an_abort_does_not_wait_for_the_next_sample_of_a_slow_flight(kind: str, speed: float) -> None:
    """At 0.001 the next sample is 20 s away; at 1e-300 no clock can wait for it."""
    watcher = Watcher()
    with open_vehicle(kind, {}, safe_gains=PROFILES[kind].safe) as vehicle:
        record = fly(vehicle, speed=speed, on_sample=watcher.see, should_stop=after(5))
    assert (record.ending, record.reason) == ("aborted", "enough")
    assert len(watcher.samples) == 1


def test_whoever_waits_is_asked_again_when_the_time_has_come() -> None:
    assert Pacer(1.0).wait_until(2.5 * LISTEN_EVERY_S, after(1)) == StopRequest("enough")


@pytest.mark.parametrize("speed", [None, 1000.0])
def test_time_that_may_pass_passes_after_one_question(speed: float | None) -> None:
    assert Pacer(speed).wait_until(0.0, never) is None
    assert Pacer(speed).wait_until(0.0, after(0)) == StopRequest("enough")
