"""Transitions between the states of a trial with their commands, as pure functions of a trial and the time.
`trial_phases` decides when each is made.
"""

import statistics
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Final

from app.autopilots.commands import Action
from app.autopilots.measurements import Parameter, Position
from app.vehicles.end_texts import request_text
from app.vehicles.flight_end import Landing, StopRequest
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.events import Event, PacketReceived, PerformAction, SendGain
from app.vehicles.mavlink.failures import GAIN_FAILURES, GROUND_M, RESPONSES, Failure, Finding, Reaction
from app.vehicles.mavlink.plan import replace
from app.vehicles.mavlink.trial_state import TRANSITIONS, SafeGainsSent, State, Step, Trial

GAIN_S: Final = 0.1
GAINS_S: Final = 0.3
_IN_PLACE_M: Final = 0.3
_SHIFT_M: Final = 0.3
"""Greatest shift of the altitude on the ground as the motors start, unless the autopilot resets it then."""
_STANDS_S: Final = 0.1
"""A vehicle that has stood on the ground since this long after the takeoff command had not left it before."""
_CLIMBED_M: Final = 0.1
"""A vehicle that has climbed by less than this, by its climb rate, has not moved."""


def measure_ground(trial: Trial, now_s: float) -> Trial:
    """Return the trial with the ground where the vehicle stands now, because its altitude shifts as its motors start,
    and is reset by an autopilot that counts from the ground. If it may have moved, the ground is unchanged."""
    watch, plan, samples = trial.watch, trial.plan, trial.ground_samples
    stood = samples[len(samples) // 2 :]
    if not stood or watch.positions.doubted or watching.is_said_to_fly(watch, now_s, plan.ground_m):
        return trial
    altitudes_m = [position.altitude_m for position in stood]
    is_still = max(altitudes_m) - min(altitudes_m) <= GROUND_M
    is_in_place = stood[-1].away_m(watch.envelope.origin or stood[-1]) <= _IN_PLACE_M
    shift_m = statistics.median(altitudes_m) - plan.ground_m
    may_shift = plan.autopilot.climbs_from_ground or abs(shift_m) <= _SHIFT_M
    if not (is_still and is_in_place and may_shift and abs(_climbed_m(samples)) <= _CLIMBED_M):
        return trial
    return replace(
        trial,
        plan=plan.on_ground_at(plan.ground_m + shift_m),
        watch=watching.reset_altitude(watch),
        ground_shift_m=shift_m,
        ground_samples=(),
    )


def _climbed_m(samples: Sequence[Position]) -> float:
    """Return the climb by climb rate alone, m."""
    return sum(later.climb_rate_m_s * (later.time_boot_s - earlier.time_boot_s) for earlier, later in pairwise(samples))


def fail(trial: Trial, finding: Finding, now_s: float) -> Step:
    """Make the transition for a failure, from a state in which the vehicle can be commanded."""
    trial = note(trial, finding)
    if trial.state is State.ARM:
        return disarm(trial, now_s) if finding.failure is not Failure.DUPLICATE else _abort_landing(trial, now_s)
    reaction = RESPONSES[finding.failure].reaction
    if reaction == "cease":
        return quarantine(trial, finding.why, now_s)
    if trial.state in (State.ABORT_LAND, State.LINK_LOST):
        return (
            abort_with_safe_gains(trial, now_s)
            if finding.failure in GAIN_FAILURES and trial.safe_gains is None
            else (trial, ())
        )
    return _REACTIONS[reaction](trial, now_s)


def _give_up_take_off(trial: Trial, now_s: float) -> Step:
    """Stop the motors of a vehicle that has received the command and is on the ground by every source; otherwise abort,
    because it may yet lift off, or has, with its integrator wound up. One that reports its landing by a block of its
    flight plan always lands."""
    stands = trial.watch.ground.grounded_since_s is not None and not find_doubt_of_descent(trial, now_s)
    return disarm(trial, now_s) if stands else abort(trial, now_s)


def _abort_landing(trial: Trial, now_s: float) -> Step:
    return land(trial, State.ABORT_LAND, now_s)


def note(trial: Trial, finding: Finding) -> Trial:
    """Note a failure: the first one is the trial's; one that calls for quarantine is also kept as `doubt`."""
    if RESPONSES[finding.failure].outcome == "quarantine" and not trial.doubt:
        trial = replace(trial, doubt=finding.why)
    if trial.failure is not None:
        return trial
    remarks = (finding.why,) if finding.why else ()
    return replace(trial, failure=finding.failure, request=finding.request, remarks=remarks)


def note_cause(trial: Trial, finding: Finding) -> Trial:
    """Note a failure that explains why a limit was exceeded: that does not count against the gains."""
    return note(replace(trial, failure=None) if trial.failure is Failure.ENVELOPE else trial, finding)


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
    return find_doubt_of_descent(trial, now_s) or watching.find_doubt_of_ground(trial.watch, now_s)


def find_doubt_of_descent(trial: Trial, now_s: float) -> str:
    """Return why a position on the ground does not show that the vehicle stayed or came down there: it may yet take
    off; it does not report a landing although it can; or it cannot, and was not observed climbing or descending."""
    watch, landed_blocks = trial.watch, trial.plan.autopilot.landed_blocks
    if trial.may_take_off:
        return "it has not replied since the takeoff command, which may still be under way"
    if trial.takeoff is None:
        return ""
    if landed_blocks or watch.ground.landed is not None:
        has_landed = watch.modes.block in landed_blocks if landed_blocks else watch.ground.reports_landing(now_s)
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
    stands = watching.stands_by_own_account(watch, now_s, trial.plan)
    is_arming = trial.state is State.ARM and not watching.is_said_to_fly(watch, now_s, ground_m)
    if trial.takeoff is None and (stands or is_arming):
        return ""
    if watch.positions.is_airborne(now_s, ground_m):
        height_m = watch.positions.height_m(ground_m)
        return f"The vehicle was {height_m:.1f} m above the ground: inspect it before it flies again."
    if watch.positions.is_grounded(now_s, ground_m) and not watching.is_said_to_fly(watch, now_s, ground_m):
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
    "land": _abort_landing,
    "repeat land": lambda trial, now_s: land(trial, State.LINK_LOST, now_s),
    "disarm": _give_up_take_off,
}
"""Transition for each reaction of `RESPONSES`, for a vehicle that has been commanded to take off."""
