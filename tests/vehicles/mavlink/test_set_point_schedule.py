"""Altitude steps in the trial machine: the schedule, its limits, and every failure in every phase of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from app.autopilots.commands import Action
from app.autopilots.measurements import BlockEntered, Heartbeat, TargetAltitude
from app.core.models.set_points import SetPoints
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink.events import (
    ActionDone,
    ActionRefused,
    Command,
    PerformAction,
    SetPointsPaused,
    StopRequested,
    WithdrawSetPoint,
)
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.trial_state import State
from tests.vehicles.mavlink import test_trial_machine as befall
from tests.vehicles.mavlink.walking import PLAN, SAFE_GAINS, STEP_S, TrialDriver, once, with_autopilot

LATENCY_S = 0.06
SET_POINTS = SetPoints((0.0, 6.0, 9.0, 12.0), (3.0, 2.0, 3.0, 2.0))
STEPS = with_autopilot(
    replace(PLAN, set_points=SET_POINTS, record_s=20.0, blocks={4: "Takeoff", 13: "land here"}),
    flying_blocks=frozenset({"Takeoff"}),
    landing_blocks=frozenset({"land here"}),
)


@dataclass
class Stepping(TrialDriver):
    """A vehicle that confirms a set point after `LATENCY_S`, unless it is `unheard`, and flies there at 1 m/s."""

    unheard: bool = False
    moves: bool = True
    commanded_s: float = 0.0
    wanted_m: float | None = None
    confirmed: bool = True
    action: Action = Action.FLY_TO

    def pass_s(self, seconds: float) -> "Stepping":
        for _ in range(round(seconds / STEP_S)):
            if not self.unheard and not self.confirmed and self.now_s - self.commanded_s >= LATENCY_S - STEP_S / 2:
                self.confirmed = True
                self.give(ActionDone(self.action, self.now_s, (self.commanded_s,), self.now_s))
            if self.confirmed and self.moves and self.wanted_m is not None:
                self.climb_rate_m_s = max(-1.0, min((self.wanted_m - self.altitude_m) / STEP_S, 1.0))
            super().pass_s(STEP_S)
        return self

    def _note(self, commands: tuple[Command, ...]) -> None:
        super()._note(commands)
        for command in commands:
            if isinstance(command, PerformAction) and command.altitude_m is not None:
                self.action = command.action
                self.commanded_s, self.wanted_m, self.confirmed = self.now_s, command.altitude_m, False
            elif isinstance(command, PerformAction):
                self.wanted_m = None

    @property
    def flown_s(self) -> float:
        """Since the takeoff command, by the vehicle's clock."""
        assert self.trial.commanded_boot_s is not None
        return self.boot_s - self.trial.commanded_boot_s

    @property
    def altitudes(self) -> list[float | None]:
        return [
            command.altitude_m
            for _, command in self.told
            if isinstance(command, PerformAction) and command.action is Action.FLY_TO
        ]

    def until_s(self, flown_s: float) -> "Stepping":
        while self.flown_s < flown_s - STEP_S / 2:
            self.pass_s(STEP_S)
        return self


@once
def hovering(until_s: float = 5.0, *, unheard: bool = False) -> Stepping:
    walk = Stepping(plan=STEPS, unheard=unheard)
    walk.lift_off()
    return walk.until_s(until_s)


def climbing() -> Stepping:
    walk = Stepping(plan=STEPS)
    walk.arm()
    walk.does(1.0, climb_rate_m_s=1.0)
    walk.climb_rate_m_s = 0.0
    return walk


def unconfirmed() -> Stepping:
    """While a set point is under way and may have to be repeated."""
    walk = hovering(6.1, unheard=True)
    assert walk.trial.set_points.is_changing
    return walk


PHASES: dict[str, Callable[[], Stepping]] = {
    "climb": climbing,
    "settling": hovering,
    "unconfirmed": unconfirmed,
    "during a step": lambda: hovering(6.4),
    "between steps": lambda: hovering(8.0),
    "after the last": lambda: hovering(14.0),
}
RARER = {"climb", "between steps", "after the last"}
"""Phases that the everyday ring leaves out."""


def test_each_set_point_is_commanded_by_the_vehicles_clock_and_becomes_that_of_all_limits() -> None:
    walk = hovering(14.5)
    assert walk.altitudes == [2.0, 3.0, 2.0]
    assert walk.trial.plan.set_point_m == 2.0
    due_s = [walk.when(Action.FLY_TO)[place] - walk.when(Action.TAKE_OFF)[0] for place in range(3)]
    assert due_s == pytest.approx([6.0, 9.0, 12.0], abs=0.03)
    took = walk.trial.set_points.changes
    assert [change.altitude_m for change in took] == [2.0, 3.0, 2.0]
    assert [change.times_s[0] for change in took] == pytest.approx([at_s + LATENCY_S for at_s in due_s], abs=1e-6)
    kept = {sample.set_point_m for sample in walk.kept if sample.position.time_boot_s > walk.boot_s - 12.0}
    assert kept == {2.0, 3.0}
    walk.until_s(20.1)
    assert (walk.state, walk.trial.failure, walk.altitudes) == (State.LAND, None, [2.0, 3.0, 2.0])


def test_a_slow_clock_of_the_vehicle_delays_its_steps() -> None:
    walk = Stepping(plan=STEPS, tempo=0.95)
    walk.lift_off()
    walk.until_s(6.5)
    assert walk.when(Action.FLY_TO)[0] - walk.when(Action.TAKE_OFF)[0] == pytest.approx(6.0 / 0.95, abs=0.03)


def test_steps_that_overshoot_by_a_third_are_no_oscillation_and_further_crossings_are() -> None:
    walk = hovering()
    for due_s, to_m in ((6.0, 2.0), (9.0, 3.0), (12.0, 2.0)):
        walk.until_s(due_s + 0.1)
        walk.wanted_m = to_m + (0.35 if to_m == 3.0 else -0.35)
        walk.until_s(due_s + 1.7)
        walk.wanted_m = to_m
    walk.until_s(14.0)
    assert (walk.state, walk.trial.watch.envelope.crossings) == (State.RECORD, 0)
    walk.until_s(14.0)
    for number in range(6):
        walk.does(0.7, wanted_m=2.0 + (-0.35 if number % 2 == 0 else 0.35))
    assert walk.trial.failure is Failure.ENVELOPE
    assert walk.trial.watch.envelope.crossings >= 4


def land_by_itself(walk: TrialDriver) -> None:
    walk.hear(BlockEntered(13))


def stop_the_motors(walk: TrialDriver) -> None:
    walk.give(StopRequested(StopRequest("it burns", motors_off=True), walk.now_s))


FAILURES: list[tuple[Callable[[TrialDriver], None], State, Failure]] = [
    (befall.fall_silent, State.LINK_LOST, Failure.LINK),
    (befall.lose_heartbeats, State.LINK_LOST, Failure.LINK),
    (befall.cross_its_fence, State.ABORT_LAND, Failure.ENVELOPE),
    (befall.fly_too_high, State.ABORT_LAND, Failure.ENVELOPE),
    (befall.press_abort, State.ABORT_LAND, Failure.OPERATOR),
    (befall.drain, State.ABORT_LAND, Failure.BATTERY),
    (befall.freeze, State.ABORT_LAND, Failure.FROZEN),
    (befall.lose_its_position, State.ABORT_LAND, Failure.FROZEN),
    (befall.jump_about, State.ABORT_LAND, Failure.LOST_POSITION),
    (befall.reboot, State.ABORT_LAND, Failure.UNEXPECTED),
    (befall.go_astray, State.ABORT_LAND, Failure.UNEXPECTED),
    (befall.stop_by_itself, State.ABORT_LAND, Failure.UNEXPECTED),
    (befall.be_taken_over, State.QUARANTINE, Failure.TAKEN_OVER),
    (befall.be_one_of_two, State.ABORT_LAND, Failure.DUPLICATE),
    (land_by_itself, State.ABORT_LAND, Failure.OWN_LANDING),
    (stop_the_motors, State.DISARM, Failure.OPERATOR),
]


@pytest.mark.parametrize(
    "phase", [pytest.param(each, marks=pytest.mark.complete if each in RARER else ()) for each in PHASES]
)
def test_every_failure_in_every_phase_leads_where_it_must_and_no_set_point_follows(phase: str) -> None:
    begun = PHASES[phase]()
    for happens, then, failure in FAILURES:
        walk = begun.copied()
        walk.moves = False
        happens(walk)
        assert (walk.state, walk.trial.failure) == (then, failure), happens
        flown = len(walk.altitudes)
        if failure in {Failure.ENVELOPE, Failure.OPERATOR} and then is State.ABORT_LAND:
            assert walk.gains_sent[0] == SAFE_GAINS[0]
        walk.give(ActionDone(Action.FLY_TO, walk.now_s, (walk.now_s - 0.1,), walk.now_s))
        walk.pass_s(3.2)
        assert len(walk.altitudes) == flown, happens


def test_a_set_point_that_is_refused_or_never_confirmed_lands_the_vehicle() -> None:
    walk = unconfirmed()
    walk.give(ActionRefused(Action.FLY_TO, "Refused, or never replied to.", walk.now_s))
    assert (walk.state, walk.trial.failure, walk.outcome) == (State.ABORT_LAND, Failure.SET_POINT, "invalid")
    assert (walk.actions[-1], walk.gains_sent) == (Action.LAND, [])
    assert walk.pass_s(8.0).altitudes == [2.0]


def test_a_set_point_that_is_not_confirmed_in_time_ends_the_flight_and_no_other_is_commanded() -> None:
    walk = hovering(7.7, unheard=True)
    assert (walk.altitudes, walk.state) == ([2.0], State.RECORD)
    walk.until_s(10.0)
    assert (walk.state, walk.trial.failure, walk.altitudes) == (State.ABORT_LAND, Failure.SET_POINT, [2.0])


def test_a_set_point_that_took_effect_late_ends_the_flight() -> None:
    for late_s, failure in ((1.4, None), (1.6, Failure.SET_POINT)):
        walk = hovering(7.6, unheard=True)
        sent_s = walk.when(Action.FLY_TO)[0]
        walk.give(ActionDone(Action.FLY_TO, walk.now_s, (sent_s,), sent_s + late_s))
        assert walk.trial.failure is failure


def test_a_record_that_ends_without_all_its_steps_does_not_count() -> None:
    walk = Stepping(plan=replace(STEPS, record_s=12.5))
    walk.lift_off()
    walk.until_s(11.0)
    walk.unheard = True
    walk.until_s(12.6)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.SET_POINT)


def test_a_flight_that_a_pilot_interrupted_gets_no_further_set_point() -> None:
    """Before the first step, one heartbeat reports a manual mode, and the next that it flies by itself."""
    walk = hovering(4.0)
    walk.mode = "64"
    walk.until_s(4.5)
    walk.mode = "4"
    walk.until_s(5.9)
    assert (walk.state, walk.trial.failure) == (State.RECORD, Failure.INTERRUPTED)
    walk.until_s(8.0)
    assert (walk.state, walk.altitudes, walk.actions[-1]) == (State.ABORT_LAND, [], Action.LAND)
    assert walk.gains_sent == []


def test_a_manual_mode_between_two_set_points_ends_them_at_once() -> None:
    walk = hovering(7.0)
    walk.hear(Heartbeat(9, armed=True, mode="64"))
    assert walk.told[-1][1] == WithdrawSetPoint()
    assert (walk.state, walk.actions[-1]) == (State.RECORD, Action.FLY_TO), "a pilot may be flying"
    walk.until_s(13.0)
    assert (walk.state, walk.trial.failure, walk.altitudes) == (State.ABORT_LAND, Failure.INTERRUPTED, [2.0])


def test_a_stream_that_paused_lands_the_vehicle_unless_a_pilot_may_be_flying() -> None:
    walk = hovering(7.0)
    walk.give(SetPointsPaused(0.8, walk.now_s))
    assert (walk.state, walk.trial.failure, walk.outcome) == (State.ABORT_LAND, Failure.PAUSED, "invalid")
    walk = hovering(7.0)
    walk.hear(Heartbeat(9, armed=True, mode="64"))
    walk.give(SetPointsPaused(0.8, walk.now_s))
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)


def test_a_set_point_whose_message_was_repeated_may_have_taken_effect_at_each_sending() -> None:
    walk = unconfirmed()
    sent_s = walk.commanded_s
    walk.give(ActionDone(Action.FLY_TO, sent_s + 0.6, (sent_s, sent_s + 0.5), sent_s + 0.6))
    [change] = walk.trial.set_points.changes
    assert change.altitude_m == 2.0
    assert change.times_s == pytest.approx((6.1, 6.6), abs=0.03)


def test_a_vehicle_that_is_not_at_rest_before_the_first_step_is_landed() -> None:
    walk = hovering(4.0)
    walk.climb_rate_m_s = 0.2
    walk.until_s(6.1)
    assert (walk.state, walk.trial.failure, walk.altitudes) == (State.ABORT_LAND, Failure.NOT_SETTLED, [])
    assert (walk.gains_sent[0], walk.outcome) == (SAFE_GAINS[0], "invalid")
    assert climbing().until_s(6.1).trial.failure is Failure.NOT_SETTLED


def test_no_set_point_is_commanded_while_a_pilot_may_be_flying() -> None:
    walk = hovering(5.4)
    walk.mode = "64"
    walk.until_s(6.2)
    assert walk.altitudes == []


def test_the_takeoff_alone_has_no_further_set_points() -> None:
    walk = TrialDriver().lift_off().pass_s(4.0)
    assert Action.FLY_TO not in walk.actions
    assert walk.trial.set_points.settling == ()


OFFBOARD, LOITER = "6.0", "4.3"
HOLDS_FIRST = with_autopilot(
    replace(PLAN, set_points=SetPoints((0.0, 4.0, 9.0, 12.0), (3.0, 3.0, 2.0, 3.0)), record_s=20.0),
    holds_first=True,
    following_modes=frozenset({OFFBOARD}),
    flying_modes=frozenset({"4.2", LOITER}),
    hovering_modes=frozenset({LOITER}),
    landing_modes=frozenset({"4.6"}),
    automatic_modes=frozenset({"0", "4.2", LOITER, OFFBOARD, "4.6"}),
)


def climbed() -> Stepping:
    """A vehicle that is to hold its first set point by position targets, and still is in the mode of its takeoff."""
    walk = Stepping(plan=HOLDS_FIRST, mode="4.2")
    walk.lift_off()
    return walk.until_s(4.5)


def following() -> Stepping:
    """A vehicle that has entered the mode in which it follows set points, and confirmed the first."""
    walk = climbed()
    assert Action.HOLD not in walk.actions
    walk.mode, walk.unheard = LOITER, True
    walk.until_s(6.0)
    assert walk.actions[-1] is Action.HOLD
    walk.mode = OFFBOARD
    walk.until_s(6.6)
    walk.unheard = False
    return walk.until_s(7.0)


def test_a_vehicle_holds_its_first_set_point_once_it_hovers_and_before_it_steps() -> None:
    walk = following()
    assert [change.altitude_m for change in walk.trial.set_points.changes] == [3.0]
    walk.until_s(14.0)
    assert (walk.state, walk.altitudes) == (State.RECORD, [2.0, 3.0])


def asked() -> Stepping:
    """A vehicle that hovers, and has been commanded to hold its first set point."""
    walk = climbed()
    walk.mode, walk.unheard = LOITER, True
    return walk.until_s(6.0)


@pytest.mark.parametrize(
    "after_s", [0.3, 1.2, *(pytest.param(after_s, marks=pytest.mark.complete) for after_s in (0.0, 0.7, 1.9))]
)
@pytest.mark.parametrize("gives_back", [False, True])
def test_a_pilot_who_takes_over_while_it_is_commanded_to_hold_is_not_overridden(
    after_s: float, gives_back: bool
) -> None:
    walk = asked()
    walk.pass_s(after_s)
    walk.mode = "3.0"
    while WithdrawSetPoint() not in [command for _, command in walk.told]:
        walk.pass_s(STEP_S)
    assert walk.state is State.RECORD
    walk.does(1.1, mode=LOITER if gives_back else "3.0")
    given_up = (State.ABORT_LAND, Failure.INTERRUPTED) if gives_back else (State.QUARANTINE, Failure.TAKEN_OVER)
    assert (walk.state, walk.trial.failure) == given_up
    walk.give(ActionDone(Action.HOLD, walk.now_s, (walk.now_s - 0.1,), walk.now_s))
    walk.pass_s(6.0)
    commanded = [action for action in walk.actions if action in {Action.HOLD, Action.FLY_TO}]
    assert commanded == [Action.HOLD]


def test_holding_the_first_set_point_again_permits_no_crossing() -> None:
    walk = asked()
    assert not walk.trial.watch.envelope.may_overshoot


def test_the_mode_in_which_it_follows_set_points_is_unexpected_before_the_first() -> None:
    walk = climbed()
    walk.mode = OFFBOARD
    walk.until_s(6.0)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.UNEXPECTED)
    walk = following()
    walk.give(ActionRefused(Action.FLY_TO, "The vehicle refused it.", walk.now_s))
    walk.pass_s(2.0)
    assert (walk.state, walk.trial.doubt) == (State.ABORT_LAND, ""), "it lands out of that mode"


@pytest.mark.complete
@pytest.mark.parametrize("begin", [asked, lambda: following().until_s(9.3)], ids=["asked to hold", "during a step"])
def test_every_failure_of_one_that_holds_first_leads_where_it_must_too(begin: Callable[[], Stepping]) -> None:
    begun = begin()
    for happens, then, failure in FAILURES:
        if happens is land_by_itself:
            continue
        walk = begun.copied()
        walk.moves = False
        happens(walk)
        assert (walk.state, walk.trial.failure) == (then, failure), happens
        flown = len(walk.actions)
        walk.pass_s(3.2)
        assert not {Action.HOLD, Action.FLY_TO} & set(walk.actions[flown:]), happens


@pytest.mark.complete
def test_a_set_point_of_another_ground_station_makes_the_flight_invalid_and_a_pilots_does_not() -> None:
    """A report of the previous set point that comes late decides nothing."""
    for seconds, mode, failure in ((0.2, OFFBOARD, None), (1.2, OFFBOARD, Failure.INTERRUPTED), (0.8, "3.0", None)):
        walk = following()
        walk.mode = mode
        while (
            walk.trial.set_points.astray_since_s is None or walk.now_s - walk.trial.set_points.astray_since_s < seconds
        ):
            walk.hear(TargetAltitude(2.6))
            walk.pass_s(STEP_S)
        walk.hear(TargetAltitude(3.0))
        assert (walk.trial.failure, walk.state) == (failure, State.RECORD)
    walk = following()
    walk.hear(TargetAltitude(3.0)).pass_s(1.0)
    assert walk.trial.failure is None


def test_a_vehicle_that_leaves_the_mode_in_which_it_follows_set_points_is_landed() -> None:
    walk = following()
    walk.mode = LOITER
    walk.until_s(8.5)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.UNEXPECTED)
    assert walk.altitudes == []


def test_a_vehicle_whose_climb_does_not_end_or_that_refuses_to_hold_is_landed() -> None:
    walk = climbed().until_s(7.1)
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.NOT_SETTLED)
    assert Action.HOLD not in walk.actions
    walk = climbed()
    walk.mode, walk.unheard = LOITER, True
    walk.until_s(6.0)
    walk.give(ActionRefused(Action.HOLD, "The vehicle refused to hold its first set point.", walk.now_s))
    assert (walk.state, walk.trial.failure) == (State.ABORT_LAND, Failure.SET_POINT)
