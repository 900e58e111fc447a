"""One trial from arming to the safe gains read back, as a pure reducer: (trial, event) → (trial, commands).

It depends on no autopilot and no clock: events carry their time, and commands are data that `trial.py` carries out.
"""

from dataclasses import replace
from typing import Final

from app.autopilots.commands import Action
from app.autopilots.measurements import Measurement, Parameter
from app.vehicles.flight_end import Landing
from app.vehicles.mavlink import set_point_schedule
from app.vehicles.mavlink.events import (
    Command,
    DuplicateVehicleDetected,
    Event,
    PacketReceived,
    PerformAction,
    RecordSample,
    RequestGain,
    SecondaryAltitudeReceived,
    StopRequested,
)
from app.vehicles.mavlink.failures import DRIFT_M, REPEAT_S, Failure, Finding
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.trial_phases import HANDLERS
from app.vehicles.mavlink.trial_reactions import allowed_modes, fail, measure_ground, note, note_cause, stop_motors
from app.vehicles.mavlink.trial_state import COMMANDED, STATES_WITH_TRIAL_GAINS, State, Step, Trial

_REPLY_S: Final = 0.5
"""Interval at which a reply after the takeoff command is requested."""
_OTHER_M: Final = 1.0
"""After a greater jump of the altitude, another vehicle may be answering."""
_STOPPED_WITHIN_S: Final = 0.6
"""A vehicle whose heartbeats report its motors off within this time of its fall fell because they were stopped; one
that detects its landing takes longer."""
_FLOWN: Final = STATES_WITH_TRIAL_GAINS | {State.LAND, State.ABORT_LAND, State.LINK_LOST}
_UNTIL_STOPPED: Final = _FLOWN | {State.DISARM}
_RECORDED: Final = STATES_WITH_TRIAL_GAINS | {State.ARM, State.ABORT_LAND, State.LINK_LOST}


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
        sample = replace(event, altitude_m=event.altitude_m + trial.ground_shift_m)
        trial = replace(trial, watch=trial.watch.update_secondary(sample))
    elif isinstance(event, DuplicateVehicleDetected):
        trial = replace(trial, watch=trial.watch.note_duplicate(event.why))
    settled = trial.watch.settle(event.now_s, trial.plan, commanded=trial.takeoff is not None)
    trial = trial if settled is trial.watch else replace(trial, watch=settled)
    trial, requests = _confirm_take_off(trial, event)
    trial, polls = _poll_settings(trial, event.now_s)
    trial = _with_drift(_with_jump(_with_disarming(_with_fall(trial, event.now_s))), event.now_s)
    trial, commands = _react(trial, event)
    return trial, (*kept, *requests, *polls, *commands)


def _poll_settings(trial: Trial, now_s: float) -> Step:
    """Request the mode of a vehicle whose heartbeats do not distinguish all modes, and settings in doubt."""
    mode = trial.plan.autopilot.mode_parameter
    names = trial.settings.suspects if mode is None else trial.settings.suspects | {mode.name}
    if not names or trial.state not in STATES_WITH_TRIAL_GAINS or now_s - trial.settings.polled_s < REPEAT_S:
        return trial, ()
    return replace(trial, settings=replace(trial.settings, polled_s=now_s)), tuple(
        RequestGain(name) for name in sorted(names)
    )


def _confirm_take_off(trial: Trial, event: Event) -> Step:
    """Note the first reply to a message sent after the takeoff command, and request one until then."""
    takeoff = trial.takeoff
    if takeoff is None or not trial.may_take_off:
        return trial, ()
    measurement = event.measurement if isinstance(event, PacketReceived) else None
    asked = trial.plan.safe_gains[0].parameter
    if isinstance(measurement, Parameter) and measurement.name == asked:
        takeoff = replace(takeoff, confirmed_boot_s=trial.watch.last.time_boot_s)
        return replace(trial, takeoff=takeoff, resting_since_s=None), ()
    if event.now_s - takeoff.requested_s < _REPLY_S:
        return trial, ()
    return replace(trial, takeoff=replace(takeoff, requested_s=event.now_s)), (RequestGain(asked),)


def _process_packet(trial: Trial, event: PacketReceived) -> Step:
    watch, positions = trial.watch.update(event.measurement, event.now_s, trial.plan)
    trial = _with_disarmed_height(trial, watch, event.now_s)
    trial, requests = _check_settings(replace(_with_interruption(trial, watch), watch=watch), event.measurement)
    if trial.armed_s is None or trial.state not in _RECORDED or watch.identity.rebooted:
        return trial, requests
    if trial.state is State.ARM:
        trial = replace(trial, ground_samples=(*trial.ground_samples, *positions))
    elif trial.state is State.RECORD:
        trial = set_point_schedule.note_settling(trial, positions)
        trial = _with_target(trial, event) if trial.plan.holds_first else trial
    to_m = trial.plan.ground_m if trial.state not in STATES_WITH_TRIAL_GAINS else trial.plan.set_point_m
    samples = (RecordSample(each, to_m, watch.battery.voltage_v, watch.second.altitude_m) for each in positions)
    return trial, (*requests, *samples)


def _check_settings(trial: Trial, measurement: Measurement | None) -> Step:
    """Note a gain, or the mode, that the vehicle reports with another value than it must hold, and request it if it did
    so for the first time."""
    if not isinstance(measurement, Parameter) or trial.state not in {State.ARM, *STATES_WITH_TRIAL_GAINS}:
        return trial, ()
    settings, finding = trial.settings.update(measurement, trial.plan)
    is_new = len(settings.suspects) > len(trial.settings.suspects)
    return note(replace(trial, settings=settings), finding), (RequestGain(measurement.name),) if is_new else ()


def _with_target(trial: Trial, event: PacketReceived) -> Trial:
    """Note that the vehicle follows another set point than it was commanded to."""
    set_points, finding = trial.set_points.update(event.measurement, event.now_s, trial.plan)
    trial = trial if set_points is trial.set_points else replace(trial, set_points=set_points)
    return note(trial, finding)


def _with_disarmed_height(trial: Trial, watch: TrialObservation, now_s: float) -> Trial:
    """Note the height of a vehicle in the air whose heartbeats begin to report that its motors are off."""
    if watch.modes.armed == trial.watch.modes.armed or trial.state not in _FLOWN:
        return trial
    is_up = watch.positions.is_fresh(now_s) and not watch.ground.reports(now_s, landed=True)
    height_m = watch.positions.height_m(trial.plan.ground_m) if is_up and not watch.modes.armed else 0.0
    return replace(trial, disarmed_m=height_m)


def _with_interruption(trial: Trial, watch: TrialObservation) -> Trial:
    """Note a manual mode that only one heartbeat reported."""
    is_unchanged = watch.modes is trial.watch.modes
    if is_unchanged or trial.state not in STATES_WITH_TRIAL_GAINS or not allowed_modes(trial):
        return trial
    return note(trial, watch.modes.find_interruption(trial.watch.modes, trial.plan))


def _with_fall(trial: Trial, now_s: float) -> Trial:
    """Note a fall in any state, unless a person has requested motors off."""
    if trial.stopped or trial.takeoff is None or trial.fell_s is not None:
        return trial
    fall = trial.watch.positions.find_fall(trial.plan.ground_m)
    return trial if fall is None else replace(note(trial, fall), contact=Landing.FELL, fell_s=now_s)


def _with_disarming(trial: Trial) -> Trial:
    """Note that somebody else, or the vehicle itself, stopped its motors in the air: it exceeded its limits because it
    fell."""
    modes = trial.watch.modes
    if trial.stopped or trial.state not in _UNTIL_STOPPED or not modes.is_disarmed:
        return trial
    fell = trial.fell_s is not None and modes.armed_since_s - trial.fell_s <= _STOPPED_WITHIN_S
    if not fell and trial.disarmed_m <= DRIFT_M:
        return trial
    return note_cause(trial, Finding(Failure.UNEXPECTED, "Its motors were stopped in the air."))


def _with_drift(trial: Trial, now_s: float) -> Trial:
    """Note an altitude that has drifted, so that limits may have been exceeded by it alone, or that contradicts the
    landed state. In a fall it lags."""
    is_up = trial.takeoff is not None and trial.state in _UNTIL_STOPPED
    if trial.stopped or not is_up or trial.fell_s is not None:
        return trial
    watch, plan = trial.watch, trial.plan
    is_told_to_land = trial.state not in STATES_WITH_TRIAL_GAINS
    has_landed = is_told_to_land and watch.has_reported_landing(now_s, plan)
    trial = note_cause(trial, watch.positions.find_drift(now_s, plan.ground_m, has_landed=has_landed))
    return note(trial, watch.ground.find_contradiction(now_s))


def _with_jump(trial: Trial) -> Trial:
    """Note in any state a jump after which the vehicle's identity is uncertain. An earlier failure of its limits may
    have been one of false positions."""
    if trial.takeoff is None or trial.doubt or trial.watch.positions.jumped_m <= _OTHER_M:
        return trial
    failure = Failure.LOST_POSITION if trial.failure is Failure.ENVELOPE else trial.failure
    return replace(trial, failure=failure, doubt=f"Its altitude jumped by {trial.watch.positions.jumped_m:.1f} m.")


def _react(trial: Trial, event: Event) -> Step:
    if isinstance(event, StopRequested) and event.request.motors_off:
        return stop_motors(trial, event.request, event.now_s)
    if isinstance(event, StopRequested) and trial.state in COMMANDED:
        trial = measure_ground(trial, event.now_s) if trial.state is State.ARM else trial
        return fail(trial, Finding(Failure.OPERATOR, request=event.request), event.now_s)
    return HANDLERS[trial.state](trial, event)
