from app.autopilots.measurements import Heartbeat
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.monitors.observing import told, watch_of
from tests.vehicles.mavlink.walking import PLAN, with_autopilot


def beating(*beats: Heartbeat) -> TrialObservation:
    """What is remembered of these heartbeats, as far apart as Paparazzi's."""
    watch = told(watch_of(3.0), Heartbeat(9, True, "4"), at_s=10.0)
    for number, beat in enumerate(beats, start=1):
        watch = told(watch, beat, at_s=10.0 + 0.5 * number)
    return watch


def test_a_disarming_is_unexpected_once_heartbeats_agree() -> None:
    for count in (1, 2):
        assert beating(*[Heartbeat(9, False, "4")] * count).modes.find_disarming() is None
    found = beating(*[Heartbeat(9, False, "4")] * 3).modes.find_disarming()
    assert found is not None
    assert (found.failure, found.why) == (Failure.UNEXPECTED, "The vehicle disarmed itself in the air.")


def test_a_strange_mode_is_unexpected_once_heartbeats_agree() -> None:
    named = with_autopilot(mode_names={"0": "Failsafe"})

    def found(count: int) -> Finding | None:
        strange = [Heartbeat(9, True, "0")] * count
        return beating(*strange).modes.find_unexpected(named, PLAN.autopilot.flying_modes, frozenset())

    assert (found(1), found(2)) == (None, None)
    strange = found(3)
    assert strange is not None
    assert (strange.failure, strange.why) == (Failure.UNEXPECTED, "The vehicle entered mode Failsafe.")


def test_a_mode_in_which_a_person_flies_is_a_take_over() -> None:
    named = with_autopilot(mode_names={"64": "Manual"})
    taken = beating(*[Heartbeat(9, True, "64")] * 3).modes.find_taken_over(named)
    assert taken is not None
    assert (taken.failure, taken.why) == (Failure.TAKEN_OVER, "The vehicle entered mode Manual.")
    assert beating(*[Heartbeat(9, False, "64")] * 3).modes.find_taken_over(named) is None
