"""What a trial does from the command to land on: descend, stop the motors, restore the safe gains."""

from dataclasses import replace
from typing import Final

from app.autopilots.commands import Action
from app.autopilots.measurements import Heartbeat
from app.vehicles.mavlink.events import (
    Event,
    GainsRestored,
    PacketReceived,
    PerformAction,
    RestoreGains,
    confirms_motors_off,
)
from app.vehicles.mavlink.failures import DESCENDING_M_S, DRIFT_M, REPEAT_S, Failure, land_every_s
from app.vehicles.mavlink.trial_reactions import (
    abort,
    abort_landing,
    disarm,
    enter,
    fail,
    find_change,
    find_contact,
    find_doubt_of_descent,
    find_doubt_of_ground,
    find_taken_over,
    may_be_by_hand,
    note,
    quarantine,
    send_gains,
)
from app.vehicles.mavlink.trial_state import State, Step, Trial

LANDED_S: Final = 2.0
LANDING_S: Final = 40.0
DISARMED_WITHIN_S: Final = 5.0
LINK_LOST_S: Final = 60.0
_LANDING_BLOCK_S: Final = 20.0
"""Longer than a flight plan takes from the descent to the block that reports the landing, once."""


def landing(trial: Trial, event: Event) -> Step:
    """Handle land and abort-land: send the remaining safe gains, repeat Land until it descends, await touchdown."""
    now_s = event.now_s
    if trial.safe_gains is not None and trial.safe_gains.awaited is not None:
        return send_gains(trial, trial.safe_gains, event)
    watch = trial.watch
    if finding := (
        find_taken_over(trial)
        or (watch.envelope.find(trial.plan, watch.last, settling=False) if trial.safe_gains is None else None)
        or (find_change(trial) if trial.state is State.LAND else None)
    ):
        return fail(trial, finding, now_s)
    trial = _doubting(resting(trial, now_s))
    if _has_landed(trial, now_s):
        return _come_down(trial, now_s)
    if now_s - trial.since_s > LANDING_S:
        return quarantine(trial, f"It has not landed within {LANDING_S:g} s.", now_s)
    return (trial, ()) if _confirms_landing(trial, now_s) else _land_again(trial, now_s)


def _land_again(trial: Trial, now_s: float) -> Step:
    """Repeat Land when it is due."""
    every_s = land_every_s(now_s - trial.since_s, trial.plan.autopilot.land_again_s)
    if now_s - trial.repeated_s < every_s or may_be_by_hand(trial, now_s):
        return trial, ()
    return replace(trial, repeated_s=now_s), (PerformAction(Action.LAND),)


def _doubting(trial: Trial) -> Trial:
    """Note a finding that makes the vehicle's state uncertain while it lands for another reason."""
    return note(trial, find_change(trial) if trial.takeoff is not None else trial.watch.identity.find_duplicate())


def _come_down(trial: Trial, now_s: float) -> Step:
    """Stop the motors of a landed vehicle, unless its state or identity is uncertain. One that was last observed high
    may have fallen."""
    if trial.failure is not Failure.FALL and find_change(trial):
        return quarantine(trial, "", now_s)
    ground_m, unseen_m = trial.plan.ground_m, trial.watch.climb.unseen_m
    if unseen_m is not None and unseen_m - ground_m > DRIFT_M and not trial.doubt:
        trial = replace(trial, doubt="Its landing was not observed: it may have fallen.")
    return disarm(trial, now_s)


def resting(trial: Trial, now_s: float) -> Trial:
    """Note since when it has been at rest: on the ground by every source, or, once its motors are off, near the ground
    by speed alone, because the altitude of some autopilots drifts. A single sample that jumps is ignored."""
    if trial.watch.positions.is_in_doubt(now_s):
        return trial
    if not trial.watch.modes.is_disarmed:
        rests = trial.watch.ground.grounded_since_s is not None
    else:
        rests = trial.watch.positions.is_still(now_s, trial.plan.ground_m)
    if rests is (trial.resting_since_s is not None):
        return trial
    return replace(trial, resting_since_s=now_s if rests else None)


def has_rested(trial: Trial, seconds: float, now_s: float) -> bool:
    return trial.resting_since_s is not None and now_s - trial.resting_since_s >= seconds


def _has_landed(trial: Trial, now_s: float) -> bool:
    """Whether it has been at rest for 2 s, or has disarmed itself near the ground, as some do, by a fresh position."""
    positions = trial.watch.positions
    near = positions.is_fresh(now_s) and not positions.is_airborne(now_s, trial.plan.ground_m)
    disarmed = trial.watch.modes.is_disarmed
    return (has_rested(trial, LANDED_S, now_s) and not find_doubt_of_descent(trial, now_s)) or (near and disarmed)


def link_lost(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    trial = _doubting(trial)
    if finding := find_taken_over(trial):
        return fail(trial, finding, now_s)
    is_received = isinstance(event, PacketReceived) and isinstance(event.measurement, Heartbeat)
    if is_received and not may_be_by_hand(trial, now_s):
        return abort_landing(trial, now_s)
    if now_s - trial.since_s > LINK_LOST_S:
        return quarantine(trial, f"The link stayed lost for {LINK_LOST_S:g} s.", now_s)
    return _land_again(trial, now_s)


def disarming(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    trial = _answered(_doubting(trial), event)
    if _is_stopped(trial, event):
        confirmed = ("The vehicle confirmed that its motors have stopped.",) if trial.stopped else ()
        trial = replace(trial, remarks=(*trial.remarks, *confirmed), contact=find_contact(trial, now_s))
        return enter(trial, State.RESTORE, now_s), (RestoreGains(),)
    watch, plan = trial.watch, trial.plan
    stands = trial.takeoff is None and watch.stands_by_own_account(now_s, plan)
    airborne = watch.modes.armed and watch.positions.is_airborne(now_s, plan.ground_m)
    if airborne and not (stands or trial.stopped):
        why = "It was in the air when its motors were to be stopped."
        return abort(replace(trial, doubt=trial.doubt or why), now_s)
    doubt = "" if trial.stopped else find_doubt_of_ground(trial, now_s)
    if now_s - trial.since_s > DISARMED_WITHIN_S:
        unconfirmed = f"It has not confirmed within {DISARMED_WITHIN_S:g} s that its motors stopped."
        return quarantine(trial, f"Its motors were not commanded to stop: {doubt}." if doubt else unconfirmed, now_s)
    if not doubt and now_s - trial.repeated_s >= REPEAT_S:
        action = Action.KILL if trial.stopped else Action.MOTORS_OFF
        return replace(trial, repeated_s=now_s), (PerformAction(action),)
    return trial, ()


def _answered(trial: Trial, event: Event) -> Trial:
    """Note a reply to the command to stop its motors, which together with one heartbeat confirms the stop. Before the
    takeoff command it may be the reply to arming, which some autopilots send for either."""
    if trial.takeoff is None:
        return trial
    measurement = event.measurement if isinstance(event, PacketReceived) else None
    answered = (
        confirms_motors_off(measurement, trial.plan.autopilot.stop_settings) and trial.repeated_s >= trial.since_s
    )
    return replace(trial, answered=trial.answered or answered)


def _is_stopped(trial: Trial, event: Event) -> bool:
    """Whether its motors have stopped, by two heartbeats, or by one and its reply to the command."""
    if not isinstance(event, PacketReceived) or not isinstance(event.measurement, Heartbeat) or event.measurement.armed:
        return False
    if trial.takeoff is None:  # a heartbeat may have been under way since before it armed
        since_s = max(trial.watch.modes.armed_since_s, trial.since_s)
        return event.now_s - since_s >= trial.plan.confirmation_s
    return trial.answered or trial.watch.modes.is_disarmed


def restoring(trial: Trial, event: Event) -> Step:
    if not isinstance(event, GainsRestored):
        return trial, ()
    if event.problem:
        return quarantine(trial, f"Its safe gains could not be verified. {event.problem}", event.now_s)
    if trial.doubt:
        return quarantine(trial, "", event.now_s)
    return enter(trial, State.IDLE, event.now_s), ()


def _confirms_landing(trial: Trial, now_s: float) -> bool:
    """Whether telemetry confirms that the vehicle is landing: it descends, or is near the ground."""
    positions, modes, autopilot = trial.watch.positions, trial.watch.modes, trial.plan.autopilot
    if not positions.is_fresh(now_s):
        return False
    is_new = now_s - modes.block_s < _LANDING_BLOCK_S
    lands = is_new and modes.block in autopilot.landing_blocks  # another Land would begin its landing again
    lands = lands or modes.agreed in autopilot.landing_modes - autopilot.flying_modes
    near = not positions.is_airborne(now_s, trial.plan.ground_m)
    descends = positions.last.climb_rate_m_s < DESCENDING_M_S
    return (near and (lands or not find_doubt_of_descent(trial, now_s))) or descends
