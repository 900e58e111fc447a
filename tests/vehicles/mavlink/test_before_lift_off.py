"""A trial that ends before the lift-off: nothing was flown if the vehicle has certainly never left the ground."""

from collections.abc import Callable

import pytest

from app.autopilots.commands import Action
from app.autopilots.measurements import Position
from app.vehicles.base import FlightRecord
from app.vehicles.flight_end import Landing, StopRequest
from app.vehicles.mavlink.events import ActionRefused, SecondaryAltitudeReceived, StopRequested
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.records import end_of
from app.vehicles.mavlink.trial_state import State, Trial
from tests.vehicles.flying import TUNED, unwatched
from tests.vehicles.mavlink.rigs import SAFE as OWN_SAFE
from tests.vehicles.mavlink.rigs import LockstepRig
from tests.vehicles.mavlink.test_vehicle import MILDER, ORDER
from tests.vehicles.mavlink.walking import GROUND_M, STEP_S, TrialDriver

Walk = Callable[[TrialDriver], object]


def has_flown(trial: Trial) -> bool:
    return end_of(trial).landed is not Landing.STAYED


def aborted(walk: TrialDriver) -> TrialDriver:
    return walk.give(StopRequested(StopRequest("the operator pressed Abort"), walk.now_s))


def stopped_by_hand(walk: TrialDriver) -> TrialDriver:
    return walk.give(StopRequested(StopRequest("it tips over", motors_off=True), walk.now_s))


def over(walk: TrialDriver) -> TrialDriver:
    """To the end of a trial whose vehicle lands and stops its motors."""
    while walk.state not in (State.DISARM, State.QUARANTINE):
        walk.pass_s(STEP_S)
    return walk.disarm().pass_s(0.5).restore()


def taking_off() -> TrialDriver:
    """A tenth of a second after the takeoff command, on the ground."""
    return TrialDriver().arm().pass_s(0.1)


def refused(walk: TrialDriver) -> TrialDriver:
    why = "The vehicle refused to take off (result 4, failed)."
    return walk.give(ActionRefused(Action.TAKE_OFF, why, walk.now_s))


# ---- certain


def test_an_abort_before_the_takeoff_command_is_no_flight() -> None:
    walk = TrialDriver()
    walk.armed = True
    walk = over(aborted(walk.pass_s(0.5)))
    assert (walk.state, walk.trial.contact, walk.trial.takeoff) == (State.IDLE, "stayed", None)


def test_a_refused_takeoff_is_no_flight() -> None:
    walk = over(refused(taking_off()))
    assert (walk.state, walk.trial.failure) == (State.IDLE, Failure.TAKE_OFF_REFUSED)
    assert walk.actions[-1] is Action.MOTORS_OFF
    assert (walk.trial.contact, has_flown(walk.trial)) == (Landing.STAYED, False)


def test_a_packet_out_of_order_changes_nothing() -> None:
    walk = taking_off()
    walk.hear(Position(walk.boot_s - 0.06, GROUND_M, 0.0))
    assert not has_flown(over(refused(walk)).trial)


# ---- not certain


def hops(walk: TrialDriver) -> None:
    """Lower than what counts as lifted off."""
    walk.does(0.2, climb_rate_m_s=0.4)
    walk.climb(-0.4, for_s=0.2)
    assert not walk.trial.watch.climb.lifted


def climbs_at_an_altitude_that_stands_still(walk: TrialDriver) -> None:
    for _ in range(20):
        walk.now_s += STEP_S
        walk.boot_s += STEP_S
        walk.hear(Position(round(walk.boot_s, 6), GROUND_M, 0.5))


def says_that_it_flies(walk: TrialDriver) -> None:
    """All its positions show the ground."""
    walk.does(0.1, landed=False)
    walk.landed = None


def is_seen_in_the_air_by_the_second_source(walk: TrialDriver) -> None:
    walk.give(SecondaryAltitudeReceived(GROUND_M + 0.2, is_new=True, now_s=walk.now_s))
    walk.pass_s(STEP_S)
    walk.give(SecondaryAltitudeReceived(GROUND_M, is_new=True, now_s=walk.now_s))


def loses_its_altitude(walk: TrialDriver) -> None:
    walk.does(0.6, blind=True)
    walk.blind = False


def loses_its_link(walk: TrialDriver) -> None:
    walk.does(0.6, mute=True)
    walk.mute = False


def sends_a_sample_in_doubt(walk: TrialDriver) -> None:
    """It may be the only one of a jump."""
    walk.now_s += STEP_S
    walk.boot_s += STEP_S
    walk.hear(Position(round(walk.boot_s, 6), GROUND_M + 2.0, 0.0))


MAY_HAVE_FLOWN: list[Walk] = [
    hops,
    climbs_at_an_altitude_that_stands_still,
    says_that_it_flies,
    is_seen_in_the_air_by_the_second_source,
    loses_its_altitude,
    loses_its_link,
    sends_a_sample_in_doubt,
]


@pytest.mark.parametrize("happens", MAY_HAVE_FLOWN, ids=lambda each: each.__name__)
@pytest.mark.parametrize("then_refused", [True, False], ids=["before its refusal", "after it"])
def test_a_vehicle_that_may_have_left_the_ground_has_flown(happens: Walk, then_refused: bool) -> None:
    """Although it refused to take off."""
    walk = taking_off() if then_refused else refused(taking_off())
    happens(walk)
    assert has_flown(over(refused(walk) if then_refused else walk).trial)


@pytest.mark.parametrize("ends", [aborted, stopped_by_hand], ids=["abort", "motors off"])
def test_a_vehicle_that_took_the_takeoff_command_has_flown_wherever_it_is_seen(ends: Walk) -> None:
    """It may rise before any message shows it, and an altitude that stands still shows the ground."""
    walk = taking_off()
    ends(walk)
    assert has_flown(over(walk).trial)


def test_gains_that_do_not_lift_it_in_its_whole_time_have_been_flown() -> None:
    walk = over(TrialDriver().arm().pass_s(2.0))
    assert (walk.trial.failure, walk.trial.contact, has_flown(walk.trial)) == (Failure.NO_LIFT_OFF, "landed", True)


def test_a_vehicle_that_was_above_the_ground_before_the_takeoff_command_has_flown() -> None:
    """Somebody else flies it."""
    walk = TrialDriver()
    walk.armed = True
    walk.climb_rate_m_s = 1.0
    walk = aborted(walk.pass_s(0.5))
    walk.climb_rate_m_s = 0.0
    assert (walk.trial.takeoff, walk.trial.watch.climb.lifted) == (None, True)
    walk.touch_down()
    assert has_flown(walk.trial)


def test_a_vehicle_that_changed_its_state_by_itself_has_flown() -> None:
    """It tipped over, for instance, and disarmed: a person reviews it, and inspects the vehicle."""
    walk = taking_off()
    walk.armed = False
    while walk.state is not State.RESTORE:
        walk.pass_s(STEP_S)
    walk.restore()
    assert (walk.state, walk.trial.failure, has_flown(walk.trial)) == (State.QUARANTINE, Failure.UNEXPECTED, True)


# ---- the landing in the record


def test_a_record_states_that_the_vehicle_fell() -> None:
    walk = TrialDriver().lift_off()
    assert over(aborted(walk).touch_down()).trial.contact is Landing.LANDED
    walk = TrialDriver().lift_off()
    walk = walk.give(StopRequested(StopRequest("people below", motors_off=True), walk.now_s)).disarm().restore()
    assert walk.trial.contact is Landing.FELL


def test_a_record_states_that_no_landing_was_observed() -> None:
    walk = aborted(TrialDriver().lift_off()).pass_s(41.0)
    assert (walk.state, walk.trial.contact) == (State.QUARANTINE, Landing.UNKNOWN)


def test_motors_off_on_the_ground_after_a_landing_is_no_fall() -> None:
    walk = aborted(TrialDriver().lift_off()).touch_down()
    walk = walk.give(StopRequested(StopRequest("to be sure", motors_off=True), walk.now_s)).disarm().restore()
    assert walk.trial.contact is Landing.LANDED


# ---- the simulated drone


def stopped(autopilot: str, at_s: float, *, motors_off: bool) -> tuple[FlightRecord, float, str]:
    """Record of a flight that is stopped some time after the arming began, how far the drone truly rose, and the
    concern."""
    rose_m = 0.0
    with LockstepRig(autopilot) as rig:
        if autopilot != "paparazzi":
            rig.switch_on_failsafes()
        vehicle = rig.vehicle()
        vehicle.stage(MILDER.get(autopilot, TUNED))
        begun_s: list[float] = []

        def stop() -> StopRequest | None:
            nonlocal rose_m
            begun_s.append(rig.now_s())
            rose_m = max(rose_m, rig.drone.body.altitude_m)
            return StopRequest("tea", motors_off=motors_off) if begun_s[-1] - begun_s[0] >= at_s else None

        record = vehicle.fly(ORDER, on_sample=unwatched, should_stop=stop)
        concern = vehicle.concern
        assert concern or vehicle.read_gains() == OWN_SAFE[autopilot]
        vehicle.close()
    return record, rose_m, concern
