"""Findings of a trial from the takeoff command on, the most severe one first, and the transitions between its states
with their commands, as pure functions of a trial and the time. `trial_phases` decides when each is made.
"""

import statistics
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Final

from app.autopilots.commands import Action
from app.autopilots.measurements import Parameter
from app.vehicles.flight_end import Landing, StopRequest, request_text
from app.vehicles.mavlink.events import Event, PacketReceived, PerformAction, SendGain
from app.vehicles.mavlink.failures import GROUND_M, RESPONSES, Failure, Finding, Reaction
from app.vehicles.mavlink.trial_state import (
    STATES_WITH_TRIAL_GAINS,
    TRANSITIONS,
    SafeGainsSent,
    State,
    Step,
    Trial,
)

MODE_KNOWN_S: Final = 1.0
"""Time after a command in which heartbeats may still show the mode and block of before."""
GAIN_S: Final = 0.1
GAINS_S: Final = 0.3
_IN_PLACE_M: Final = 0.3
_SHIFT_M: Final = 0.3
"""Greatest shift of the altitude on the ground as the motors start, unless the autopilot resets it then."""
_STANDS_S: Final = 0.1
"""A vehicle that has stood on the ground since this long after the takeoff command had not left it before."""
_CLIMBED_M: Final = 0.1
"""A vehicle that has climbed by less than this, by its climb rate, has not moved."""


def find_in_flight(trial: Trial, now_s: float) -> Finding | None:
    """Return the most severe failure between the command and the end of the record, if any."""
    watch, plan, modes = trial.watch, trial.plan, allowed_modes(trial)
    return (
        (watch.modes.find_taken_over(plan) if modes else None)
        or watch.identity.find_reboot()
        or watch.modes.find_disarming()
        or watch.modes.find_unexpected(plan, modes, _allowed_blocks(trial))
        or find_noted(trial, Failure.UNEXPECTED, Failure.LOST_POSITION)
        or (watch.climb.find_interrupted(watch.modes.agreed, plan) if modes else None)
        or watch.identity.find_duplicate()
        or watch.link.find(plan, watch.modes.heartbeat_s, now_s)
        or watch.positions.find_jump()
        or watch.envelope.find(plan, watch.last, settling=True)
        or watch.modes.find_own_landing(plan, watch.last, mode_known=bool(modes))
        or watch.find_frozen(plan, now_s)
        or watch.find_lost_position(plan, now_s)
        or watch.second.find_disagreement()
        or watch.battery.find(now_s)
    )


def find_noted(trial: Trial, *failures: Failure) -> Finding | None:
    """Return the trial's failure if it is one of these, which end the record."""
    return Finding(trial.failure, trial.why) if trial.failure in failures else None


def find_taken_over(trial: Trial) -> Finding | None:
    """Whether a pilot has taken over, by heartbeats sent certainly after the command."""
    return trial.watch.modes.find_taken_over(trial.plan) if allowed_modes(trial) else None


def find_change(trial: Trial) -> Finding | None:
    """Return an unexpected change of state during a landing, in which disarming is expected."""
    watch = trial.watch
    return (
        watch.identity.find_duplicate()
        or watch.identity.find_reboot()
        or watch.modes.find_unexpected(trial.plan, allowed_modes(trial), _allowed_blocks(trial))
    )


def is_by_hand(trial: Trial) -> bool:
    """Whether the newest heartbeat shows a manual mode."""
    modes = trial.watch.modes
    return modes.armed and trial.plan.is_manual(modes.mode) and bool(allowed_modes(trial))


def may_be_by_hand(trial: Trial, now_s: float) -> bool:
    """Whether the newest heartbeat shows a manual mode and is not overdue: Land would override the pilot."""
    return is_by_hand(trial) and now_s - trial.watch.modes.heartbeat_s < trial.plan.confirmation_s


def allowed_modes(trial: Trial) -> frozenset[str]:
    """Return the modes that the vehicle may be in. Any (empty) until a heartbeat sent certainly after the command, and
    while the vehicle stays in its previous mode, because it has not executed the command then."""
    seen = trial.watch.modes
    if trial.takeoff is not None:
        command_s = trial.takeoff.at_s
        has_stayed = not trial.watch.climb.lifted and seen.mode_since_s <= command_s + MODE_KNOWN_S
        has_stayed = has_stayed and seen.mode == trial.takeoff.mode
    elif trial.state is State.ABORT_LAND:
        command_s = trial.since_s
        has_stayed = seen.mode_since_s <= command_s
    else:
        return frozenset()
    if has_stayed or seen.heartbeat_s - command_s < MODE_KNOWN_S:
        return frozenset()
    return _flying_modes(trial) | trial.plan.autopilot.landing_modes


def _flying_modes(trial: Trial) -> frozenset[str]:
    """Return the modes that it may fly in: those in which it follows set points only from the first on, and no others
    once it has confirmed that, until it is commanded to land."""
    autopilot = trial.plan.autopilot
    if not (trial.plan.holds_first and trial.set_points.has_begun):
        return autopilot.flying_modes
    if trial.set_points.changes and trial.state is State.RECORD:
        return autopilot.following_modes
    return autopilot.flying_modes | autopilot.following_modes


def _allowed_blocks(trial: Trial) -> frozenset[str]:
    """Return the blocks of its flight plan that the vehicle may be in. At first it may still report the previous ones,
    and some plans return to them after the landing."""
    autopilot = trial.plan.autopilot
    allowed = autopilot.flying_blocks | autopilot.landing_blocks
    early = trial.takeoff is None or trial.watch.modes.block_s - trial.takeoff.at_s < MODE_KNOWN_S
    return allowed | autopilot.arming_blocks if early or trial.state not in STATES_WITH_TRIAL_GAINS else allowed


def measure_ground(trial: Trial, now_s: float) -> Trial:
    """Return the trial with the ground where the vehicle stands now, because its altitude shifts as its motors start,
    and is reset by an autopilot that counts from the ground. If it may have moved, the ground is unchanged."""
    watch, plan, samples = trial.watch, trial.plan, trial.ground_samples
    stood = samples[len(samples) // 2 :]
    if not stood or watch.positions.doubted or watch.is_said_to_fly(now_s, plan.ground_m):
        return trial
    altitudes_m = [position.altitude_m for position in stood]
    is_still = max(altitudes_m) - min(altitudes_m) <= GROUND_M
    is_in_place = stood[-1].away_m(watch.envelope.origin) <= _IN_PLACE_M
    shift_m = statistics.median(altitudes_m) - plan.ground_m
    may_shift = plan.autopilot.climbs_from_ground or abs(shift_m) <= _SHIFT_M
    climbed_m = sum(
        after.climb_rate_m_s * (after.time_boot_s - before.time_boot_s) for before, after in pairwise(samples)
    )
    if not (is_still and is_in_place and may_shift and abs(climbed_m) <= _CLIMBED_M):
        return trial
    return replace(
        trial,
        plan=plan.on_ground_at(plan.ground_m + shift_m),
        watch=watch.reset_altitude(),
        ground_shift_m=shift_m,
        ground_samples=(),
    )


def fail(trial: Trial, finding: Finding, now_s: float) -> Step:
    """Make the transition for a failure, from a state in which the vehicle can be commanded."""
    trial = note(trial, finding)
    reaction = RESPONSES[finding.failure].reaction
    if trial.state is State.ARM:
        return disarm(trial, now_s) if finding.failure is not Failure.DUPLICATE else abort_landing(trial, now_s)
    if reaction == "cease":
        return quarantine(trial, finding.why, now_s)
    if trial.state in (State.ABORT_LAND, State.LINK_LOST):
        is_suspect = reaction == "land, gains first" and trial.safe_gains is None
        return abort_with_safe_gains(trial, now_s) if is_suspect else (trial, ())
    return _REACTIONS[reaction](trial, now_s)


def _give_up_take_off(trial: Trial, now_s: float) -> Step:
    """Stop the motors of a vehicle that has received the command and is on the ground by every source; otherwise abort,
    because it may yet lift off, or has, with its integrator wound up. One that reports its landing by a block of its
    flight plan always lands."""
    stands = trial.watch.ground.grounded_since_s is not None and not find_doubt_of_descent(trial, now_s)
    return disarm(trial, now_s) if stands else abort(trial, now_s)


def note(trial: Trial, finding: Finding | None) -> Trial:
    """Note a failure, if there is one: the first is the trial's; one that calls for quarantine is also kept as
    `doubt`."""
    if finding is None:
        return trial
    if RESPONSES[finding.failure].outcome == "quarantine" and not trial.doubt:
        trial = replace(trial, doubt=finding.why)
    if trial.failure is not None:
        return trial
    remarks = (finding.why,) if finding.why else ()
    return replace(trial, failure=finding.failure, request=finding.request, remarks=remarks)


def note_cause(trial: Trial, finding: Finding | None) -> Trial:
    """Note a failure that explains why a limit was exceeded, if there is one: that does not count against the gains."""
    is_explained = finding is not None and trial.failure is Failure.ENVELOPE
    return note(replace(trial, failure=None) if is_explained else trial, finding)


def enter(trial: Trial, state: State, now_s: float) -> Trial:
    if state not in TRANSITIONS[trial.state]:
        raise AssertionError(f"A trial cannot go from {trial.state} to {state}.")
    return replace(trial, state=state, since_s=now_s, resting_since_s=None)


def abort(trial: Trial, now_s: float) -> Step:
    return abort_with_safe_gains(enter(trial, State.ABORT_LAND, now_s), now_s)


def abort_with_safe_gains(trial: Trial, now_s: float) -> Step:
    """Send the first safe gain at once; the others follow, and then Land."""
    first, *others = trial.plan.safe_gains
    sent = SafeGainsSent(since_s=now_s, sent_s=now_s, awaited=first, unsent=tuple(others))
    return replace(trial, safe_gains=sent), (SendGain(first),)


def abort_landing(trial: Trial, now_s: float) -> Step:
    """Abort by Land alone, with the gains as they are."""
    return land(trial, State.ABORT_LAND, now_s)


def land(trial: Trial, state: State, now_s: float) -> Step:
    """Command Land and enter `state`, which repeats it."""
    return replace(enter(trial, state, now_s), repeated_s=now_s), (PerformAction(Action.LAND),)


def disarm(trial: Trial, now_s: float) -> Step:
    """Enter disarm; stop the motors now if every source has shown the vehicle on the ground for a second, or later."""
    trial = replace(enter(trial, State.DISARM, now_s), answered=False)
    if find_doubt_of_ground(trial, now_s):
        return trial, ()
    return replace(trial, repeated_s=now_s), (PerformAction(Action.MOTORS_OFF),)


def find_doubt_of_ground(trial: Trial, now_s: float) -> str:
    """Return why its motors may not be stopped without a request of a person; empty if they may."""
    return find_doubt_of_descent(trial, now_s) or trial.watch.find_doubt_of_ground(now_s)


def find_doubt_of_descent(trial: Trial, now_s: float) -> str:
    """Return why a position on the ground does not show that the vehicle stayed or came down there: it may yet take
    off; it does not report a landing although it can; or it cannot, and was not observed climbing or descending."""
    watch, landed_blocks = trial.watch, trial.plan.autopilot.landed_blocks
    if trial.may_take_off:
        return "it has not replied since the takeoff command, which may still be under way"
    if trial.takeoff is None:
        return ""
    if landed_blocks or watch.ground.landed is not None:
        has_landed = watch.modes.block in landed_blocks if landed_blocks else watch.ground.reports(now_s, landed=True)
        return "" if has_landed else "it has not reported a landing, and an altitude may drift"
    return "" if watch.climb.lifted and watch.climb.unseen_m is None else "its descent was not observed"


def stop_motors(trial: Trial, request: StopRequest, now_s: float) -> Step:
    """Stop the motors at once, at any height; disarm repeats the command. A trial that has not failed is aborted, and a
    vehicle that may have fallen is quarantined at its end."""
    if trial.stopped:
        return trial, ()
    drop = _find_drop(trial, now_s)
    if trial.failure is None:
        trial = note(trial, Finding(Failure.OPERATOR, request=request))
    else:
        trial = replace(trial, remarks=(*trial.remarks, request_text(request)))
    doubt, contact = trial.doubt or drop, Landing.FELL if drop else trial.contact
    trial = replace(trial, doubt=doubt, contact=contact, stopped=True, answered=False)
    if trial.safe_gains is not None:
        trial = replace(trial, safe_gains=replace(trial.safe_gains, awaited=None, unsent=()))
    if trial.state not in (State.DISARM, State.RESTORE):
        trial = enter(trial, State.DISARM, now_s)
    return replace(trial, repeated_s=now_s), (PerformAction(Action.KILL),)


def _find_drop(trial: Trial, now_s: float) -> str:
    """Return why a vehicle whose motors are stopped now may have fallen; empty if every source shows it on the ground,
    or it has not been commanded to take off and nothing shows that it moved."""
    watch, ground_m = trial.watch, trial.plan.ground_m
    stands = watch.stands_by_own_account(now_s, trial.plan)
    is_arming = trial.state is State.ARM and not watch.is_said_to_fly(now_s, ground_m)
    if trial.takeoff is None and (stands or is_arming):
        return ""
    if watch.positions.is_airborne(now_s, ground_m):
        height_m = watch.positions.height_m(ground_m)
        return f"The vehicle was {height_m:.1f} m above the ground: inspect it before it flies again."
    if watch.positions.is_grounded(now_s, ground_m) and not watch.is_said_to_fly(now_s, ground_m):
        return ""
    return "The vehicle was not known to be on the ground: inspect it before it flies again."


def find_contact(trial: Trial, now_s: float) -> Landing:
    """Return the contact with the ground of a vehicle whose motors have stopped now."""
    if trial.contact is Landing.FELL:
        return Landing.FELL
    return Landing.STAYED if _has_stayed_down(trial, now_s) else Landing.LANDED


def _has_stayed_down(trial: Trial, now_s: float) -> bool:
    """Whether it has certainly not left the ground: it was not commanded to take off, or it refused to, and every
    source has shown it at rest on the ground from then on, without a gap and without a sample in doubt. A vehicle that
    took the command may rise before any message shows it, and its altitude may stand still."""
    watch = trial.watch
    if trial.takeoff is None:
        return not watch.climb.lifted
    if trial.failure is not Failure.TAKE_OFF_REFUSED:
        return False
    since_s = watch.ground.grounded_since_s
    stood = since_s is not None and since_s <= trial.takeoff.at_s + _STANDS_S
    return stood and not (trial.doubt or watch.positions.glitches or find_doubt_of_ground(trial, now_s))


def quarantine(trial: Trial, why: str, now_s: float) -> Step:
    remarks = tuple(dict.fromkeys(filter(None, (*trial.remarks, trial.doubt, why))))
    return replace(enter(trial, State.QUARANTINE, now_s), remarks=remarks), ()


def send_gains(trial: Trial, sent: SafeGainsSent, event: Event) -> Step:
    """Send the next safe gain once the last was echoed or 0.1 s have passed, and Land after 0.3 s at the latest."""
    now_s = event.now_s
    measurement = event.measurement if isinstance(event, PacketReceived) else None
    echoed = isinstance(measurement, Parameter) and sent.awaited and measurement.name == sent.awaited.parameter
    late = now_s - sent.since_s >= GAINS_S
    if not late and not echoed and now_s - sent.sent_s < GAIN_S:
        return trial, ()
    if sent.unsent and not late:
        following, *others = sent.unsent
        sent = replace(sent, awaited=following, unsent=tuple(others), sent_s=now_s)
        return replace(trial, safe_gains=sent), (SendGain(following),)
    rest = tuple(SendGain(setting) for setting in sent.unsent)
    trial = replace(trial, safe_gains=replace(sent, awaited=None, unsent=()), repeated_s=now_s)
    return trial, (*rest, PerformAction(Action.LAND))


_REACTIONS: Final[Mapping[Reaction, Callable[[Trial, float], Step]]] = {
    "land, gains first": abort,
    "land": abort_landing,
    "repeat land": lambda trial, now_s: land(trial, State.LINK_LOST, now_s),
    "disarm": _give_up_take_off,
}
"""Transition for each reaction of `RESPONSES`, for a vehicle that has been commanded to take off."""
