"""A trial as a pure machine: the good flight, then every failure in every state."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from app.autopilots.autopilot import ModeParameter
from app.autopilots.commands import Action, Setting
from app.autopilots.measurements import (
    DISARMING,
    Attitude,
    BlockEntered,
    CommandReply,
    FenceBreach,
    Heartbeat,
    Parameter,
    Position,
)
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.events import (
    ActionDone,
    ActionRefused,
    DuplicateVehicleDetected,
    PerformAction,
    RequestGain,
    RestoreGains,
    SecondaryAltitudeReceived,
    SendGain,
    StopRequested,
)
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.monitors.clock import WRAP_S
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.trial_machine import begin
from app.vehicles.mavlink.trial_state import State
from tests.vehicles.mavlink.walking import GROUND_M, PLAN, SAFE_GAINS, STEP_S, TrialDriver, once, with_autopilot

ABORT = "the operator pressed Abort"


@once
def arming() -> TrialDriver:
    return TrialDriver().pass_s(0.2)


@once
def taking_off() -> TrialDriver:
    return TrialDriver().arm().pass_s(0.5)


@once
def recording() -> TrialDriver:
    return TrialDriver().lift_off().pass_s(2.0)


@once
def landing() -> TrialDriver:
    return TrialDriver().land()


@once
def aborting() -> TrialDriver:
    """Landing for a reason that does not speak against the gains."""
    walk = recording().does(2.5, voltage_v=10.0)
    walk.climb_rate_m_s = -0.8
    return walk.pass_s(0.5)


@once
def lost() -> TrialDriver:
    walk = recording()
    walk.mute = True
    return walk.pass_s(1.5)


@once
def disarming() -> TrialDriver:
    return TrialDriver().land().touch_down()


@once
def restoring() -> TrialDriver:
    return disarming().disarm()


STAGES: dict[State, Callable[[], TrialDriver]] = {
    State.ARM: arming,
    State.TAKEOFF: taking_off,
    State.RECORD: recording,
    State.LAND: landing,
    State.ABORT_LAND: aborting,
    State.LINK_LOST: lost,
    State.DISARM: disarming,
    State.RESTORE: restoring,
}


COPTER = with_autopilot(climbs_from_ground=True)
REPORTS_LANDING = with_autopilot(
    replace(PLAN, blocks={4: "Takeoff", 14: "land", 15: "landed"}),
    flying_blocks=frozenset({"Takeoff"}),
    landing_blocks=frozenset({"land", "landed"}),
    landed_blocks=frozenset({"landed"}),
    land_again_s=6.0,
)


def armed(plan: Plan = COPTER, for_s: float = 0.2) -> TrialDriver:
    """For so long, before its takeoff command."""
    return TrialDriver(plan=plan).report_armed().pass_s(for_s)


def begun_anew(by_m: float = 0.5, plan: Plan = COPTER, after_s: float = 0.2) -> TrialDriver:
    """To the takeoff command of a vehicle whose altitude begins anew so long after it was armed."""
    walk = armed(plan, after_s)
    walk.altitude_m += by_m
    return walk.through(State.ARM)


@pytest.mark.parametrize("by_m", [0.5, -1.0, 5.0])
def test_the_ground_is_where_a_vehicle_stands_whose_altitude_began_anew_as_it_was_armed(by_m: float) -> None:
    walk = begun_anew(by_m)
    assert walk.trial.plan.ground_m == pytest.approx(GROUND_M + by_m)
    assert walk.trial.plan.datum_m == walk.trial.plan.ground_m
    assert walk.trial.plan.set_point_m == pytest.approx(PLAN.set_point_m + by_m)
    assert walk.trial.watch.envelope.crossings == 0
    walk.pass_s(1.0)
    assert walk.trial.failure is None, "it is not taken for one in the air"
    walk.does(0.5, climb_rate_m_s=1.0)
    assert walk.state is State.RECORD


@pytest.mark.parametrize("plan", [COPTER, PLAN], ids=["copter", "paparazzi"])
@pytest.mark.parametrize("by_m", [0.05, 0.2, -0.25])
def test_the_ground_is_measured_again_before_the_command_for_starting_motors_shift_it(by_m: float, plan: Plan) -> None:
    """Seen: one that stood 0.2 m higher by its own altitude was taken for one in the air that hovers."""
    walk = begun_anew(by_m, plan=plan)
    assert walk.trial.plan.ground_m == pytest.approx(GROUND_M + by_m)
    datum_m = GROUND_M + by_m if plan.autopilot.climbs_from_ground else 0.0
    assert walk.trial.plan.datum_m == pytest.approx(datum_m)
    walk.pass_s(plan.autopilot.lift_off_s + 0.1)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NO_LIFT_OFF)


def test_a_shift_that_its_own_speed_explains_is_no_new_ground() -> None:
    walk = armed()
    walk.climb(0.5, for_s=0.26)
    walk.through(State.ARM)
    assert walk.trial.plan == COPTER


def test_a_shift_that_the_second_source_does_not_see_is_measured_and_one_that_it_sees_is_a_rise() -> None:
    for seen_m, ground_m in ((0.0, GROUND_M + 0.25), (0.25, GROUND_M)):
        walk = armed()
        walk.altitude_m += 0.25
        while walk.state is State.ARM:
            walk.pass_s(STEP_S)
            walk.give(SecondaryAltitudeReceived(GROUND_M + seen_m, is_new=True, now_s=walk.now_s))
        assert walk.trial.plan.ground_m == pytest.approx(ground_m)


def test_a_vehicle_whose_altitude_rose_before_the_command_gets_no_take_off() -> None:
    walk = armed()
    rise(walk)
    walk.through(State.ARM)
    assert walk.trial.failure is Failure.LOST_POSITION
    walk.pass_s(0.5)
    assert Action.TAKE_OFF not in walk.actions
    assert walk.actions[-1] is Action.LAND, "it may be in the air"


def test_a_vehicle_whose_altitude_began_anew_has_its_motors_stopped_where_it_stands() -> None:
    walk = begun_anew(plan=with_autopilot(COPTER, lift_off_s=0.5))
    walk.pass_s(0.6)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NO_LIFT_OFF)
    walk.pass_s(1.1)
    assert Action.MOTORS_OFF in walk.actions


def test_an_abort_before_the_command_stops_motors_where_it_stands_too() -> None:
    walk = armed()
    walk.altitude_m += 0.5
    walk.pass_s(0.4)
    walk.give(StopRequested(StopRequest(ABORT), walk.now_s))
    assert walk.state is State.DISARM
    walk.pass_s(1.1)
    assert Action.MOTORS_OFF in walk.actions


def rise(walk: TrialDriver) -> None:
    """Really, and stand still in the air."""
    walk.climb(1.0, for_s=0.4)


def leap_late(walk: TrialDriver) -> None:
    walk.pass_s(0.7)
    walk.altitude_m -= 1.0


def leap_and_say_that_it_flies(walk: TrialDriver) -> None:
    walk.landed = False
    walk.altitude_m += 0.5


def leap_aside(walk: TrialDriver) -> None:
    walk.altitude_m += 0.5
    walk.north_m += 1.0


@pytest.mark.parametrize("happens", [rise, leap_late, leap_and_say_that_it_flies, leap_aside])
def test_what_else_its_altitude_does_before_the_command_is_no_new_ground(
    happens: Callable[[TrialDriver], None],
) -> None:
    walk = armed()
    happens(walk)
    walk.through(State.ARM)
    assert walk.trial.plan == COPTER
    walk.pass_s(12.0)
    assert Action.MOTORS_OFF not in walk.actions, "it may fly"


def test_a_paparazzis_altitude_does_not_begin_anew_for_it_can_be_dropped() -> None:
    walk = begun_anew(plan=PLAN)
    assert walk.trial.plan == PLAN
    assert Action.TAKE_OFF not in walk.actions
    walk.pass_s(12.0)
    assert Action.MOTORS_OFF not in walk.actions


def test_a_second_source_goes_along_with_an_altitude_that_began_anew() -> None:
    walk = begun_anew()
    for _ in range(50):
        walk.pass_s(STEP_S)
        walk.give(SecondaryAltitudeReceived(GROUND_M, is_new=True, now_s=walk.now_s))
    assert walk.trial.failure is None
    assert walk.kept[-1].second_m == pytest.approx(GROUND_M + 0.5)


def befalls(for_s: float, **changes: object) -> Callable[[TrialDriver], None]:
    def happens(walk: TrialDriver) -> None:
        walk.does(for_s, **changes)

    happens.__name__ = ",".join(f"{name}={value}" for name, value in changes.items())
    return happens


fall_silent = befalls(1.1, mute=True)
lose_heartbeats = befalls(2.3, heartless=True)
fly_too_high = befalls(3.0, climb_rate_m_s=3.0)
drain = befalls(2.5, voltage_v=10.0)
freeze = befalls(0.4, frozen=True)
reboot = befalls(0.7, boot_s=0.1)
go_astray = befalls(2.1, mode="0")
be_taken_over = befalls(2.1, mode="64")
stop_by_itself = befalls(1.6, armed=False)
lose_its_position = befalls(0.6, blind=True)
"""Beside a position that is no number, and so measures nothing, the rest is heard."""


def swing(walk: TrialDriver) -> None:
    for climb_rate_m_s in (1.2, -2.4, 2.4, -2.4, 2.4):
        walk.does(0.5, climb_rate_m_s=climb_rate_m_s)


def cross_its_fence(walk: TrialDriver) -> None:
    walk.hear(FenceBreach())


def press_abort(walk: TrialDriver) -> None:
    walk.give(StopRequested(StopRequest(ABORT), walk.now_s))


def jump_about(walk: TrialDriver) -> None:
    for _ in range(40):
        walk.pass_s(STEP_S)
        walk.boot_s += 0.01
        walk.hear(Position(round(walk.boot_s, 6), walk.altitude_m + 1.5, walk.climb_rate_m_s))


def be_one_of_two(walk: TrialDriver) -> None:
    walk.give(DuplicateVehicleDetected("Its sequence numbers are repeated with different contents.", walk.now_s))


# On record, test_set_point_schedule.py has what else befalls a vehicle, in every phase of its steps.
WALK: list[tuple[State, Callable[[TrialDriver], None], State, Failure | None]] = [
    (State.ARM, fall_silent, State.DISARM, Failure.LINK),
    (State.ARM, lose_heartbeats, State.DISARM, Failure.LINK),
    (State.ARM, drain, State.DISARM, Failure.BATTERY),
    (State.ARM, press_abort, State.DISARM, Failure.OPERATOR),
    (State.ARM, freeze, State.DISARM, Failure.FROZEN),
    (State.ARM, reboot, State.DISARM, Failure.UNEXPECTED),
    (State.TAKEOFF, fall_silent, State.LINK_LOST, Failure.LINK),
    (State.TAKEOFF, cross_its_fence, State.ABORT_LAND, Failure.ENVELOPE),
    (State.TAKEOFF, press_abort, State.ABORT_LAND, Failure.OPERATOR),
    (State.TAKEOFF, freeze, State.ABORT_LAND, Failure.FROZEN),
    (State.ARM, be_one_of_two, State.ABORT_LAND, Failure.DUPLICATE),
    (State.TAKEOFF, reboot, State.ABORT_LAND, Failure.UNEXPECTED),
    (State.TAKEOFF, be_one_of_two, State.ABORT_LAND, Failure.DUPLICATE),
    (State.RECORD, swing, State.ABORT_LAND, Failure.ENVELOPE),
    (State.LAND, fall_silent, State.LAND, None),
    (State.LAND, fly_too_high, State.ABORT_LAND, Failure.ENVELOPE),
    (State.LAND, press_abort, State.ABORT_LAND, Failure.OPERATOR),
    (State.LAND, drain, State.LAND, None),
    (State.LAND, reboot, State.ABORT_LAND, Failure.UNEXPECTED),
    (State.LAND, be_taken_over, State.QUARANTINE, Failure.TAKEN_OVER),
    (State.ABORT_LAND, fall_silent, State.ABORT_LAND, Failure.BATTERY),
    (State.ABORT_LAND, press_abort, State.ABORT_LAND, Failure.BATTERY),
    (State.ABORT_LAND, reboot, State.ABORT_LAND, Failure.BATTERY),
    (State.ABORT_LAND, be_one_of_two, State.ABORT_LAND, Failure.BATTERY),
    (State.ABORT_LAND, be_taken_over, State.QUARANTINE, Failure.BATTERY),
    (State.LINK_LOST, press_abort, State.LINK_LOST, Failure.LINK),
    (State.LINK_LOST, fall_silent, State.LINK_LOST, Failure.LINK),
    (State.DISARM, fall_silent, State.DISARM, None),
    (State.DISARM, press_abort, State.DISARM, None),
    (State.DISARM, fly_too_high, State.ABORT_LAND, None),
    (State.DISARM, stop_by_itself, State.RESTORE, None),
    (State.RESTORE, fall_silent, State.RESTORE, None),
    (State.RESTORE, press_abort, State.RESTORE, None),
]


@pytest.mark.parametrize(
    ("state", "befall", "then", "failure"), WALK, ids=[f"{state}-{befall.__name__}" for state, befall, *_ in WALK]
)
def test_every_failure_in_every_state_leads_where_it_must(
    state: State, befall: Callable[[TrialDriver], None], then: State, failure: Failure | None
) -> None:
    walk = STAGES[state]()
    assert walk.state is state
    befall(walk)
    assert (walk.state, walk.trial.failure) == (then, failure)


def test_a_flight_goes_through_its_states_and_ends_idle() -> None:
    walk = restoring().restore()
    assert walk.states == [
        State.ARM,
        State.TAKEOFF,
        State.RECORD,
        State.LAND,
        State.DISARM,
        State.RESTORE,
        State.IDLE,
    ]
    assert walk.actions == [Action.ARM, Action.TAKE_OFF, Action.LAND, Action.MOTORS_OFF]
    assert (walk.trial.failure, walk.outcome) == (None, None)
    assert walk.gains_sent == []
    assert RestoreGains() in [command for _, command in walk.told]


def test_the_record_begins_with_the_baseline_and_runs_33_s_from_the_command() -> None:
    walk = TrialDriver(plan=replace(PLAN, record_s=33.0)).land()
    command_s = walk.trial.commanded_boot_s
    assert command_s is not None
    times = [kept.position.time_boot_s - command_s for kept in walk.kept]
    assert times[0] == pytest.approx(-1.0, abs=0.05)
    assert times[-1] == pytest.approx(33.0, abs=0.03)
    assert 0.0 in times
    set_points = {kept.set_point_m for kept in walk.kept if kept.position.time_boot_s > command_s}
    assert set_points == {3.0}


def test_an_abort_sends_the_safe_gains_first_and_land_within_0_3_s() -> None:
    walk = recording()
    abort_s = walk.now_s
    press_abort(walk)
    assert [command for at_s, command in walk.told if at_s == abort_s][-1] == SendGain(SAFE_GAINS[0])
    walk.pass_s(0.5)
    assert walk.gains_sent == list(SAFE_GAINS)
    assert walk.when(Action.LAND)[0] - abort_s == pytest.approx(0.3, abs=0.03)


def test_echoed_gains_let_land_follow_at_once() -> None:
    walk = recording()
    abort_s = walk.now_s
    press_abort(walk)
    for setting in SAFE_GAINS:
        walk.pass_s(STEP_S).hear(Parameter(setting.parameter, setting.value))
    assert walk.gains_sent == list(SAFE_GAINS)
    assert walk.when(Action.LAND) == [pytest.approx(abort_s + 3 * STEP_S, abs=1e-6)]


def test_the_echo_of_another_parameter_changes_nothing() -> None:
    walk = recording()
    press_abort(walk)
    walk.hear(Parameter("gui_v_nom_thr", 0.655))
    assert walk.gains_sent == [SAFE_GAINS[0]]


def test_land_is_repeated_every_second_until_the_vehicle_descends() -> None:
    walk = recording()
    press_abort(walk)
    walk.pass_s(3.5)
    assert len(walk.when(Action.LAND)) == 4
    walk.does(2.0, climb_rate_m_s=-0.8)
    assert len(walk.when(Action.LAND)) == 4


def test_an_abort_while_landing_for_another_reason_still_sends_the_safe_gains() -> None:
    walk = aborting()
    assert walk.gains_sent == []
    press_abort(walk)
    assert walk.pass_s(0.5).gains_sent == list(SAFE_GAINS)


def test_a_held_down_abort_sends_everything_once() -> None:
    walk = recording()
    for _ in range(100):
        press_abort(walk)
        walk.pass_s(STEP_S)
    assert walk.gains_sent == list(SAFE_GAINS)


def test_a_lost_link_repeats_land_every_second_and_never_stops_the_motors() -> None:
    walk = lost().pass_s(10.0)
    assert len(walk.when(Action.LAND)) == 11
    assert Action.MOTORS_OFF not in walk.actions
    walk.pass_s(50.0)
    assert walk.state is State.QUARANTINE
    assert Action.MOTORS_OFF not in walk.actions


def test_an_altitude_that_shifts_as_the_motors_start_is_no_lift_off_if_the_vehicle_says_that_it_stands() -> None:
    """Seen with a shift of 0.2 m for 1.5 s: it “descended to the ground by itself”, which blamed its gains."""
    walk = TrialDriver(plan=with_autopilot(lift_off_s=6.0)).arm()
    walk.altitude_m += 0.2
    walk.pass_s(1.5)
    walk.altitude_m -= 0.2
    walk.pass_s(1.5)
    assert (walk.trial.failure, walk.gains_sent) == (None, [])
    walk.does(1.2, climb_rate_m_s=1.0)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)


@pytest.mark.parametrize(("rises_m", "landed", "failure"), [(0.2, True, "F4a"), (0.6, False, "F6"), (1.2, True, "F6")])
def test_a_vehicle_that_shows_the_ground_again_has_descended_if_it_flew_and_has_not_lifted_off_otherwise(
    rises_m: float, landed: bool, failure: str
) -> None:
    walk = TrialDriver(plan=with_autopilot(lift_off_s=4.0)).arm()
    walk.landed = landed
    for rate_m_s in (0.5, -0.5):
        walk.does(rises_m / 0.5, climb_rate_m_s=rate_m_s)
    walk.does(4.0, climb_rate_m_s=0.0, landed=True)
    assert walk.trial.failure == failure


def test_an_altitude_that_stands_still_is_no_missing_lift_off() -> None:
    """Seen: stuck 0.6 s after the command, which left 0.9 s until the lift-off was late, and blamed the gains."""
    walk = taking_off().pass_s(0.1)
    for _ in range(60):
        walk.steps += 1  # the same estimate each time
        walk.pass_s(STEP_S)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.FROZEN)


def test_no_take_off_is_commanded_while_the_newest_heartbeat_reports_the_motors_off() -> None:
    """Seen: another station stopped them 0.06 s after arming; the takeoff was commanded, and a quarantine followed."""
    walk = TrialDriver().report_armed().does(2.0, armed=False)
    assert (walk.trial.failure, Action.TAKE_OFF in walk.actions) == (Failure.NOT_ARMED, False)


def test_a_vehicle_that_climbs_before_its_command_does_not_stand_though_it_says_so() -> None:
    """Seen: HOME mode at arming; its motors were told to stop 0.16 m above the ground, because its plan's block has no
    thrust."""
    walk = TrialDriver()
    walk.give(ActionDone(Action.ARM, walk.now_s))
    walk.armed, walk.landed = True, True
    while walk.trial.armed_s is None:
        walk.pass_s(STEP_S)
    walk.climb_rate_m_s = 0.8
    for _ in range(75):
        walk.pass_s(STEP_S)
        assert Action.MOTORS_OFF not in walk.actions or walk.altitude_m - GROUND_M < 0.15
    assert walk.state is State.ABORT_LAND


def test_a_vehicle_that_lifts_off_too_late_is_landed_on_its_safe_gains() -> None:
    walk = taking_off().pass_s(0.9).does(0.2, climb_rate_m_s=0.3)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.NO_LIFT_OFF)
    assert Action.MOTORS_OFF not in walk.actions
    assert walk.gains_sent == [SAFE_GAINS[0]]


def test_a_vehicle_that_reports_flying_is_landed_though_its_altitude_stays_at_zero() -> None:
    """Its altitude may stand still while it climbs: then motors off would drop it."""
    walk = taking_off().does(1.5, landed=False)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.LOST_POSITION)
    walk.pass_s(35.0)
    assert Action.MOTORS_OFF not in walk.actions
    walk.does(3.5, landed=True)
    assert walk.actions[-1] is Action.MOTORS_OFF


def test_an_altitude_that_stays_behind_its_climb_rate_is_lost_and_stops_no_motors() -> None:
    walk = taking_off()
    ground_m, walk.landed = walk.altitude_m, True
    for _ in range(50):
        walk.does(STEP_S, altitude_m=ground_m - STEP_S, climb_rate_m_s=1.0)
    walk.altitude_m, walk.climb_rate_m_s = ground_m, 0.0
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.LOST_POSITION)
    walk.pass_s(60.0)
    assert walk.state is State.QUARANTINE
    assert not {Action.MOTORS_OFF, Action.KILL} & set(walk.actions)
    assert "Its motors were not commanded to stop: its altitude did not follow its climb rate." in walk.trial.why


def test_motors_are_not_stopped_by_position_alone_if_it_was_never_seen_in_the_air_nor_reports_a_landing() -> None:
    """A vehicle that sends no landed state counted as one that reports it."""
    walk = TrialDriver(without_landed_state=True).arm()
    walk.pass_s(60.0)
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, Failure.NO_LIFT_OFF)
    assert not {Action.MOTORS_OFF, Action.KILL} & set(walk.actions)


def test_a_refused_arming_disarms_and_restores_the_gains() -> None:
    walk = arming()
    walk.give(ActionRefused(Action.ARM, "The vehicle refused to arm (result 4, failed).", walk.now_s))
    assert (walk.state, walk.actions) == (State.DISARM, [Action.ARM, Action.MOTORS_OFF])
    walk.disarm().restore()
    assert (walk.state, walk.outcome) == (State.IDLE, "refused")


def test_a_vehicle_that_does_not_report_armed_is_not_flown() -> None:
    walk = TrialDriver()
    walk.pass_s(15.1)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NOT_ARMED)
    assert Action.TAKE_OFF not in walk.actions


def test_a_vehicle_that_does_not_land_within_40_s_is_quarantined() -> None:
    walk = recording()
    press_abort(walk)
    walk.pass_s(40.1)
    assert (walk.state, walk.outcome) == (State.QUARANTINE, "quarantine")
    assert "not landed within 40 s" in walk.trial.why


def test_a_vehicle_that_stays_armed_is_disarmed_again_and_then_quarantined() -> None:
    walk = disarming().pass_s(4.9)
    assert walk.state is State.DISARM
    assert len(walk.when(Action.MOTORS_OFF)) == 5
    assert walk.pass_s(0.2).state is State.QUARANTINE


def test_safe_gains_that_cannot_be_verified_quarantine_the_vehicle() -> None:
    walk = restoring().restore("Its safe gains are not set: kp is 1600 instead of 283.")
    assert walk.state is State.QUARANTINE
    assert "Its safe gains could not be verified. Its safe gains are not set: kp" in walk.trial.why


def test_a_quarantine_also_lists_later_concerns() -> None:
    walk = aborting()
    reboot(walk)
    walk.touch_down()
    assert (walk.state, len(walk.trial.remarks)) == (State.QUARANTINE, 2)
    walk = recording()
    reboot(walk)
    walk.touch_down()
    assert (walk.state, len(walk.trial.remarks)) == (State.QUARANTINE, 1)


@pytest.mark.parametrize("befall", [reboot, go_astray, stop_by_itself, be_one_of_two])
def test_a_vehicle_in_an_unknown_state_gets_land_repeatedly_and_never_motors_off(
    befall: Callable[[TrialDriver], None],
) -> None:
    walk = recording()
    befall(walk)
    walk.pass_s(5.0)
    assert len(walk.when(Action.LAND)) >= 5
    walk.pass_s(40.0)
    assert walk.state is State.QUARANTINE
    assert not {Action.MOTORS_OFF, Action.KILL} & set(walk.actions)


def test_one_heartbeat_of_a_failsafe_decides_nothing() -> None:
    message = Heartbeat(9, True, "0")
    walk = recording().hear(message).pass_s(2.0)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
    walk.hear(message)
    walk.through(State.RECORD)
    walk.does(0.5, climb_rate_m_s=-0.8).touch_down().disarm().restore()
    assert (walk.state, walk.outcome) == (State.IDLE, None)


@pytest.mark.complete
def test_a_record_ends_by_the_grounds_clock_too() -> None:
    walk = TrialDriver(plan=replace(PLAN, record_s=33.0)).lift_off().does(33.5, tempo=0.905)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.SLOW_CLOCK)


@pytest.mark.complete
def test_a_longer_record_allows_the_clock_the_same_share_of_delay() -> None:
    walk = TrialDriver(plan=replace(PLAN, record_s=60.4)).lift_off()
    assert walk.trial.takeoff is not None
    walk.does(60.4 + 3.4 - (walk.now_s - walk.trial.takeoff.at_s), tempo=0.93)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
    walk.pass_s(1.5)
    assert (walk.state, walk.trial.failure) == (State.LAND, None)


def test_an_altitude_that_leaps_to_the_ground_stops_no_motors() -> None:
    """Seen: at 2 m, by the positions of another vehicle that stood on the ground."""
    walk = recording()
    press_abort(walk)
    walk.pass_s(0.5)
    walk.does(60.0, altitude_m=GROUND_M, climb_rate_m_s=0.0, landed=True)
    assert walk.state is State.QUARANTINE
    assert not {Action.MOTORS_OFF, Action.KILL} & set(walk.actions)
    assert walk.trial.why == (
        f"{ABORT} Its altitude jumped by 2.9 m. Its motors were not commanded to stop: its altitude jumped during the "
        "flight."
    )


def test_a_gain_that_changes_in_flight_makes_the_flight_invalid() -> None:
    plan = replace(PLAN, trial_gains=(Setting("gui_v_kp", 1600.0),))
    walk = TrialDriver(plan=plan).lift_off()
    walk.hear(Parameter("gui_v_kp", 300.0))
    assert walk.told[-1][1] == RequestGain("gui_v_kp"), "one message may be an old one"
    walk.hear(Parameter("gui_v_kp", 1600.0)).hear(Parameter("gui_v_kp", 300.0))
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
    walk.hear(Parameter("gui_v_kp", 300.0))
    assert (walk.state, walk.trial.failure) == (State.RECORD, Failure.INTERRUPTED)
    assert walk.pass_s(9.0).state is State.LAND


@pytest.mark.parametrize("times", [1, 2])
def test_a_gain_that_changes_before_the_takeoff_command_is_not_flown(times: int) -> None:
    walk = TrialDriver(plan=replace(PLAN, trial_gains=(Setting("gui_v_kp", 1600.0),)), deaf=True)
    for _ in range(times):
        walk.hear(Parameter("gui_v_kp", 300.0))
    walk.arm()
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.INTERRUPTED)
    assert Action.TAKE_OFF not in walk.actions


def test_a_descent_that_was_none_does_not_count_against_the_gains() -> None:
    """Seen: for 1.5 s its altitude stayed on the ground as it lifted off; then it was at 2.9 m."""
    walk = TrialDriver().arm().pass_s(0.3).does(0.2, climb_rate_m_s=1.0)
    walk.does(1.2, altitude_m=GROUND_M + 0.05, climb_rate_m_s=0.0, landed=True)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.ENVELOPE)
    walk.does(0.2, altitude_m=2.9)
    assert (walk.state, walk.outcome) == (State.ABORT_LAND, "invalid")


def test_a_vehicle_whose_altitude_jumped_by_metres_is_not_said_to_be_safe_though_it_disarms_itself() -> None:
    """Seen: another vehicle with its ids stood on the ground and answered in its stead."""
    walk = recording().does(0.5, altitude_m=GROUND_M)
    walk.does(3.0, armed=False).restore()
    assert walk.state is State.QUARANTINE


def test_motors_are_not_stopped_while_the_take_off_command_may_still_be_under_way() -> None:
    """Seen: what was sent arrived 1.2 s late; it took off, and 1.5 s later obeyed the command to stop its motors."""
    walk = TrialDriver(deaf=True).arm().pass_s(1.6)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.NO_LIFT_OFF)
    walk.pass_s(20.0)
    assert Action.MOTORS_OFF not in walk.actions
    assert len(walk.when(Action.LAND)) > 5
    walk.does(1.0, deaf=False)
    assert Action.MOTORS_OFF not in walk.actions
    walk.pass_s(2.5)
    assert walk.actions[-1] is Action.MOTORS_OFF


def test_land_is_repeated_on_the_ground_until_the_flight_plan_reports_the_landing() -> None:
    """Seen: one Land that was lost left it in "Takeoff", armed, with its integrator winding up, for 40 s."""
    walk = TrialDriver(plan=REPORTS_LANDING).arm()
    walk.hear(BlockEntered(4)).pass_s(6.0)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.NO_LIFT_OFF)
    assert len(walk.when(Action.LAND)) >= 4
    before = len(walk.when(Action.LAND))
    walk.hear(BlockEntered(14)).pass_s(3.5)
    assert len(walk.when(Action.LAND)) == before
    walk.hear(BlockEntered(15)).pass_s(0.1)
    assert walk.actions[-1] is Action.MOTORS_OFF


def test_its_time_to_lift_off_begins_with_its_reply() -> None:
    walk = TrialDriver(deaf=True).arm().pass_s(1.0).does(1.4, deaf=False)
    assert (walk.state, walk.trial.failure) == (State.TAKEOFF, None)
    walk.pass_s(0.2)
    assert (walk.state, walk.trial.failure) == (State.DISARM, Failure.NO_LIFT_OFF)
    assert walk.actions[-1] is Action.MOTORS_OFF


def test_the_reply_to_arming_does_not_confirm_that_its_motors_stopped() -> None:
    """ArduPilot and PX4 reply to both with the same message; seen: the late reply and one old heartbeat."""
    walk = arming()
    press_abort(walk)
    walk.hear(CommandReply(DISARMING, accepted=True)).hear(Heartbeat(9, False, "4"))
    assert walk.states == [State.ARM, State.DISARM]
    walk.pass_s(1.2)
    assert walk.states == [State.ARM, State.DISARM, State.RESTORE]


@pytest.mark.parametrize("says_so", [True, False])
def test_the_motors_are_stopped_only_when_what_the_vehicle_says_of_itself_agrees(says_so: bool) -> None:
    walk = landing()
    walk.landed = says_so
    walk.touch_down()
    assert (walk.state is State.DISARM, Action.MOTORS_OFF in walk.actions) == (says_so, says_so)
    assert walk.trial.failure is Failure.LOST_POSITION, "it said that it stood, or flew, while its altitude did not"
    assert walk.outcome == ("invalid" if says_so else "quarantine")


def test_a_vehicle_that_falls_is_recorded_so_and_left_for_a_person_to_look_at() -> None:
    walk = recording()
    press_abort(walk)
    walk.climb(-3.5, for_s=0.8)
    walk.touch_down().disarm().restore()
    assert (walk.state, walk.trial.failure, walk.trial.contact) == (State.QUARANTINE, Failure.OPERATOR, "fell")


def test_after_a_person_has_taken_over_nothing_more_is_sent() -> None:
    walk = recording()
    told = len(walk.told)
    be_taken_over(walk)
    walk.pass_s(5.0)
    assert not [command for _, command in walk.told[told:] if isinstance(command, PerformAction | SendGain)]


def test_a_vehicle_that_disarms_itself_after_landing_has_landed() -> None:
    walk = landing()
    walk.climb_rate_m_s = -0.8
    while walk.altitude_m > GROUND_M + 0.02:
        walk.pass_s(STEP_S)
    walk.does(2.1, climb_rate_m_s=0.0, armed=False)
    assert (walk.state, walk.trial.failure) == (State.RESTORE, None)


def test_a_vehicle_that_is_in_the_air_again_after_its_record_is_landed_and_looked_at_and_its_gains_are_not_blamed() -> (
    None
):
    """Seen: a barometer's shift of 0.2 m after the landing aborted a flight whose record was whole."""
    walk = disarming()
    walk.altitude_m += 0.2
    walk.pass_s(0.1)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, None)
    walk.altitude_m -= 0.2
    walk.pass_s(4.0).disarm().restore()
    assert (walk.state, walk.trial.failure) == (State.QUARANTINE, None)
    assert walk.trial.why == "It was in the air when its motors were to be stopped."


def test_glitches_do_not_end_a_flight_but_too_many_void_it() -> None:
    walk = recording()
    for _ in range(4):
        walk.boot_s += STEP_S
        walk.hear(Position(round(walk.boot_s, 6), walk.altitude_m + 0.5, 0.0))
        walk.pass_s(0.5)
    assert walk.states[-1] is State.RECORD
    walk.through(State.RECORD)
    assert (walk.state, walk.trial.failure, walk.outcome) == (State.LAND, Failure.GLITCHES, "invalid")
    assert walk.trial.watch.positions.glitches == 4


def test_a_vehicle_that_comes_down_by_itself_is_not_left_to_wind_up_its_integrator() -> None:
    walk = recording()
    walk.climb_rate_m_s = -2.0
    while walk.altitude_m > GROUND_M + 0.05:
        walk.pass_s(STEP_S)
    walk.climb_rate_m_s = 0.0
    assert walk.pass_s(0.9).state is State.RECORD
    assert walk.pass_s(0.2).state is State.ABORT_LAND
    assert walk.trial.failure is Failure.ENVELOPE


def test_an_altitude_that_drifts_up_does_not_hide_that_the_vehicle_has_landed_and_disarmed() -> None:
    walk = landing()
    walk.altitude_m, walk.climb_rate_m_s, walk.landed = GROUND_M + 0.3, 0.0, True
    walk.boot_s += 1.0
    walk.pass_s(0.5).armed = False
    walk.pass_s(4.0)
    assert (walk.state, walk.trial.failure) == (State.RESTORE, None)


def test_motors_that_another_station_stops_in_the_air_are_found_off_though_a_limit_was_exceeded_first() -> None:
    walk = recording().does(0.2, armed=False, climb_rate_m_s=-4.5)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.ENVELOPE)
    walk.does(0.3, climb_rate_m_s=-6.0)
    walk.does(4.0, altitude_m=GROUND_M, climb_rate_m_s=0.0, climbed_m=0.0).restore()
    assert (walk.state, walk.trial.failure, walk.trial.contact) == (State.QUARANTINE, Failure.UNEXPECTED, "fell")


def test_a_record_at_whose_end_the_vehicle_or_its_altitude_has_sunk_is_invalid() -> None:
    walk = TrialDriver(plan=replace(PLAN, record_s=10.0)).lift_off().pass_s(1.0)
    walk.climb(-0.5, for_s=3.9)
    walk.through(State.RECORD)
    assert (walk.state, walk.trial.failure) == (State.LAND, Failure.LOST_POSITION)


@pytest.mark.parametrize(("by_s", "failure"), [(0.1, None), (0.25, None), (1.0, Failure.FROZEN), (3.0, Failure.FROZEN)])
def test_a_clock_that_steps_ahead_by_more_than_a_latency_ends_the_flight(by_s: float, failure: Failure | None) -> None:
    walk = recording()
    walk.boot_s += by_s
    walk.pass_s(0.5)
    assert walk.trial.failure is failure


def test_the_clock_may_begin_again_after_49_7_days() -> None:
    walk = TrialDriver(boot_s=WRAP_S - 5.0).lift_off().pass_s(2.0)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
    assert walk.kept[-1].position.time_boot_s > WRAP_S


def test_a_mode_that_heartbeats_do_not_show_is_asked_for_and_two_replies_end_the_flight() -> None:
    mode = ModeParameter("aut_mod", 1600.0, {2.0: "home"})
    walk = TrialDriver(plan=with_autopilot(mode_parameter=mode)).lift_off().pass_s(1.0)
    asked = [at_s for at_s, command in walk.told if command == RequestGain("aut_mod")]
    assert len(asked) >= 3, "every second"
    walk.hear(Parameter("aut_mod", 2.0))
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
    walk.hear(Parameter("aut_mod", 2.0)).pass_s(STEP_S)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.UNEXPECTED)


def test_an_attitude_that_swings_by_8_degrees_rms_exceeds_no_limit() -> None:
    """At 2 Hz, as Paparazzi reports it."""
    walk = recording()
    for half_s in range(10):
        walk.hear(Attitude(abs(0.2 * math.sin(2.3 * half_s + 0.4)))).pass_s(0.5)
    assert walk.trial.failure is None


def test_one_attitude_decides_nothing() -> None:
    walk = recording().hear(Attitude(0.0)).pass_s(0.5).hear(Attitude(3.0)).pass_s(0.5)
    assert walk.trial.failure is None


def test_a_gain_in_doubt_is_asked_for_again_and_voids_a_flight_that_ends_without_a_reply() -> None:
    walk = TrialDriver(plan=replace(PLAN, trial_gains=(Setting("gui_v_kp", 1600.0),))).lift_off()
    walk.deaf = True
    walk.hear(Parameter("gui_v_kp", 300.0))
    walk.through(State.RECORD)
    assert [command for _, command in walk.told].count(RequestGain("gui_v_kp")) > 3
    assert (walk.state, walk.trial.failure) == (State.LAND, Failure.INTERRUPTED)


def test_a_lost_report_of_the_landing_block_is_caught_up_by_another_land() -> None:
    """Paparazzi reports "landed" once; without it the vehicle would be quarantined after every such loss."""
    walk = TrialDriver(plan=REPORTS_LANDING).lift_off().hear(BlockEntered(4))
    walk.through(State.RECORD)
    walk.hear(BlockEntered(14)).climb_rate_m_s = -0.8
    walk.pass_s(3.6).climb_rate_m_s = 0.0
    before = len(walk.when(Action.LAND))
    walk.pass_s(15.0)
    assert len(walk.when(Action.LAND)) == before
    walk.pass_s(4.0)
    assert len(walk.when(Action.LAND)) == before + 1
    walk.hear(BlockEntered(15)).pass_s(0.1)
    assert walk.state is State.DISARM


def test_a_landed_state_that_was_heard_before_the_trial_only_is_missed() -> None:
    walk = TrialDriver(without_landed_state=True)
    here = Position(walk.boot_s, GROUND_M, 0.0)
    watch = TrialObservation.begin(walk.now_s, last=here, battery_v=12.4, stood_s=1.0, reports_landing=True)
    walk.trial, _ = begin(walk.plan, watch, walk.now_s)
    walk.land().touch_down()
    assert walk.state is State.QUARANTINE
    assert not {Action.MOTORS_OFF, Action.KILL} & set(walk.actions)
