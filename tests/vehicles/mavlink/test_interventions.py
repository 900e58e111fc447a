"""What a trial does about a person's slide, a landing that the vehicle begins by itself, and a second source."""

from dataclasses import replace

import pytest

from app.autopilots.commands import Action
from app.autopilots.measurements import BlockEntered
from app.vehicles.flight_end import FAILURE_TEXTS, GainsLeft, StopRequest, request_text
from app.vehicles.mavlink.events import ActionDone, SecondaryAltitudeReceived, StopRequested
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.records import end_of, ending_of
from app.vehicles.mavlink.trial_state import State
from tests.vehicles.mavlink.test_trial_machine import STAGES, fly_too_high
from tests.vehicles.mavlink.walking import GROUND_M, PLAN, SAFE_GAINS, STEP_S, TrialDriver, with_autopilot

TAKE_OFF, STANDBY, LAND_BLOCK = 4, 5, 14
BLOCKS = {2: "Holding point", 3: "Start Engine", TAKE_OFF: "Takeoff", STANDBY: "Standby", LAND_BLOCK: "land"}
WITH_BLOCKS = with_autopilot(
    replace(PLAN, blocks=BLOCKS),
    arming_blocks=frozenset({"Holding point", "Start Engine"}),
    flying_blocks=frozenset({"Takeoff"}),
    landing_blocks=frozenset({"land here", "land", "flare", "landed"}),
)
COPTER = with_autopilot(
    flying_modes=frozenset({"guided"}),
    landing_modes=frozenset({"land"}),
    automatic_modes=frozenset({"guided", "land"}),
)


SLIDE = StopRequest("it flies towards people", motors_off=True)


def slide(walk: TrialDriver) -> TrialDriver:
    return walk.give(StopRequested(SLIDE, walk.now_s))


@pytest.mark.parametrize("state", STAGES)
def test_motors_off_is_sent_at_once_in_every_state_and_aborts_a_trial_that_had_not_failed(state: State) -> None:
    """Seen: after a lost link it made the flight an aborted one, which counted against its gains."""
    walk = STAGES[state]()
    failed = (walk.trial.failure, walk.outcome)
    slid_s = walk.now_s
    slide(walk)
    assert walk.when(Action.KILL) == [slid_s]
    assert walk.state is (State.RESTORE if state is State.RESTORE else State.DISARM)
    expected = failed if failed[0] is not None else (Failure.OPERATOR, "aborted")
    assert (walk.trial.failure, walk.outcome) == expected
    assert walk.trial.request == SLIDE or walk.trial.remarks[-1] == request_text(SLIDE)


def test_motors_off_is_repeated_every_second_at_any_height_until_the_vehicle_says_so() -> None:
    """Seen: stopped at 3.2 m, its safe gains were restored in the debris, and it was ready for its next flight."""
    walk = slide(STAGES[State.RECORD]()).pass_s(2.5)
    assert walk.altitude_m > 2.0
    assert len(walk.when(Action.KILL)) == 3
    walk.disarm().restore()
    assert (walk.state, ending_of(walk.trial)) == (State.QUARANTINE, "aborted")
    assert walk.trial.why.endswith("The vehicle was 2.9 m above the ground: inspect it before it flies again.")


def test_a_vehicle_whose_motors_were_stopped_on_the_ground_may_fly_again() -> None:
    walk = slide(STAGES[State.LAND]().touch_down().pass_s(0.2)).disarm().restore()
    assert (walk.state, walk.outcome) == (State.IDLE, "aborted")
    before_takeoff = slide(STAGES[State.ARM]()).disarm().restore()
    assert (before_takeoff.state, before_takeoff.outcome) == (State.IDLE, "aborted")


def test_a_vehicle_whose_motors_were_stopped_while_it_was_not_heard_is_to_be_inspected() -> None:
    walk = slide(STAGES[State.LINK_LOST]())
    assert walk.trial.doubt == "The vehicle was not known to be on the ground: inspect it before it flies again."


def test_motors_off_that_is_not_obeyed_quarantines_the_vehicle() -> None:
    walk = slide(STAGES[State.RECORD]()).pass_s(5.1)
    assert walk.state is State.QUARANTINE


def test_motors_off_follows_an_abort_and_a_held_slide_sends_it_once_a_second() -> None:
    walk = STAGES[State.RECORD]()
    walk.give(StopRequested(StopRequest("too high"), walk.now_s)).pass_s(0.2)
    for _ in range(55):
        slide(walk).pass_s(STEP_S)
    assert len(walk.when(Action.KILL)) == 2
    assert (walk.trial.request, walk.trial.remarks) == (StopRequest("too high"), (request_text(SLIDE),))


@pytest.mark.parametrize("motors_off", [False, True])
def test_a_limit_has_ended_the_flight_although_its_operator_then_says_the_same(motors_off: bool) -> None:
    """Observed defect: with these words of the operator the flight did not count against its gains."""
    walk = STAGES[State.RECORD]()
    fly_too_high(walk)
    assert walk.trial.failure is Failure.ENVELOPE
    walk.give(StopRequested(StopRequest(FAILURE_TEXTS[Failure.ENVELOPE], motors_off=motors_off), walk.now_s))
    end = end_of(walk.trial)
    assert (end.failure, end.request, ending_of(walk.trial)) == (Failure.ENVELOPE, None, "aborted")
    assert len(end.remarks) == (2 if motors_off else 1)


def test_a_request_has_ended_the_flight_although_a_limit_is_exceeded_then() -> None:
    walk, request = STAGES[State.RECORD](), StopRequest("too close")
    walk.give(StopRequested(request, walk.now_s))
    fly_too_high(walk)
    end = end_of(walk.trial)
    assert (end.failure, end.request, end.gains_left) == (Failure.OPERATOR, request, GainsLeft.UNKNOWN)


def test_a_flight_plan_that_lands_at_its_own_altitude_limit_counts_against_the_gains() -> None:
    walk = TrialDriver(plan=WITH_BLOCKS).lift_off()
    walk.does(1.4, climb_rate_m_s=1.0).hear(BlockEntered(LAND_BLOCK))
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.ENVELOPE)
    assert walk.gains_sent[0] == walk.plan.safe_gains[0]


def test_a_flight_plan_that_changes_block_by_itself_gets_land() -> None:
    walk = TrialDriver(plan=WITH_BLOCKS).lift_off()
    walk.hear(BlockEntered(STANDBY)).pass_s(STEP_S)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.UNEXPECTED)
    assert walk.actions[-1] is Action.LAND


def test_the_blocks_that_were_asked_for_are_no_surprise() -> None:
    walk = TrialDriver(plan=WITH_BLOCKS).arm()
    walk.hear(BlockEntered(3)).hear(BlockEntered(TAKE_OFF))
    walk.climb(1.0, for_s=2.9)
    walk.through(State.RECORD)
    walk.hear(BlockEntered(LAND_BLOCK)).pass_s(0.5).hear(BlockEntered(2)).touch_down().disarm().restore()
    assert (walk.state, walk.trial.failure) == (State.IDLE, None)


def test_an_autopilot_that_lands_by_its_own_failsafe_is_landed_with() -> None:
    walk = TrialDriver(plan=COPTER, mode="guided").lift_off().pass_s(1.0).does(1.6, mode="land")
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.OWN_LANDING)


def test_the_mode_of_the_landing_before_is_no_landing() -> None:
    walk = TrialDriver(plan=COPTER, mode="land").arm().does(0.8, climb_rate_m_s=1.0)
    walk.does(2.0, mode="guided")
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)


def watched(walk: TrialDriver, seconds: float, off_m: float = 0.0, *, is_new: bool = True) -> TrialDriver:
    """Let time pass under the eyes of a second source, 50 times a second."""
    for _ in range(round(seconds / STEP_S)):
        walk.pass_s(STEP_S)
        walk.give(SecondaryAltitudeReceived(walk.altitude_m + off_m, is_new, walk.now_s))
    return walk


def hovering() -> TrialDriver:
    return watched(TrialDriver().lift_off(), 0.5)


def test_two_sources_that_disagree_for_a_third_of_a_second_land_the_vehicle() -> None:
    walk = watched(hovering(), 0.28, off_m=0.35)
    assert walk.state is State.RECORD
    watched(walk, 0.1, off_m=0.35)
    assert (walk.state, walk.trial.failure, walk.outcome) == (State.ABORT_LAND, Failure.DISAGREEMENT, "invalid")
    assert walk.gains_sent == []


def test_a_short_disagreement_and_a_small_one_are_borne() -> None:
    walk = hovering()
    for _ in range(5):
        watched(watched(walk, 0.2, off_m=-0.5), 0.2, off_m=0.29)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)


def test_a_second_source_that_loses_the_vehicle_or_falls_silent_for_a_second_lands_it() -> None:
    walk = watched(hovering(), 0.24, is_new=False)
    assert walk.state is State.RECORD
    watched(walk, 0.06, is_new=False)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.FROZEN)
    walk = hovering().pass_s(0.9)
    assert walk.state is State.RECORD
    assert walk.pass_s(0.2).trial.failure is Failure.FROZEN


def test_every_sample_of_the_record_says_where_the_second_source_saw_the_vehicle() -> None:
    walk = watched(hovering(), 1.0, off_m=0.1)
    assert [kept.second_m for kept in walk.kept][-1] == pytest.approx(3.1 + GROUND_M - 0.1, abs=0.05)
    assert walk.kept[0].second_m is None
    assert walk.gains_sent != list(SAFE_GAINS)


def heartbeat_of_a_pilot(walk: TrialDriver) -> TrialDriver:
    """Until one heartbeat has told of a pilot's mode; the next one is not due yet."""
    walk.mode = "64"
    while walk.trial.watch.modes.mode != "64":
        walk.pass_s(STEP_S)
    return walk


@pytest.mark.parametrize("state", [State.LAND, State.ABORT_LAND, State.LINK_LOST])
def test_land_is_not_repeated_while_the_newest_heartbeat_tells_of_a_pilot(state: State) -> None:
    """Seen: every second Land took the vehicle out of his hand before a second heartbeat could tell of him."""
    walk = STAGES[state]()
    walk.climb_rate_m_s = 0.0
    walk.mute = False
    heartbeat_of_a_pilot(walk)
    told = len(walk.when(Action.LAND))
    while not walk.trial.is_over:
        walk.pass_s(STEP_S)
    assert len(walk.when(Action.LAND)) == told
    assert walk.state is State.QUARANTINE


def test_a_record_is_not_ended_while_the_newest_heartbeat_shows_a_pilot() -> None:
    walk = TrialDriver().lift_off()
    while walk.boot_s < (walk.trial.commanded_boot_s or 0.0) + PLAN.record_s - 0.2:
        walk.pass_s(STEP_S)
    walk.does(2.0, mode="64")
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, Failure.TAKEN_OVER)
    assert Action.LAND not in walk.actions
    assert end_of(walk.trial).gains_left is GainsLeft.FLIGHT


def test_one_heartbeat_of_a_pilot_voids_the_record_and_leads_nowhere_else() -> None:
    """Seen: a pilot stopped the climb at half a metre for a second, and the flight counted."""
    walk = heartbeat_of_a_pilot(TrialDriver().lift_off().pass_s(0.5)).does(1.0, mode="4")
    assert (walk.state, walk.trial.failure) == (State.RECORD, Failure.INTERRUPTED)
    walk.through(State.RECORD)
    walk.touch_down().disarm().restore()
    assert (walk.state, walk.outcome) == (State.IDLE, "invalid")


def test_the_mode_from_before_the_command_and_one_heartbeat_after_it_are_no_pilot() -> None:
    """Seen: a PX4, which arms in a mode of a pilot, was left alone after one heartbeat."""
    walk = TrialDriver(mode="64").arm().does(1.3, climb_rate_m_s=1.0, mode="64")
    assert walk.state is State.RECORD
    walk.pass_s(1.3)
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, Failure.TAKEN_OVER)


def test_a_vehicle_that_stays_on_the_ground_in_its_mode_from_before_did_not_lift_off() -> None:
    """Seen: one that was deaf to its command, and arms in a mode of a pilot, was taken for flown by hand."""
    walk = TrialDriver(mode="64", plan=with_autopilot(lift_off_s=4.0)).arm().pass_s(4.1)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NO_LIFT_OFF)


def test_a_px4_that_stays_on_the_ground_in_hold_did_not_lift_off() -> None:
    walk = TrialDriver(mode="hold", plan=PX4).arm().pass_s(1.6)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NO_LIFT_OFF)
    assert not walk.trial.doubt
    walk = TrialDriver(mode="hold", plan=with_autopilot(PX4, lift_off_s=8.0)).arm().pass_s(8.1)
    assert (walk.state, walk.trial.failure, walk.trial.doubt) == (State.DISARM, Failure.NO_LIFT_OFF, "")


def test_a_pilot_has_a_vehicle_too_that_was_landed_before_any_command() -> None:
    """Seen: it was lifted by a gust as it was armed; Land was sent against its pilot for 40 s."""
    walk = TrialDriver(mode="64").report_armed()
    walk.climb(1.0, for_s=0.4)
    while walk.state is not State.ABORT_LAND or not walk.when(Action.LAND):
        walk.pass_s(STEP_S)
    walk.does(1.0, mode="land")
    heartbeat_of_a_pilot(walk)
    told = len(walk.when(Action.LAND))
    walk.pass_s(1.1)
    assert (walk.state, len(walk.when(Action.LAND))) == (State.QUARANTINE, told)


def test_a_pilot_who_took_a_vehicle_on_the_ground_and_brings_back_its_first_mode_has_it() -> None:
    walk = TrialDriver(mode="64", plan=with_autopilot(lift_off_s=8.0)).arm().pass_s(2.0)
    walk.does(1.1, mode="4")
    heartbeat_of_a_pilot(walk).pass_s(1.1)
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, Failure.TAKEN_OVER)


def test_a_pilot_who_takes_a_vehicle_on_the_ground_has_it() -> None:
    walk = TrialDriver(plan=with_autopilot(lift_off_s=4.0)).arm().does(2.6, mode="64")
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, Failure.TAKEN_OVER)


def test_a_vehicle_whose_second_source_differs_before_the_command_gets_no_take_off() -> None:
    walk = TrialDriver()
    walk.give(ActionDone(Action.ARM, walk.now_s))
    walk.armed = True
    while walk.state is State.ARM:
        watched(walk, STEP_S, off_m=1.0 if walk.trial.armed_s is not None else 0.0)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.DISAGREEMENT)


PX4 = with_autopilot(
    flying_modes=frozenset({"take-off", "hold"}),
    hovering_modes=frozenset({"hold"}),
    automatic_modes=frozenset({"take-off", "hold"}),
)


@pytest.mark.parametrize(("reached_m", "failure"), [(1.8, Failure.INTERRUPTED), (2.0, None)])
def test_a_climb_that_ended_without_any_heartbeat_of_another_mode_makes_the_record_invalid(
    reached_m: float, failure: Failure | None
) -> None:
    """Seen: between two heartbeats an ArduCopter was set to Guided again at 0.19 m, where it hovered to the end."""
    walk = TrialDriver(plan=with_autopilot(climbs_from_ground=True)).arm()
    walk.does(reached_m, climb_rate_m_s=1.0)
    walk.climb_rate_m_s = 0.0
    while walk.state is not State.LAND:
        walk.pass_s(STEP_S)
    assert walk.trial.failure is failure
    walk.pass_s(0.5).touch_down().disarm().restore()
    assert walk.outcome == (None if failure is None else "invalid")


def test_a_vehicle_that_hovers_before_it_has_climbed_was_stopped_by_somebody() -> None:
    """Seen: a pilot let go of a PX4 at 0.3 m; there it hovered through its whole record, and the flight counted."""
    walk = TrialDriver(plan=PX4, mode="take-off").arm().does(1.0, climb_rate_m_s=1.0)
    walk.does(2.1, climb_rate_m_s=0.0, mode="hold")
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.UNEXPECTED)


def test_a_vehicle_that_hovers_near_its_set_point_has_climbed_however_it_swings() -> None:
    walk = TrialDriver(plan=PX4, mode="take-off").arm().does(2.2, climb_rate_m_s=1.0)
    walk.mode = "hold"
    walk.climb(-0.8, for_s=1.5)
    walk.pass_s(1.5)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
