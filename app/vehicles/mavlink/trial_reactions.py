"""States of one trial on a MAVLink vehicle, and the transitions between them with their commands, as pure functions of
a trial and the time. `trial_machine` decides when each transition is made.
"""

import dataclasses
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Final

from app.core.experiments.takeoff import SET_POINTS, WINDOW_S
from app.core.models.set_points import SetPoints
from app.vehicles.base import RECORDED_BEYOND_S
from app.vehicles.end_texts import joined, request_text
from app.vehicles.flight_end import Landing, StopRequest
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.events import (
    Action,
    Command,
    Event,
    ModeParameter,
    PacketReceived,
    Parameter,
    PerformAction,
    Position,
    RequestGain,
    SendGain,
    Setting,
)
from app.vehicles.mavlink.failures import (
    GAIN_FAILURES,
    GROUND_M,
    RESPONSES,
    Failure,
    Finding,
    Limits,
    Outcome,
    Reaction,
)
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.states import replace


class State(StrEnum):
    """States of one trial, from the first heartbeat to the safe gains read back.

        connect → preflight → set gains → arm → take-off → record → land ──→ disarm → restore → idle
           ↓                               │       │          ├──→ abort-land ─↗↘
        observing                          │       │          └──→ link lost ──→ quarantined
                                           └───────┴──→ disarm

    A failure before arming leads back to idle. From arm on, every trial ends through disarm and restore, or in
    quarantine, which only a person can end. Stopping the motors leads to disarm from every state. A vehicle that is
    armed on connection, or was armed by somebody else, is only observed.
    """

    IDLE = "idle"
    CONNECT = "connect"
    PREFLIGHT = "preflight"
    SET_GAINS = "set gains"
    ARM = "arm"
    TAKEOFF = "take-off"
    RECORD = "record"
    LAND = "land"
    ABORT_LAND = "abort-land"
    LINK_LOST = "link lost"
    DISARM = "disarm"
    RESTORE = "restore"
    QUARANTINE = "quarantined"
    OBSERVE = "observing"


TRANSITIONS: Final[Mapping[State, frozenset[State]]] = {
    State.IDLE: frozenset({State.CONNECT, State.SET_GAINS, State.OBSERVE}),
    State.CONNECT: frozenset({State.PREFLIGHT, State.IDLE, State.OBSERVE}),
    State.PREFLIGHT: frozenset({State.SET_GAINS, State.IDLE, State.QUARANTINE, State.OBSERVE}),
    State.SET_GAINS: frozenset({State.ARM, State.IDLE, State.QUARANTINE, State.OBSERVE}),
    State.ARM: frozenset({State.TAKEOFF, State.ABORT_LAND, State.DISARM, State.QUARANTINE}),
    State.TAKEOFF: frozenset({State.RECORD, State.ABORT_LAND, State.LINK_LOST, State.DISARM, State.QUARANTINE}),
    State.RECORD: frozenset({State.LAND, State.ABORT_LAND, State.LINK_LOST, State.DISARM, State.QUARANTINE}),
    State.LAND: frozenset({State.DISARM, State.ABORT_LAND, State.QUARANTINE}),
    State.ABORT_LAND: frozenset({State.DISARM, State.QUARANTINE}),
    State.LINK_LOST: frozenset({State.ABORT_LAND, State.DISARM, State.QUARANTINE}),
    State.DISARM: frozenset({State.RESTORE, State.ABORT_LAND, State.QUARANTINE}),
    State.RESTORE: frozenset({State.IDLE, State.QUARANTINE}),
    State.QUARANTINE: frozenset({State.IDLE}),
    State.OBSERVE: frozenset({State.IDLE}),
}
"""Only a person's release leads out of quarantine and observing. Disarm returns to abort-land if the vehicle is in the
air. A trial that ends in idle after arming has been disarmed and has its safe gains restored."""

COMMANDED: Final = frozenset({State.ARM, State.TAKEOFF, State.RECORD, State.LAND, State.ABORT_LAND})
"""States in which an operator's abort has an effect."""

LANDING: Final = frozenset({State.LAND, State.ABORT_LAND})
"""States in which the vehicle has been commanded to land and the link is up."""

OVER: Final = frozenset({State.IDLE, State.QUARANTINE})
QUARANTINE_STATES: Final = frozenset({State.QUARANTINE, State.OBSERVE})
"""States in which only Land and motors off may be sent, until a person releases the vehicle."""


RECORD_S: Final = WINDOW_S + RECORDED_BEYOND_S
"""Length of the record for the default window."""
GAIN_S: Final = 0.1
GAINS_S: Final = 0.3
_IN_PLACE_M: Final = 0.3
_SHIFT_M: Final = 0.3
"""Greatest shift of the altitude on the ground as the motors start, unless the autopilot resets it then."""
_STANDS_S: Final = 0.1
"""A vehicle that has stood on the ground since this long after the takeoff command had not left it before."""
_CLIMBED_M: Final = 0.1
"""A vehicle that has climbed by less than this, by its climb rate, has not moved."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Plan of a trial.

    `safe_gains` are in the order in which an abort sends them; `ground_m` is the ground on the vehicle's datum;
    `climbs_from_ground`: the commanded altitude counts from there; `record_s`: length of the record after the takeoff
    command; `lift_off_s`: latest lift-off after it; `land_again_s`: interval at which a landing is commanded again;
    `set_points`: the takeoff's altitude, and those that follow, in the record's altitude; `holds_first`: the second of
    them is the takeoff's again, commanded by `Action.HOLD`, after which the vehicle may only be in `following_modes`
    until it lands. The set point of `limits` is the current one. `trial_gains` are those that it was seen to hold;
    `mode_parameter` is its mode as a parameter, if its heartbeats do not distinguish all modes.
    """

    safe_gains: tuple[Setting, ...]
    trial_gains: tuple[Setting, ...] = ()
    mode_parameter: ModeParameter | None = None
    limits: Limits
    ground_m: float
    set_points: SetPoints = SET_POINTS
    holds_first: bool = False
    following_modes: frozenset[str] = frozenset()
    climbs_from_ground: bool = False
    record_s: float = RECORD_S
    lift_off_s: float = 1.5
    land_again_s: float = 1.0
    stop_settings: tuple[str, ...] = ()

    @property
    def slow_s(self) -> float:
        """Longest delay of the vehicle's clock behind ours at the end of the record: its share of a longer record is
        that of the default one."""
        return self.limits.slow_s * max(1.0, self.record_s / RECORD_S)

    @property
    def datum_m(self) -> float:
        """Zero of the record's altitude, on the vehicle's datum."""
        return self.ground_m if self.climbs_from_ground else 0.0

    @property
    def takeoff(self) -> SetPoints:
        """The takeoff's set point alone."""
        return SetPoints(self.set_points.times_s[:1], self.set_points.altitudes_m[:1])

    @property
    def first_step(self) -> int:
        """Place of the first step among the set points."""
        return 2 if self.holds_first else 1

    @property
    def climb_to_m(self) -> float:
        """First set point, on the vehicle's datum."""
        return self.set_points.altitudes_m[0] + self.datum_m

    def with_set_point(self, set_point_m: float) -> "Plan":
        """Return the plan with another current set point, on the vehicle's datum."""
        limits = dataclasses.replace(self.limits, set_point_m=set_point_m)
        return dataclasses.replace(self, limits=limits)

    def on_ground_at(self, ground_m: float) -> "Plan":
        """Return the plan with another height of the ground."""
        moved = dataclasses.replace(self, ground_m=ground_m)
        return moved.with_set_point(self.limits.set_point_m + moved.datum_m - self.datum_m)


@dataclass(frozen=True, slots=True)
class SetPointChange:
    """A set point that the vehicle has confirmed, in the record's altitude. `times_s`, in s since the takeoff command
    by the vehicle's clock: when it took effect, if it was the first, second, … sending of the message that did."""

    altitude_m: float
    times_s: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """State of a trial.

    `commanded_boot_s` is the vehicle's own time of the last sample before the takeoff command, `commanded_in` its mode
    then. `confirmed_boot_s` is its own time when it first replied to a message sent after that command; until then the
    command may still be under way to it. `failure` is the first failure, `request` what ended the trial if that is
    none of its own. `stopped`: a person has requested motors off;
    `answered`: the vehicle has replied to the command to stop them. `ground_samples` are its positions between arming
    and the takeoff command, `ground_shift_m` is the increase of its altitude on the ground in that time. `doubt` is
    the reason why it will be quarantined at the end, however it lands. `changes` are the set points after the
    takeoff's that it has confirmed; `changes_set_point`: it has not confirmed the newest; `settling` are the positions
    that show whether it is at rest before the first of them. `astray_since_s`: since when it has reported another set
    point than the one it confirmed. `withdrawn`: a heartbeat has reported a manual mode since the first of them was
    commanded, after which none is commanded any more. `suspects` are parameters that one message reported with a value
    other than the vehicle must have. `disarmed_m` is its height when its heartbeats began to report its motors off,
    0 on the ground; `fell_s` the time of its fall.
    """

    plan: Plan
    state: State
    since_s: float
    watch: TrialObservation
    failure: Failure | None = None
    request: StopRequest | None = None
    remarks: tuple[str, ...] = ()
    arm_sent_s: float | None = None
    armed_s: float | None = None
    commanded_s: float | None = None
    commanded_boot_s: float | None = None
    commanded_in: str = ""
    confirmed_boot_s: float | None = None
    requested_s: float = 0.0
    ground_samples: tuple[Position, ...] = ()
    ground_shift_m: float = 0.0
    unsent: tuple[Setting, ...] = ()
    awaited: Setting | None = None
    gains_since_s: float | None = None
    sent_s: float = 0.0
    repeated_s: float = 0.0
    resting_since_s: float | None = None
    stopped: bool = False
    answered: bool = False
    suspects: frozenset[str] = frozenset()
    polled_s: float = 0.0
    disarmed_m: float = 0.0
    fell_s: float | None = None
    doubt: str = ""
    contact: Landing = Landing.UNKNOWN
    changes: tuple[SetPointChange, ...] = ()
    changes_set_point: bool = False
    settling: tuple[Position, ...] = ()
    astray_since_s: float | None = None
    withdrawn: bool = False

    @property
    def is_over(self) -> bool:
        return self.state in OVER

    @property
    def why(self) -> str:
        """Why it failed, for people."""
        return joined("" if self.request is None else request_text(self.request), *self.remarks)

    @property
    def has_set_point(self) -> bool:
        """Whether a set point after the takeoff's has been commanded."""
        return bool(self.changes) or self.changes_set_point

    @property
    def may_take_off(self) -> bool:
        """Whether the takeoff command may yet reach the vehicle, which has not been seen in the air: its position may
        be of the time before, and a command to stop its motors would arrive after it."""
        return self.commanded_s is not None and self.confirmed_boot_s is None and not self.watch.lifted

    @property
    def outcome(self) -> Outcome | None:
        """Outcome of the trial; None without a failure."""
        if self.state is State.QUARANTINE:
            return "quarantine"
        if self.failure is None:
            return None
        known = RESPONSES[self.failure].outcome
        return "invalid" if known == "quarantine" else known

    @property
    def has_confirmed_stop(self) -> bool:
        """Whether a vehicle whose motors a person has stopped reports it, in its newest heartbeat and by a reply."""
        return self.stopped and self.answered and not self.watch.armed


def measure_ground(trial: Trial, now_s: float) -> Trial:
    """Return the trial with the ground where the vehicle stands now, because its altitude shifts as its motors start,
    and is reset by an autopilot that counts from the ground. If it may have moved, the ground is unchanged."""
    watch, plan, samples = trial.watch, trial.plan, trial.ground_samples
    stood = samples[len(samples) // 2 :]
    if not stood or watch.doubted or watching.is_said_to_fly(watch, now_s, plan.ground_m):
        return trial
    altitudes_m = [position.altitude_m for position in stood]
    is_still = max(altitudes_m) - min(altitudes_m) <= GROUND_M
    is_in_place = stood[-1].away_m(watch.origin or stood[-1]) <= _IN_PLACE_M
    shift_m = statistics.median(altitudes_m) - plan.ground_m
    may_shift = plan.climbs_from_ground or abs(shift_m) <= _SHIFT_M
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


Step = tuple[Trial, tuple[Command, ...]]


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
            if finding.failure in GAIN_FAILURES and trial.gains_since_s is None
            else (trial, ())
        )
    return _REACTIONS[reaction](trial, now_s)


def _lose_link(trial: Trial, now_s: float) -> Step:
    return land(trial, State.LINK_LOST, now_s)


def _give_up_take_off(trial: Trial, now_s: float) -> Step:
    """Stop the motors of a vehicle that has received the command and is on the ground by every source; otherwise abort,
    because it may yet lift off, or has, with its integrator wound up. One that reports its landing by a block of its
    flight plan always lands."""
    stands = trial.watch.grounded_since_s is not None and not find_doubt_of_descent(trial, now_s)
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
    trial = replace(trial, awaited=first, unsent=tuple(others), gains_since_s=now_s, sent_s=now_s)
    return trial, (SendGain(first),)


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
    watch, landed_blocks = trial.watch, trial.plan.limits.landed_blocks
    if trial.may_take_off:
        return "it has not replied since the takeoff command, which may still be under way"
    if trial.commanded_s is None:
        return ""
    if landed_blocks or watch.landed is not None:
        has_landed = watch.block in landed_blocks if landed_blocks else watching.reports_landing(watch, now_s)
        return "" if has_landed else "it has not reported a landing, and an altitude may drift"
    return "" if watch.lifted and watch.unseen_m is None else "its descent was not observed"


def request_reply(trial: Trial, now_s: float) -> Step:
    """Request a reply that confirms the takeoff command."""
    return replace(trial, requested_s=now_s), (RequestGain(trial.plan.safe_gains[0].parameter),)


def stop_motors(trial: Trial, request: StopRequest, now_s: float) -> Step:
    """Stop the motors at once, at any height; disarm repeats the command. A trial that has not failed is aborted, and a
    vehicle that may have fallen is quarantined at its end."""
    if trial.stopped:
        return trial, ()
    drop = _find_drop(trial, now_s)
    if trial.failure is None:
        trial = note(trial, Finding(failure=Failure.OPERATOR, request=request))
    else:
        trial = replace(trial, remarks=(*trial.remarks, request_text(request)))
    doubt, contact = trial.doubt or drop, Landing.FELL if drop else trial.contact
    trial = replace(trial, doubt=doubt, contact=contact, stopped=True, answered=False)
    trial = replace(trial, awaited=None, unsent=())
    if trial.state not in (State.DISARM, State.RESTORE):
        trial = enter(trial, State.DISARM, now_s)
    return replace(trial, repeated_s=now_s), (PerformAction(Action.KILL),)


def _find_drop(trial: Trial, now_s: float) -> str:
    """Return why a vehicle whose motors are stopped now may have fallen; empty if every source shows it on the ground,
    or it has not been commanded to take off and nothing shows that it moved."""
    watch, ground_m = trial.watch, trial.plan.ground_m
    stands = watching.stands_by_own_account(watch, now_s, ground_m, trial.plan.limits)
    is_arming = trial.state is State.ARM and not watching.is_said_to_fly(watch, now_s, ground_m)
    if trial.commanded_s is None and (stands or is_arming):
        return ""
    if watch.last is not None and watching.is_airborne(watch, now_s, ground_m):
        height_m = watch.last.altitude_m - ground_m
        return f"The vehicle was {height_m:.1f} m above the ground: inspect it before it flies again."
    if watching.is_grounded(watch, now_s, ground_m) and not watching.is_said_to_fly(watch, now_s, ground_m):
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
    if trial.commanded_s is None:
        return not watch.lifted
    if trial.failure is not Failure.TAKE_OFF_REFUSED:
        return False
    stood = watch.grounded_since_s is not None and watch.grounded_since_s <= trial.commanded_s + _STANDS_S
    return stood and not (trial.doubt or watch.glitches or find_doubt_of_ground(trial, now_s))


def quarantine(trial: Trial, why: str, now_s: float) -> Step:
    remarks = tuple(dict.fromkeys(filter(None, (*trial.remarks, trial.doubt, why))))
    return replace(enter(trial, State.QUARANTINE, now_s), remarks=remarks), ()


def send_gains(trial: Trial, event: Event) -> Step:
    """Send the next safe gain once the last was echoed or 0.1 s have passed, and Land after 0.3 s at the latest."""
    now_s = event.now_s
    echoed = (
        isinstance(event, PacketReceived)
        and isinstance(event.measurement, Parameter)
        and trial.awaited is not None
        and event.measurement.name == trial.awaited.parameter
    )
    late = now_s - (trial.gains_since_s or now_s) >= GAINS_S
    if not late and not echoed and now_s - trial.sent_s < GAIN_S:
        return trial, ()
    if trial.unsent and not late:
        following, *others = trial.unsent
        return replace(trial, awaited=following, unsent=tuple(others), sent_s=now_s), (SendGain(following),)
    rest = tuple(SendGain(setting) for setting in trial.unsent)
    trial = replace(trial, awaited=None, unsent=(), repeated_s=now_s)
    return trial, (*rest, PerformAction(Action.LAND))


_REACTIONS: Final[Mapping[Reaction, Callable[[Trial, float], Step]]] = {
    "land, gains first": abort,
    "land": _abort_landing,
    "repeat land": _lose_link,
    "disarm": _give_up_take_off,
}
"""Transition for each reaction of `RESPONSES`, for a vehicle that has been commanded to take off."""
