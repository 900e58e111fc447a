"""One trial from arming to the safe gains read back, as a pure reducer: (trial, event) → (trial, commands).

It depends on no autopilot and no clock: events carry their time, and commands are data that `trial.py` carries out.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Final

from app.vehicles.flight_end import Landing
from app.vehicles.mavlink import limit_checks, set_point_schedule
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.events import (
    Action,
    ActionDone,
    ActionRefused,
    Command,
    DuplicateVehicleDetected,
    Event,
    GainsRestored,
    Heartbeat,
    Measurement,
    PacketReceived,
    Parameter,
    PerformAction,
    Position,
    RecordSample,
    RequestGain,
    RestoreGains,
    SecondaryAltitudeReceived,
    SetPointsPaused,
    StopRequested,
    WithdrawSetPoint,
    confirms_motors_off,
)
from app.vehicles.mavlink.failures import DESCENDING_M_S, REPEAT_S, Failure, Finding, land_every_s
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.states import replace
from app.vehicles.mavlink.trial_reactions import (
    COMMANDED,
    Plan,
    State,
    Step,
    Trial,
    abort,
    disarm,
    enter,
    fail,
    find_contact,
    find_doubt_of_descent,
    find_doubt_of_ground,
    land,
    measure_ground,
    note,
    note_cause,
    quarantine,
    request_reply,
    send_gains,
    stop_motors,
)

__all__ = ["Plan", "Trial", "advance", "begin"]

BASELINE_S: Final = 1.0
ARMED_WITHIN_S: Final = 2.0
LANDED_S: Final = 2.0
DOWN_S: Final = 1.0
"""Longest time on the ground while it should hover: its integrator winds up."""
LANDING_S: Final = 40.0
DISARMED_WITHIN_S: Final = 5.0
LINK_LOST_S: Final = 60.0
_MODE_KNOWN_S: Final = 1.0
_STUCK_S: Final = 0.2
"""An altitude that has not changed at all for so long may stand still, which is certain soon."""
_WAITED_S: Final = 0.05
"""Longest usual time from a sample to the next."""
_REPLY_S: Final = 0.5
"""Interval at which a reply after the takeoff command is requested."""
_OTHER_M: Final = 1.0
"""After a greater jump of the altitude, another vehicle may be answering."""
_SET_POINT_ACTIONS: Final = frozenset({Action.HOLD, Action.FLY_TO})
_STOPPED_WITHIN_S: Final = 0.6
"""A vehicle whose heartbeats report its motors off within this time of its fall fell because they were stopped; one
that detects its landing takes longer."""
_LANDING_BLOCK_S: Final = 20.0
"""Longer than a flight plan takes from the descent to the block that reports the landing, once."""
_ARMING_S: Final = 15.0
"""Longest time that arming may take, with all repetitions."""


def begin(plan: Plan, watch: TrialObservation, now_s: float) -> Step:
    """Begin the trial of a vehicle that stands disarmed on the ground with its gains confirmed: command it to arm."""
    return Trial(plan=plan, state=State.ARM, since_s=now_s, watch=watch), (PerformAction(Action.ARM),)


def advance(trial: Trial, event: Event) -> Step:
    """Return the trial after an event, and the commands to carry out."""
    if trial.is_over:
        return trial, ()
    kept: tuple[Command, ...] = ()
    if isinstance(event, PacketReceived):
        trial, kept = _process_packet(trial, event)
    elif isinstance(event, SecondaryAltitudeReceived):
        sample = dataclasses.replace(event, altitude_m=event.altitude_m + trial.ground_shift_m)
        trial = replace(trial, watch=watching.update_secondary(trial.watch, sample))
    elif isinstance(event, DuplicateVehicleDetected):
        trial = replace(trial, watch=replace(trial.watch, duplicate_reason=event.why))
    settled = watching.settle(
        trial.watch, event.now_s, trial.plan.ground_m, trial.plan.limits, commanded=trial.commanded_s is not None
    )
    trial = trial if settled is trial.watch else replace(trial, watch=settled)
    trial, requests = _confirm_take_off(trial, event)
    trial, polls = _poll_settings(trial, event.now_s)
    trial = _with_drift(_with_jump(_with_disarming(_with_fall(trial, event.now_s))), event.now_s)
    trial, commands = _react(trial, event)
    return trial, (*kept, *requests, *polls, *commands)


def _poll_settings(trial: Trial, now_s: float) -> Step:
    """Request the mode of a vehicle whose heartbeats do not distinguish all modes, and settings in doubt."""
    mode = trial.plan.mode_parameter
    names = sorted(trial.suspects | (set() if mode is None else {mode.name}))
    if not names or trial.state not in _STATES_WITH_TRIAL_GAINS or now_s - trial.polled_s < REPEAT_S:
        return trial, ()
    return replace(trial, polled_s=now_s), tuple(RequestGain(name) for name in names)


def _confirm_take_off(trial: Trial, event: Event) -> Step:
    """Note the first reply to a message sent after the takeoff command, and request one until then."""
    last = trial.watch.last
    if not trial.may_take_off or last is None:
        return trial, ()
    measurement = event.measurement if isinstance(event, PacketReceived) else None
    if isinstance(measurement, Parameter) and measurement.name == trial.plan.safe_gains[0].parameter:
        return replace(trial, confirmed_boot_s=last.time_boot_s, resting_since_s=None), ()
    return request_reply(trial, event.now_s) if event.now_s - trial.requested_s >= _REPLY_S else (trial, ())


def _process_packet(trial: Trial, event: PacketReceived) -> Step:
    watch, positions = watching.update(trial.watch, event.measurement, event.now_s, trial.plan.limits)
    trial = _with_disarmed_height(trial, watch, event.now_s)
    trial, requests = _check_settings(replace(_with_interruption(trial, watch), watch=watch), event.measurement)
    if trial.armed_s is None or trial.state not in _RECORDED or watch.rebooted:
        return trial, requests
    if trial.state is State.ARM:
        trial = replace(trial, ground_samples=(*trial.ground_samples, *positions))
    elif trial.state is State.RECORD:
        trial = set_point_schedule.note_settling(trial, positions)
        trial = set_point_schedule.note_target(trial, event.measurement, event.now_s)
    to_m = trial.plan.ground_m if trial.state not in _STATES_WITH_TRIAL_GAINS else trial.plan.limits.set_point_m
    second_m = watch.second.altitude_m if watch.second is not None else None
    samples = (RecordSample(position, to_m, watch.battery_v, second_m) for position in positions)
    return trial, (*requests, *samples)


def _check_settings(trial: Trial, measurement: Measurement | None) -> Step:
    """Note a gain, or the mode, that the vehicle reports with another value than it must hold. A single report may be
    an old one, and is confirmed by a reply to a request."""
    if trial.state not in {State.ARM, *_STATES_WITH_TRIAL_GAINS} or not isinstance(measurement, Parameter):
        return trial, ()
    mode, name, value = trial.plan.mode_parameter, measurement.name, measurement.value
    held = {setting.parameter: setting.value for setting in trial.plan.trial_gains}
    if mode is not None and value in mode.modes:  # heartbeats show the others
        held[mode.name] = mode.flying
    if math.isclose(held.get(name, value), value, rel_tol=1e-6):
        return replace(trial, suspects=trial.suspects - {name}) if name in trial.suspects else trial, ()
    if name not in trial.suspects:
        return replace(trial, suspects=trial.suspects | {name}), (RequestGain(name),)
    if mode is not None and name == mode.name:
        entered = limit_checks.named(mode.modes[value], trial.plan.limits)
        return note(trial, Finding(failure=Failure.UNEXPECTED, why=f"The vehicle entered mode {entered}.")), ()
    why = f"{name} changed to {value:g} by a command that was not Gainline's."
    return note(trial, Finding(failure=Failure.INTERRUPTED, why=why)), ()


def _with_disarmed_height(trial: Trial, watch: TrialObservation, now_s: float) -> Trial:
    """Note the height of a vehicle in the air whose heartbeats begin to report that its motors are off."""
    if watch.armed == trial.watch.armed or trial.state not in _FLOWN:
        return trial
    ground_m, last = trial.plan.ground_m, watch.last
    is_up = last is not None and watching.is_fresh(watch, now_s) and not watching.reports_landing(watch, now_s)
    height_m = last.altitude_m - ground_m if last is not None and is_up and not watch.armed else 0.0
    return replace(trial, disarmed_m=height_m)


def _with_interruption(trial: Trial, watch: TrialObservation) -> Trial:
    """Note a manual mode that only one heartbeat reported."""
    if trial.state not in _STATES_WITH_TRIAL_GAINS or not _modes(trial):
        return trial
    finding = limit_checks.find_interruption(trial.watch, watch, trial.plan.limits)
    return trial if finding is None else note(trial, finding)


def _with_fall(trial: Trial, now_s: float) -> Trial:
    """Note a fall in any state, unless a person has requested motors off."""
    if trial.stopped or trial.commanded_s is None or trial.fell_s is not None:
        return trial
    fall = limit_checks.find_fall(trial.watch, trial.plan.limits, trial.plan.ground_m)
    return trial if fall is None else replace(note(trial, fall), contact=Landing.FELL, fell_s=now_s)


def _with_disarming(trial: Trial) -> Trial:
    """Note that somebody else, or the vehicle itself, stopped its motors in the air: it exceeded its limits because it
    fell."""
    watch, limits = trial.watch, trial.plan.limits
    if trial.stopped or trial.state not in _UNTIL_STOPPED or not watching.is_disarmed(watch, limits):
        return trial
    fell = trial.fell_s is not None and watch.armed_since_s - trial.fell_s <= _STOPPED_WITHIN_S
    if not fell and trial.disarmed_m <= watching.DRIFT_M:
        return trial
    return note_cause(trial, Finding(failure=Failure.UNEXPECTED, why="Its motors were stopped in the air."))


def _with_drift(trial: Trial, now_s: float) -> Trial:
    """Note an altitude that has drifted, so that limits may have been exceeded by it alone, or that contradicts the
    landed state. In a fall it lags."""
    is_up = trial.commanded_s is not None and trial.state in _UNTIL_STOPPED
    if trial.stopped or not is_up or trial.fell_s is not None:
        return trial
    plan, landed_blocks = trial.plan, trial.plan.limits.landed_blocks
    is_told_to_land = trial.state not in _STATES_WITH_TRIAL_GAINS
    has_landed = is_told_to_land and watching.has_reported_landing(trial.watch, now_s, landed_blocks)
    drift = limit_checks.find_drift(trial.watch, now_s, plan.ground_m, has_landed=has_landed)
    trial = trial if drift is None else note_cause(trial, drift)
    contradiction = limit_checks.find_contradiction(trial.watch, now_s)
    return trial if contradiction is None else note(trial, contradiction)


def _with_jump(trial: Trial) -> Trial:
    """Note in any state a jump after which the vehicle's identity is uncertain. An earlier failure of its limits may
    have been one of false positions."""
    if trial.commanded_s is None or trial.doubt or trial.watch.jumped_m <= _OTHER_M:
        return trial
    failure = Failure.LOST_POSITION if trial.failure is Failure.ENVELOPE else trial.failure
    return replace(trial, failure=failure, doubt=f"Its altitude jumped by {trial.watch.jumped_m:.1f} m.")


def _react(trial: Trial, event: Event) -> Step:
    if isinstance(event, StopRequested) and event.request.motors_off:
        return stop_motors(trial, event.request, event.now_s)
    if isinstance(event, StopRequested) and trial.state in COMMANDED:
        trial = measure_ground(trial, event.now_s) if trial.state is State.ARM else trial
        return fail(trial, Finding(failure=Failure.OPERATOR, request=event.request), event.now_s)
    return _HANDLERS[trial.state](trial, event)


def _arm(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if isinstance(event, ActionDone) and event.action is Action.ARM:
        trial = replace(trial, arm_sent_s=now_s)
    if trial.watch.armed and trial.armed_s is None:
        trial = replace(trial, armed_s=now_s)
    if isinstance(event, ActionRefused):
        return fail(measure_ground(trial, now_s), Finding(failure=Failure.NOT_ARMED, why=event.why), now_s)
    if finding := _noted(trial, Failure.INTERRUPTED, Failure.UNEXPECTED):
        return fail(measure_ground(trial, now_s), finding, now_s)
    if finding := limit_checks.find_on_ground(trial.watch, trial.plan.limits, now_s) or _not_armed(trial, event):
        return fail(measure_ground(trial, now_s), finding, now_s)
    last = trial.watch.last
    if trial.armed_s is None or not trial.watch.armed or now_s - trial.armed_s < BASELINE_S or last is None:
        return trial, ()
    watch = replace(trial.watch, behind_m=0.0, stepped_s=0.0, highest_m=last.altitude_m)
    trial = measure_ground(replace(trial, watch=watch), now_s)
    if finding := (
        limit_checks.find_departure(trial.watch, trial.plan.limits, trial.plan.ground_m, now_s)
        or limit_checks.find_disagreement_on_ground(trial.watch, trial.ground_shift_m, now_s)
        or _unconfirmed_setting(trial)
    ):
        return fail(trial, finding, now_s)
    mode, watch = trial.watch.mode, replace(trial.watch, block="", mode_since_s=now_s + _MODE_KNOWN_S)
    boot_s = _boot_s(trial.watch, last, now_s)
    trial = replace(trial, watch=watch, commanded_s=now_s, commanded_boot_s=boot_s, commanded_in=mode)
    trial, request = request_reply(enter(trial, State.TAKEOFF, now_s), now_s)
    return trial, (PerformAction(Action.TAKE_OFF), *request)


def _unconfirmed_setting(trial: Trial) -> Finding | None:
    if not trial.suspects:
        return None
    why = f"{', '.join(sorted(trial.suspects))} was reported with another value, and no reply confirmed which holds."
    return Finding(failure=Failure.INTERRUPTED, why=why)


def _boot_s(watch: TrialObservation, last: Position, now_s: float) -> float:
    """Return the vehicle's own time of the takeoff command: that of its last sample, or later if that one had waited
    through a stall of this program."""
    offset_s = watch.least_offset_s
    return last.time_boot_s if offset_s is None else max(last.time_boot_s, now_s - offset_s - _WAITED_S)


def _not_armed(trial: Trial, event: Event) -> Finding | None:
    why = ""
    if trial.armed_s is not None and watching.is_disarmed(trial.watch, trial.plan.limits):
        why = "It disarmed itself."
    elif trial.armed_s is None:
        late = trial.arm_sent_s is not None and event.now_s - trial.arm_sent_s > ARMED_WITHIN_S
        why = "It did not report that it is armed." if late or event.now_s - trial.since_s > _ARMING_S else ""
    return Finding(failure=Failure.NOT_ARMED, why=why) if why else None


def _take_off(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if finding := _finding(trial, now_s):
        return fail(trial, finding, now_s)
    if watching.is_airborne(trial.watch, now_s, trial.plan.ground_m):
        return enter(trial, State.RECORD, now_s), ()
    if finding := limit_checks.find_altitude_behind(trial.watch):
        return fail(trial, finding, now_s)
    if isinstance(event, ActionRefused):
        refused = replace(trial, confirmed_boot_s=trial.commanded_boot_s)
        return fail(refused, Finding(failure=Failure.TAKE_OFF_REFUSED, why=event.why), now_s)
    if finding := _no_lift_off(trial, now_s):
        return fail(trial, finding, now_s)
    return trial, ()


def _no_lift_off(trial: Trial, now_s: float) -> Finding | None:
    watch, is_late = trial.watch, _waited_s(trial) > trial.plan.lift_off_s
    decides_soon = not watch.armed or watch.unchanged_s > _STUCK_S
    if not is_late or decides_soon or not watching.is_fresh(watch, now_s):
        return None
    if watching.is_said_to_fly(trial.watch, now_s, trial.plan.ground_m):
        why = "It reports that it flies, but its altitude stayed on the ground."
        return Finding(failure=Failure.LOST_POSITION, why=why)
    why = f"It was still on the ground {trial.plan.lift_off_s:g} s after the command."
    return Finding(failure=Failure.NO_LIFT_OFF, why=why)


def _waited_s(trial: Trial) -> float:
    """Return by the vehicle's own time how long it has stood since the command, or since it certainly had it."""
    last, since_s = trial.watch.last, trial.confirmed_boot_s or trial.commanded_boot_s
    return 0.0 if last is None or since_s is None else last.time_boot_s - since_s


def _record(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    if finding := _finding(trial, now_s):
        return fail(trial, finding, now_s)
    trial = _resting(trial, now_s)
    if _has_rested(trial, DOWN_S, now_s) and _is_armed_since(trial, trial.resting_since_s):
        stayed = watching.may_have_stayed(trial.watch, trial.plan.ground_m, trial.commanded_s or now_s)
        descended = Finding(failure=Failure.ENVELOPE, why="It descended to the ground by itself.")
        if finding := _no_lift_off(trial, now_s) if stayed else descended:
            return fail(trial, finding, now_s)
    if (changed := _change_set_point(trial, event)) is not None:
        return changed
    if not _is_whole(trial) or _may_be_by_hand(trial, now_s):
        return _overtime(trial, now_s)
    if finding := set_point_schedule.find_missing(trial):
        return fail(trial, finding, now_s)
    if watching.too_many_glitches(trial.watch):
        trial = note(trial, Finding(failure=Failure.GLITCHES, why=f"{trial.watch.glitches} samples were dropped."))
    lowest_m = min(trial.plan.set_points.altitudes_m) + trial.plan.datum_m
    sunken = limit_checks.find_sunken(trial.watch, lowest_m, trial.plan.ground_m)
    if finding := _unconfirmed_setting(trial) or sunken:
        trial = note(trial, finding)
    incomplete = limit_checks.find_incomplete_climb(trial.watch, trial.plan.climb_to_m)
    if trial.plan.climbs_from_ground and incomplete:
        trial = note(trial, incomplete)
    return land(trial, State.LAND, now_s)


def _withdraw(trial: Trial, now_s: float) -> Step:
    """Command no set point any more: a pilot may be flying, and would be overridden. Land once a heartbeat reports that
    nobody is."""
    if not trial.withdrawn:
        return replace(trial, withdrawn=True), (WithdrawSetPoint(),)
    if _is_by_hand(trial):
        return trial, ()
    why = "A heartbeat reported a manual mode, so that no further set point was commanded."
    return land(note(trial, Finding(failure=Failure.INTERRUPTED, why=why)), State.ABORT_LAND, now_s)


def _change_set_point(trial: Trial, event: Event) -> Step | None:
    """Command the next set point when it is due, and note its confirmation; None if there is nothing to do. A flight
    that does not count any more is ended instead."""
    now_s = event.now_s
    if trial.has_set_point and (trial.withdrawn or _is_by_hand(trial)):
        return _withdraw(trial, now_s)
    is_confirmed = isinstance(event, ActionDone) and event.action in _SET_POINT_ACTIONS
    if isinstance(event, ActionDone) and is_confirmed:
        trial = set_point_schedule.confirm(trial, event)
    if finding := _find_set_point_failure(trial, event):
        return fail(trial, finding, now_s)
    if not set_point_schedule.is_due(trial, now_s) or _may_be_by_hand(trial, now_s):
        return (trial, ()) if is_confirmed else None
    if trial.failure is not None:
        return land(trial, State.ABORT_LAND, now_s)
    finding = set_point_schedule.find_unsettled(trial)
    return set_point_schedule.command_next(trial) if finding is None else fail(trial, finding, now_s)


def _find_set_point_failure(trial: Trial, event: Event) -> Finding | None:
    """Find that a set point was refused or confirmed late, or that their stream paused."""
    match event:
        case ActionRefused(action=action, why=why) if action in _SET_POINT_ACTIONS:
            return Finding(failure=Failure.SET_POINT, why=why)
        case SetPointsPaused(paused_s=paused_s):
            why = f"Gainline stalled, and sent no set point for {paused_s:.1f} s."
            return Finding(failure=Failure.PAUSED, why=why)
        case ActionDone(action=action) if action in _SET_POINT_ACTIONS:
            return set_point_schedule.find_late(trial)
        case _ if _may_be_by_hand(trial, event.now_s):
            return None
        case _:
            return set_point_schedule.find_overdue(trial, event.now_s)


def _is_whole(trial: Trial) -> bool:
    last, start_s = trial.watch.last, trial.commanded_boot_s
    return last is not None and start_s is not None and last.time_boot_s - start_s >= trial.plan.record_s


def _overtime(trial: Trial, now_s: float) -> Step:
    """End by the ground's clock a record that the vehicle's clock does not end."""
    plan, last, start_s = trial.plan, trial.watch.last, trial.commanded_boot_s
    commanded_s = trial.commanded_s if trial.commanded_s is not None else now_s
    passed_s = now_s - commanded_s
    if passed_s <= plan.record_s + plan.slow_s or last is None or start_s is None:
        return trial, ()
    why = f"Its clock advanced by {last.time_boot_s - start_s:.1f} s in {passed_s:.1f} s."
    return fail(trial, Finding(failure=Failure.SLOW_CLOCK, why=why), now_s)


def _landing(trial: Trial, event: Event) -> Step:
    """Handle land and abort-land: send the remaining safe gains, repeat Land until it descends, await touchdown."""
    now_s = event.now_s
    if trial.awaited is not None:
        return send_gains(trial, event)
    if finding := (
        _taken_over(trial)
        or (_envelope(trial) if trial.gains_since_s is None else None)
        or (_changed(trial) if trial.state is State.LAND else None)
    ):
        return fail(trial, finding, now_s)
    trial = _doubting(_resting(trial, now_s))
    if _has_landed(trial, now_s):
        return _come_down(trial, now_s)
    if now_s - trial.since_s > LANDING_S:
        return quarantine(trial, f"It has not landed within {LANDING_S:g} s.", now_s)
    if _is_land_due(trial, now_s) and not _confirms_landing(trial, now_s):
        return replace(trial, repeated_s=now_s), (PerformAction(Action.LAND),)
    return trial, ()


def _is_land_due(trial: Trial, now_s: float) -> bool:
    every_s = land_every_s(now_s - trial.since_s, trial.plan.land_again_s)
    return now_s - trial.repeated_s >= every_s and not _may_be_by_hand(trial, now_s)


def _may_be_by_hand(trial: Trial, now_s: float) -> bool:
    """Whether the newest heartbeat shows a manual mode and is not overdue: Land would override the pilot."""
    return _is_by_hand(trial) and now_s - trial.watch.heartbeat_s < trial.plan.limits.confirmation_s


def _is_by_hand(trial: Trial) -> bool:
    """Whether the newest heartbeat shows a manual mode."""
    watch = trial.watch
    return bool(_modes(trial)) and watch.armed and trial.plan.limits.is_manual(watch.mode)


def _doubting(trial: Trial) -> Trial:
    """Note a finding that makes the vehicle's state uncertain while it lands for another reason."""
    finding = _changed(trial) if trial.commanded_s is not None else limit_checks.find_duplicate(trial.watch)
    return trial if finding is None else note(trial, finding)


def _come_down(trial: Trial, now_s: float) -> Step:
    """Stop the motors of a landed vehicle, unless its state or identity is uncertain. One that was last observed high
    may have fallen."""
    if trial.failure is not Failure.FALL and _changed(trial):
        return quarantine(trial, "", now_s)
    unseen_m = trial.plan.ground_m if trial.watch.unseen_m is None else trial.watch.unseen_m
    if unseen_m - trial.plan.ground_m > watching.DRIFT_M and not trial.doubt:
        trial = replace(trial, doubt="Its landing was not observed: it may have fallen.")
    return disarm(trial, now_s)


def _resting(trial: Trial, now_s: float) -> Trial:
    """Note since when it has been at rest: on the ground by every source, or, once its motors are off, near the ground
    by speed alone, because the altitude of some autopilots drifts. A single sample that jumps is ignored."""
    if trial.watch.doubted is not None and watching.is_fresh(trial.watch, now_s):
        return trial
    if not watching.is_disarmed(trial.watch, trial.plan.limits):
        rests = trial.watch.grounded_since_s is not None
    else:
        rests = watching.is_still(trial.watch, now_s, trial.plan.ground_m)
    since_s = trial.resting_since_s if trial.resting_since_s is not None else now_s
    return watching.with_changes(trial, resting_since_s=since_s if rests else None)


def _has_rested(trial: Trial, seconds: float, now_s: float) -> bool:
    return trial.resting_since_s is not None and now_s - trial.resting_since_s >= seconds


def _is_armed_since(trial: Trial, since_s: float | None) -> bool:
    """Whether a heartbeat since then has reported that its motors run: nobody else has stopped them."""
    return trial.watch.armed and since_s is not None and trial.watch.heartbeat_s >= since_s


def _has_landed(trial: Trial, now_s: float) -> bool:
    """Whether it has been at rest for 2 s, or has disarmed itself near the ground, as some do, by a fresh position."""
    is_high = watching.is_airborne(trial.watch, now_s, trial.plan.ground_m)
    near = watching.is_fresh(trial.watch, now_s) and not is_high
    disarmed = watching.is_disarmed(trial.watch, trial.plan.limits)
    return (_has_rested(trial, LANDED_S, now_s) and not find_doubt_of_descent(trial, now_s)) or (near and disarmed)


def _link_lost(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    trial = _doubting(trial)
    if finding := _taken_over(trial):
        return fail(trial, finding, now_s)
    is_received = isinstance(event, PacketReceived) and isinstance(event.measurement, Heartbeat)
    if is_received and not _may_be_by_hand(trial, now_s):
        return land(trial, State.ABORT_LAND, now_s)
    if now_s - trial.since_s > LINK_LOST_S:
        return quarantine(trial, f"The link stayed lost for {LINK_LOST_S:g} s.", now_s)
    if _is_land_due(trial, now_s):
        return replace(trial, repeated_s=now_s), (PerformAction(Action.LAND),)
    return trial, ()


def _disarming(trial: Trial, event: Event) -> Step:
    now_s = event.now_s
    trial = _answered(_doubting(trial), event)
    if _is_stopped(trial, event):
        confirmed = ("The vehicle confirmed that its motors have stopped.",) if trial.stopped else ()
        trial = replace(trial, remarks=(*trial.remarks, *confirmed), contact=find_contact(trial, now_s))
        return enter(trial, State.RESTORE, now_s), (RestoreGains(),)
    watch, plan = trial.watch, trial.plan
    stands = trial.commanded_s is None and watching.stands_by_own_account(watch, now_s, plan.ground_m, plan.limits)
    airborne = watch.armed and watching.is_airborne(watch, now_s, plan.ground_m)
    if airborne and not (stands or trial.stopped):
        why = "It was in the air when its motors were to be stopped."
        return abort(replace(trial, doubt=trial.doubt or why), now_s)
    if now_s - trial.since_s > DISARMED_WITHIN_S:
        return quarantine(trial, _why_not_stopped(trial, now_s), now_s)
    may_stop = trial.stopped or not find_doubt_of_ground(trial, now_s)
    if may_stop and now_s - trial.repeated_s >= REPEAT_S:
        action = Action.KILL if trial.stopped else Action.MOTORS_OFF
        return replace(trial, repeated_s=now_s), (PerformAction(action),)
    return trial, ()


def _why_not_stopped(trial: Trial, now_s: float) -> str:
    doubt = "" if trial.stopped else find_doubt_of_ground(trial, now_s)
    if doubt:
        return f"Its motors were not commanded to stop: {doubt}."
    return f"It has not confirmed within {DISARMED_WITHIN_S:g} s that its motors stopped."


def _answered(trial: Trial, event: Event) -> Trial:
    """Note a reply to the command to stop its motors, which together with one heartbeat confirms the stop. Before the
    takeoff command it may be the reply to arming, which some autopilots send for either."""
    if trial.commanded_s is None:
        return trial
    measurement = event.measurement if isinstance(event, PacketReceived) else None
    answered = confirms_motors_off(measurement, trial.plan.stop_settings) and trial.repeated_s >= trial.since_s
    return replace(trial, answered=trial.answered or answered)


def _is_stopped(trial: Trial, event: Event) -> bool:
    """Whether its motors have stopped, by two heartbeats, or by one and its reply to the command."""
    if not isinstance(event, PacketReceived) or not isinstance(event.measurement, Heartbeat) or event.measurement.armed:
        return False
    if trial.commanded_s is None:  # a heartbeat may have been under way since before it armed
        since_s = max(trial.watch.armed_since_s, trial.since_s)
        return event.now_s - since_s >= trial.plan.limits.confirmation_s
    return trial.answered or watching.is_disarmed(trial.watch, trial.plan.limits)


def _restoring(trial: Trial, event: Event) -> Step:
    if not isinstance(event, GainsRestored):
        return trial, ()
    if event.problem:
        return quarantine(trial, f"Its safe gains could not be verified. {event.problem}", event.now_s)
    if trial.doubt:
        return quarantine(trial, "", event.now_s)
    return enter(trial, State.IDLE, event.now_s), ()


_HANDLERS: Final[Mapping[State, Callable[[Trial, Event], Step]]] = {
    State.ARM: _arm,
    State.TAKEOFF: _take_off,
    State.RECORD: _record,
    State.LAND: _landing,
    State.ABORT_LAND: _landing,
    State.LINK_LOST: _link_lost,
    State.DISARM: _disarming,
    State.RESTORE: _restoring,
}
_STATES_WITH_TRIAL_GAINS: Final = frozenset({State.TAKEOFF, State.RECORD})
_FLOWN: Final = frozenset({State.TAKEOFF, State.RECORD, State.LAND, State.ABORT_LAND, State.LINK_LOST})
_UNTIL_STOPPED: Final = _FLOWN | {State.DISARM}
_RECORDED: Final = frozenset({State.ARM, State.TAKEOFF, State.RECORD, State.ABORT_LAND, State.LINK_LOST})


def _finding(trial: Trial, now_s: float) -> Finding | None:
    """Return the most severe failure between the command and the end of the record, if any."""
    plan, watch = trial.plan, trial.watch
    return (
        _taken_over(trial)
        or limit_checks.find_unexpected(watch, plan.limits, _modes(trial), _blocks(trial))
        or _noted(trial, Failure.UNEXPECTED, Failure.LOST_POSITION)
        or (limit_checks.find_interrupted_climb(watch, plan.limits, plan.climb_to_m) if _modes(trial) else None)
        or limit_checks.find_duplicate(watch)
        or limit_checks.find_link(watch, plan.limits, now_s)
        or limit_checks.find_jump(watch)
        or limit_checks.find_envelope(watch, plan.limits, ground_m=plan.ground_m, settling=True)
        or limit_checks.find_own_landing(watch, plan.limits, plan.ground_m, mode_known=bool(_modes(trial)))
        or limit_checks.find_frozen(watch, plan.limits, now_s)
        or limit_checks.find_lost_position(watch, plan.limits, now_s)
        or limit_checks.find_disagreement(watch.second)
        or limit_checks.find_battery(watch, now_s)
    )


def _noted(trial: Trial, *failures: Failure) -> Finding | None:
    """Return the trial's failure if it is one of these, which end the record."""
    return Finding(failure=trial.failure, why=trial.why) if trial.failure in failures else None


def _envelope(trial: Trial) -> Finding | None:
    return limit_checks.find_envelope(trial.watch, trial.plan.limits, ground_m=trial.plan.ground_m, settling=False)


def _taken_over(trial: Trial) -> Finding | None:
    """Whether a pilot has taken over, by heartbeats sent certainly after the command."""
    return limit_checks.find_taken_over(trial.watch, trial.plan.limits) if _modes(trial) else None


def _changed(trial: Trial) -> Finding | None:
    """Return an unexpected change of state during a landing, in which disarming is expected."""
    watch = watching.with_changes(trial.watch, armed=True)
    return limit_checks.find_duplicate(watch) or limit_checks.find_unexpected(
        watch, trial.plan.limits, _modes(trial), _blocks(trial)
    )


def _modes(trial: Trial) -> frozenset[str]:
    """Return the modes that the vehicle may be in. Any (empty) until a heartbeat sent certainly after the command, and
    while the vehicle stays in its previous mode, because it has not executed the command then."""
    limits, watch = trial.plan.limits, trial.watch
    if trial.commanded_s is not None:
        command_s = trial.commanded_s
        has_stayed = not watch.lifted and watch.mode_since_s <= command_s + _MODE_KNOWN_S
        has_stayed = has_stayed and watch.mode == trial.commanded_in
    elif trial.state is State.ABORT_LAND:
        command_s = trial.since_s
        has_stayed = watch.mode_since_s <= command_s
    else:
        return frozenset()
    if has_stayed or watch.heartbeat_s - command_s < _MODE_KNOWN_S:
        return frozenset()
    return _flying_modes(trial) | limits.landing_modes


def _flying_modes(trial: Trial) -> frozenset[str]:
    """Return the modes that it may fly in: those in which it follows set points only from the first on, and no others
    once it has confirmed that, until it is commanded to land."""
    plan = trial.plan
    if not (plan.holds_first and trial.has_set_point):
        return plan.limits.flying_modes
    if trial.changes and trial.state is State.RECORD:
        return plan.following_modes
    return plan.limits.flying_modes | plan.following_modes


def _blocks(trial: Trial) -> frozenset[str]:
    """Return the blocks of its flight plan that the vehicle may be in. At first it may still report the previous ones,
    and some plans return to them after the landing."""
    limits = trial.plan.limits
    allowed = limits.flying_blocks | limits.landing_blocks
    early = trial.commanded_s is None or trial.watch.block_s - trial.commanded_s < _MODE_KNOWN_S
    return allowed | limits.arming_blocks if early or trial.state not in _STATES_WITH_TRIAL_GAINS else allowed


def _confirms_landing(trial: Trial, now_s: float) -> bool:
    """Whether telemetry confirms that the vehicle is landing: it descends, or is near the ground."""
    last = trial.watch.last
    if last is None or not watching.is_fresh(trial.watch, now_s):
        return False
    limits = trial.plan.limits
    is_new = now_s - trial.watch.block_s < _LANDING_BLOCK_S
    lands = is_new and trial.watch.block in limits.landing_blocks  # another Land would begin its landing again
    lands = lands or watching.mode_of(trial.watch, limits) in limits.landing_modes - limits.flying_modes
    near = not watching.is_airborne(trial.watch, now_s, trial.plan.ground_m)
    return (near and (lands or not find_doubt_of_descent(trial, now_s))) or last.climb_rate_m_s < DESCENDING_M_S
