from app.autopilots.measurements import Battery, Heartbeat, Position
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.monitors.observing import START_S, failure_of, told, watch_of
from tests.vehicles.mavlink.walking import PLAN


def repeated(watch: TrialObservation, *, until_s: float) -> TrialObservation:
    """The last position again and again, 50 times a second."""
    for tick in range(1, round((until_s - START_S) * 50) + 1):
        watch = told(watch, Position(START_S, 3.0, 0.0), at_s=START_S + tick * 0.02)
    return watch


def test_a_clock_that_stands_still_among_packets_is_frozen() -> None:
    assert repeated(watch_of(3.0), until_s=10.24).find_frozen(PLAN, 10.3) is None
    assert failure_of(repeated(watch_of(3.0), until_s=10.28).find_frozen(PLAN, 10.3)) == "F9a"


def test_what_a_stall_delayed_may_come_in_any_order() -> None:
    watch = told(watch_of(3.0), Heartbeat(9, True, "4"), Battery(12.4), at_s=10.8)
    assert watch.find_frozen(PLAN, 10.3) is None


def test_a_position_that_stays_away_among_other_packets_is_frozen_too() -> None:
    watch = watch_of(3.0)
    for beat in range(1, 4):
        watch = told(watch, Heartbeat(9, True, "4"), at_s=10.0 + beat * 0.5)
    assert watch.find_frozen(PLAN, 10.3) is not None


def test_silence_alone_is_not_frozen() -> None:
    watch = watch_of(3.0, 3.0)
    watch, _ = watch.update(Position(10.9, 3.0, 0.0), 10.9, PLAN)
    assert watch.find_frozen(PLAN, 10.3) is None


def test_a_packet_that_was_overtaken_is_left_out_and_a_clock_that_falls_back_is_a_reboot() -> None:
    watch = told(watch_of(3.0, 3.0), Position(10.0, 3.0, 0.0), at_s=10.03)
    assert watch.identity.find_reboot() is None
    watch = told(watch, Position(0.5, 3.0, 0.0), at_s=10.04)
    assert watch.identity.find_reboot() is None
    watch = told(watch, Position(0.7, 3.0, 0.0), at_s=10.24)
    watch = told(watch, Position(0.92, 3.0, 0.0), at_s=10.46)
    assert failure_of(watch.identity.find_reboot()) == "F10b"
