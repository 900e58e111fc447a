from app.autopilots.measurements import Battery, Heartbeat
from tests.vehicles.mavlink.monitors.observing import failure_of, told, watch_of
from tests.vehicles.mavlink.walking import PLAN


def test_a_hover_keeps_every_limit() -> None:
    watch = told(watch_of(3.0, 3.0, 3.0), Heartbeat(9, True, "4"), Battery(12.4), at_s=10.05)
    assert watch.envelope.find(PLAN, watch.last, settling=True) is None
    assert watch.link.find(PLAN, watch.modes.heartbeat_s, 10.1) is None
    assert watch.find_frozen(PLAN, 10.3) is None
    assert watch.find_lost_position(PLAN, 10.1) is None
    assert watch.battery.find(10.1) is None
    assert watch.modes.find_unexpected(PLAN, PLAN.autopilot.flying_modes, frozenset()) is None


def test_what_is_found_before_a_take_off_is_the_most_severe_of_several() -> None:
    """A second vehicle under its id explains a lost link, and not the other way round."""
    silent = watch_of(0.1)
    assert failure_of(silent.find_on_ground(PLAN, 20.0)) == "F5"
    duplicate = silent.note_duplicate("Two clocks.")
    assert failure_of(duplicate.find_on_ground(PLAN, 20.0)) == "F12"
