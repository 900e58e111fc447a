from app.autopilots.measurements import Heartbeat
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.monitors.observing import failure_of, told, watch_of
from tests.vehicles.mavlink.walking import PLAN


def beating(*beats: Heartbeat) -> TrialObservation:
    """What is remembered of these heartbeats, as far apart as Paparazzi's."""
    watch = told(watch_of(3.0), Heartbeat(9, True, "4"), at_s=10.0)
    for number, beat in enumerate(beats, start=1):
        watch = told(watch, beat, at_s=10.0 + 0.5 * number)
    return watch


def test_a_disarming_is_unexpected_once_heartbeats_agree() -> None:
    for count in (1, 2):
        assert beating(*[Heartbeat(9, False, "4")] * count).modes.find_disarming() is None
    assert failure_of(beating(*[Heartbeat(9, False, "4")] * 3).modes.find_disarming()) == "F10b"


def test_a_strange_mode_is_unexpected_once_heartbeats_agree() -> None:
    for count, failure in ((1, None), (2, None), (3, "F10b")):
        modes = beating(*[Heartbeat(9, True, "0")] * count).modes
        assert failure_of(modes.find_unexpected(PLAN, PLAN.autopilot.flying_modes, frozenset())) == failure


def test_a_mode_in_which_a_person_flies_is_a_take_over() -> None:
    assert failure_of(beating(*[Heartbeat(9, True, "64")] * 3).modes.find_taken_over(PLAN)) == "F10a"
    assert beating(*[Heartbeat(9, False, "64")] * 3).modes.find_taken_over(PLAN) is None
