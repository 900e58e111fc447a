"""What a trial does in each of its states, as a pure function of the trial and an event."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

from app.autopilots.commands import Action
from app.autopilots.measurements import Position
from app.vehicles.mavlink import set_point_schedule
from app.vehicles.mavlink.events import (
    ActionDone,
    ActionRefused,
    Event,
    PerformAction,
    RequestGain,
    SetPointsPaused,
    WithdrawSetPoint,
)
from app.vehicles.mavlink.failures import DRIFT_M, Failure, Finding
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.trial_landing import disarming, has_rested, landing, link_lost, resting, restoring
from app.vehicles.mavlink.trial_reactions import (
    MODE_KNOWN_S,
    abort_landing,
    enter,
    fail,
    find_in_flight,
    find_noted,
    is_by_hand,
    land,
    may_be_by_hand,
    measure_ground,
    note,
)
from app.vehicles.mavlink.trial_state import State, Step, TakeoffCommand, Trial

BASELINE_S: Final = 1.0
ARMED_WITHIN_S: Final = 2.0
DOWN_S: Final = 1.0
"""Longest time on the ground while it should hover: its integrator winds up."""
_STUCK_S: Final = 0.2
"""An altitude that has not changed at all for so long may stand still, which is certain soon."""
_WAITED_S: Final = 0.05
"""Longest usual time from a sample to the next."""
_SET_POINT_ACTIONS: Final = frozenset({Action.HOLD, Action.FLY_TO})
_ARMING_S: Final = 15.0
"""Longest time that arming may take, with all repetitions."""


def _arm(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if isinstance(event, ActionDone) and event.action is Action.ARM:
        trial = replace(trial, arm_sent_s=now_s)
    if trial.watch.modes.armed and trial.armed_s is None:
        trial = replace(trial, armed_s=now_s)
    if finding := (
        (Finding(Failure.NOT_ARMED, event.why) if isinstance(event, ActionRefused) else None)
        or find_noted(trial, Failure.INTERRUPTED, Failure.UNEXPECTED)
        or trial.watch.find_on_ground(trial.plan, now_s)
        or _not_armed(trial, event)
    ):
        return fail(measure_ground(trial, now_s), finding, now_s)
    last = trial.watch.last
    if trial.armed_s is None or not trial.watch.modes.armed or now_s - trial.armed_s < BASELINE_S:
        return trial, ()
    trial = measure_ground(replace(trial, watch=trial.watch.begin_climb(last.altitude_m)), now_s)
    watch, plan = trial.watch, trial.plan
    stands = watch.stands_by_own_account(now_s, plan)
    if finding := (
        watch.positions.find_departure(plan.ground_m, stands=stands)
        or watch.second.find_disagreement_on_ground(last.altitude_m, trial.ground_shift_m, now_s)
        or trial.settings.find_unconfirmed()
    ):
        return fail(trial, finding, now_s)
    mode, modes = watch.modes.mode, replace(watch.modes, block="", agreed="", mode_since_s=now_s + MODE_KNOWN_S)
    takeoff = TakeoffCommand(at_s=now_s, boot_s=_boot_s(watch, last, now_s), mode=mode, requested_s=now_s)
    trial = replace(trial, watch=replace(watch, modes=modes), takeoff=takeoff)
    commands = PerformAction(Action.TAKE_OFF), RequestGain(plan.safe_gains[0].parameter)
    return enter(trial, State.TAKEOFF, now_s), commands


def _boot_s(watch: TrialObservation, last: Position, now_s: float) -> float:
    """Return the vehicle's own time of the takeoff command: that of its last sample, or later if that one had waited
    through a stall of this program."""
    offset_s = watch.clock.least_offset_s
    return last.time_boot_s if offset_s is None else max(last.time_boot_s, now_s - offset_s - _WAITED_S)


def _not_armed(trial: Trial, event: Event) -> Finding | None:
    why = ""
    if trial.armed_s is not None and trial.watch.modes.is_disarmed:
        why = "It disarmed itself."
    elif trial.armed_s is None:
        late = trial.arm_sent_s is not None and event.now_s - trial.arm_sent_s > ARMED_WITHIN_S
        why = "It did not report that it is armed." if late or event.now_s - trial.since_s > _ARMING_S else ""
    return Finding(Failure.NOT_ARMED, why) if why else None


def _take_off(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if finding := find_in_flight(trial, now_s):
        return fail(trial, finding, now_s)
    if trial.watch.positions.is_airborne(now_s, trial.plan.ground_m):
        return enter(trial, State.RECORD, now_s), ()
    if finding := trial.watch.climb.find_behind():
        return fail(trial, finding, now_s)
    if isinstance(event, ActionRefused):
        if (takeoff := trial.takeoff) is not None:
            trial = replace(trial, takeoff=replace(takeoff, confirmed_boot_s=takeoff.boot_s))
        return fail(trial, Finding(Failure.TAKE_OFF_REFUSED, event.why), now_s)
    if finding := _no_lift_off(trial, now_s):
        return fail(trial, finding, now_s)
    return trial, ()


def _no_lift_off(trial: Trial, now_s: float) -> Finding | None:
    watch, lift_off_s = trial.watch, trial.plan.autopilot.lift_off_s
    decides_soon = not watch.modes.armed or watch.positions.unchanged_s > _STUCK_S
    if _waited_s(trial) <= lift_off_s or decides_soon or not watch.positions.is_fresh(now_s):
        return None
    if trial.watch.is_said_to_fly(now_s, trial.plan.ground_m):
        return Finding(Failure.LOST_POSITION, "It reports that it flies, but its altitude stayed on the ground.")
    return Finding(Failure.NO_LIFT_OFF, f"It was still on the ground {lift_off_s:g} s after the command.")


def _waited_s(trial: Trial) -> float:
    """Return by the vehicle's own time how long it has stood since the command, or since it certainly had it."""
    takeoff = trial.takeoff
    return 0.0 if takeoff is None else trial.watch.last.time_boot_s - (takeoff.confirmed_boot_s or takeoff.boot_s)


def _record(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if finding := find_in_flight(trial, now_s):
        return fail(trial, finding, now_s)
    trial = resting(trial, now_s)
    if has_rested(trial, DOWN_S, now_s) and _is_armed_since(trial, trial.resting_since_s):
        stayed = _may_have_stayed(trial, now_s)
        descended = Finding(Failure.ENVELOPE, "It descended to the ground by itself.")
        if finding := _no_lift_off(trial, now_s) if stayed else descended:
            return fail(trial, finding, now_s)
    if (changed := _change_set_point(trial, event)) is not None:
        return changed
    if not _is_whole(trial) or may_be_by_hand(trial, now_s):
        return _overtime(trial, now_s)
    if finding := set_point_schedule.find_missing(trial):
        return fail(trial, finding, now_s)
    plan, watch = trial.plan, trial.watch
    lowest_m = min(plan.set_points.altitudes_m) + plan.datum_m
    for finding in (
        watch.positions.find_glitches(),
        trial.settings.find_unconfirmed() or watch.climb.find_sunken(watch.last, lowest_m, plan.ground_m),
        watch.climb.find_incomplete(plan.climb_to_m) if plan.autopilot.climbs_from_ground else None,
    ):
        trial = note(trial, finding)
    return land(trial, State.LAND, now_s)


def _may_have_stayed(trial: Trial, now_s: float) -> bool:
    """Whether its landed state has always been that it stands since the command, and its altitude has not been higher
    than one may shift as the motors start."""
    watch = trial.watch
    since_s = now_s if trial.takeoff is None else trial.takeoff.at_s
    stood = watch.ground.landed is True and watch.ground.landed_since_s <= since_s
    return stood and watch.climb.highest_m - trial.plan.ground_m <= DRIFT_M


def _withdraw(trial: Trial, now_s: float) -> Step:
    """Command no set point any more: a pilot may be flying, and would be overridden. Land once a heartbeat reports that
    nobody is."""
    if not trial.set_points.withdrawn:
        set_points = replace(trial.set_points, withdrawn=True)
        return replace(trial, set_points=set_points), (WithdrawSetPoint(),)
    if is_by_hand(trial):
        return trial, ()
    why = "A heartbeat reported a manual mode, so that no further set point was commanded."
    return abort_landing(note(trial, Finding(Failure.INTERRUPTED, why)), now_s)


def _change_set_point(trial: Trial, event: Event) -> Step | None:
    """Command the next set point when it is due, and note its confirmation; None if there is nothing to do. A flight
    that does not count any more is ended instead."""
    now_s = event.now_s
    if trial.set_points.has_begun and (trial.set_points.withdrawn or is_by_hand(trial)):
        return _withdraw(trial, now_s)
    is_confirmed = isinstance(event, ActionDone) and event.action in _SET_POINT_ACTIONS
    if isinstance(event, ActionDone) and is_confirmed:
        trial = set_point_schedule.confirm(trial, event)
    if finding := _find_set_point_failure(trial, event):
        return fail(trial, finding, now_s)
    if not set_point_schedule.is_due(trial, now_s) or may_be_by_hand(trial, now_s):
        return (trial, ()) if is_confirmed else None
    if trial.failure is not None:
        return abort_landing(trial, now_s)
    finding = set_point_schedule.find_unsettled(trial)
    return set_point_schedule.command_next(trial) if finding is None else fail(trial, finding, now_s)


def _find_set_point_failure(trial: Trial, event: Event) -> Finding | None:
    """Find that a set point was refused or confirmed late, or that their stream paused."""
    match event:
        case ActionRefused(action=action, why=why) if action in _SET_POINT_ACTIONS:
            return Finding(Failure.SET_POINT, why)
        case SetPointsPaused(paused_s=paused_s):
            return Finding(Failure.PAUSED, f"Gainline stalled, and sent no set point for {paused_s:.1f} s.")
        case ActionDone(action=action) if action in _SET_POINT_ACTIONS:
            return set_point_schedule.find_late(trial)
        case _:
            finding = set_point_schedule.find_overdue(trial, event.now_s)
            return None if finding is None or may_be_by_hand(trial, event.now_s) else finding


def _is_whole(trial: Trial) -> bool:
    start_s = trial.commanded_boot_s
    return start_s is not None and trial.watch.last.time_boot_s - start_s >= trial.plan.record_s


def _overtime(trial: Trial, now_s: float) -> Step:
    """End by the ground's clock a record that the vehicle's clock does not end."""
    plan, takeoff = trial.plan, trial.takeoff
    if takeoff is None or (passed_s := now_s - takeoff.at_s) <= plan.record_s + plan.slow_s:
        return trial, ()
    why = f"Its clock advanced by {trial.watch.last.time_boot_s - takeoff.boot_s:.1f} s in {passed_s:.1f} s."
    return fail(trial, Finding(Failure.SLOW_CLOCK, why), now_s)


def _is_armed_since(trial: Trial, since_s: float | None) -> bool:
    """Whether a heartbeat since then has reported that its motors run: nobody else has stopped them."""
    modes = trial.watch.modes
    return modes.armed and since_s is not None and modes.heartbeat_s >= since_s


HANDLERS: Final[Mapping[State, Callable[[Trial, Event], Step]]] = {
    State.ARM: _arm,
    State.TAKEOFF: _take_off,
    State.RECORD: _record,
    State.LAND: landing,
    State.ABORT_LAND: landing,
    State.LINK_LOST: link_lost,
    State.DISARM: disarming,
    State.RESTORE: restoring,
}
