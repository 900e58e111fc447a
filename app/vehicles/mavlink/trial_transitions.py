"""States of one trial on a MAVLink vehicle, and its transitions from one to the next, each with the commands that
belong to it: pure functions of a trial and the time. When each is made is decided in `trial_machine`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from app.vehicles.base import MOTORS_OFF_ASKED
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.events import (
    Action,
    Command,
    Event,
    PacketReceived,
    Parameter,
    PerformAction,
    Position,
    SendGain,
    Setting,
)
from app.vehicles.mavlink.failures import GAIN_FAILURES, RESPONSES, Failure, Finding, Limits, Outcome, Reaction
from app.vehicles.mavlink.observation import TrialObservation


class State(StrEnum):
    """One trial, from the first heartbeat to the safe gains read back.

        connect → preflight → set gains → arm → take-off → record → land ──→ disarm → restore → idle
           ↓                               │       │          ├──→ abort-land ─↗↘
        observing                          │       │          └──→ link lost ──→ quarantined
                                           └───────┴──→ disarm

    A failure before arming leads back to idle. From arm on every end leads through disarm and restore, or into
    quarantine, where nothing but a person helps. Stopping the motors leads to disarm from every state. A vehicle that
    was met armed, or armed by somebody else, is only observed.
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
"""From quarantine and observing a person leads on, nobody else. Disarm goes back to abort-land when the vehicle is
found in the air; what ends in idle from arm on has been disarmed and has its safe gains back."""

COMMANDED: Final = frozenset({State.ARM, State.TAKEOFF, State.RECORD, State.LAND, State.ABORT_LAND})
"""An operator's abort has a meaning in these."""

LANDING: Final = frozenset({State.LAND, State.ABORT_LAND})
"""It has been told to land, and is heard."""

OVER: Final = frozenset({State.IDLE, State.QUARANTINE})
QUARANTINE_STATES: Final = frozenset({State.QUARANTINE, State.OBSERVE})
"""Nothing that changes the vehicle may be sent but Land and motors off, until a person has released it."""


GAIN_S: Final = 0.1
GAINS_S: Final = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What a trial is to do: the safe gains in the order in which an abort sends them, where the ground is on the
    vehicle's datum, whether what it is told to climb to counts from there, how long to record after the command, how
    soon the vehicle has to lift off, how long a landing is left alone before it is asked for again, and its limits."""

    safe_gains: tuple[Setting, ...]
    limits: Limits
    ground_m: float
    climbs_from_ground: bool = False
    record_s: float = 33.0
    lift_off_s: float = 1.5
    land_again_s: float = 1.0
    stop_settings: tuple[str, ...] = ()

    @property
    def datum_m(self) -> float:
        """Where the record's altitude counts from, on the vehicle's datum."""
        return self.ground_m if self.climbs_from_ground else 0.0

    def on_ground_at(self, ground_m: float) -> "Plan":
        """The same from another height of the ground."""
        moved = replace(self, ground_m=ground_m)
        set_point_m = self.limits.set_point_m + moved.datum_m - self.datum_m
        return replace(moved, limits=replace(self.limits, set_point_m=set_point_m))


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """Where a trial is. `commanded_boot_s` is the vehicle's own time of the last sample before the take-off command,
    `commanded_in` the mode that it was in then;
    `failure` is the first that happened; `stopped`: a person has asked for its motors to be stopped, `answered`: it
    has answered an order to stop them. `ground_samples`: its positions between arming and the command;
    `ground_shift_m`: by how much its altitude on the ground grew meanwhile. `doubt`: why it is quarantined in the end,
    however it lands."""

    plan: Plan
    state: State
    since_s: float
    watch: TrialObservation
    failure: Failure | None = None
    why: str = ""
    asked_s: float | None = None
    armed_s: float | None = None
    commanded_s: float | None = None
    commanded_boot_s: float | None = None
    commanded_in: str = ""
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
    doubt: str = ""

    @property
    def is_over(self) -> bool:
        return self.state in OVER

    @property
    def outcome(self) -> Outcome | None:
        """What the trial is worth; None when nothing went wrong."""
        if self.state is State.QUARANTINE:
            return "quarantine"
        if self.failure is None:
            return None
        known = RESPONSES[self.failure].outcome
        return "invalid" if known == "quarantine" else known


Step = tuple[Trial, tuple[Command, ...]]


def fail(trial: Trial, finding: Finding, now_s: float) -> Step:
    """What a failure leads to, from a state in which the vehicle obeys."""
    trial = note(trial, finding)
    if trial.state is State.ARM:
        return disarm(trial, now_s) if finding.failure is not Failure.DOUBLED else _abort_landing(trial, now_s)
    reaction = RESPONSES[finding.failure].reaction
    if reaction == "cease":
        return quarantine(trial, "" if finding.why == trial.why else finding.why, now_s)
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
    """Motors off where every witness has it on the ground. In the air its integrator is wound up."""
    return disarm(trial, now_s) if trial.watch.grounded_since_s is not None else abort(trial, now_s)


def _abort_landing(trial: Trial, now_s: float) -> Step:
    return land(trial, State.ABORT_LAND, now_s)


def note(trial: Trial, finding: Finding) -> Trial:
    """The first failure is the trial's; one that puts the vehicle in doubt is remembered beside it."""
    if RESPONSES[finding.failure].outcome == "quarantine" and not trial.doubt:
        trial = replace(trial, doubt=finding.why)
    if trial.failure is not None:
        return trial
    return replace(trial, failure=finding.failure, why=finding.why)


def enter(trial: Trial, state: State, now_s: float) -> Trial:
    if state not in TRANSITIONS[trial.state]:
        raise AssertionError(f"A trial cannot go from {trial.state} to {state}.")
    return replace(trial, state=state, since_s=now_s, resting_since_s=None)


def abort(trial: Trial, now_s: float) -> Step:
    return abort_with_safe_gains(enter(trial, State.ABORT_LAND, now_s), now_s)


def abort_with_safe_gains(trial: Trial, now_s: float) -> Step:
    """The gains are suspect: the first safe gain leaves at once, Land follows the last."""
    first, *others = trial.plan.safe_gains
    trial = replace(trial, awaited=first, unsent=tuple(others), gains_since_s=now_s, sent_s=now_s)
    return trial, (SendGain(first),)


def land(trial: Trial, state: State, now_s: float) -> Step:
    """Land now; it is repeated from `state`."""
    return replace(enter(trial, state, now_s), repeated_s=now_s), (PerformAction(Action.LAND),)


def disarm(trial: Trial, now_s: float) -> Step:
    """Motors off at once where every witness has had the vehicle on the ground for a second; else only once it has."""
    trial = replace(enter(trial, State.DISARM, now_s), answered=False)
    if not watching.may_stop_motors(trial.watch, now_s):
        return trial, ()
    return replace(trial, repeated_s=now_s), (PerformAction(Action.MOTORS_OFF),)


def stop_motors(trial: Trial, reason: str, now_s: float) -> Step:
    """At once, wherever the vehicle is; a trial that had not failed is aborted by it. It is repeated from disarm."""
    if trial.stopped:
        return trial, ()
    why, failure = joined(trial.why, f"{MOTORS_OFF_ASKED}{reason}."), trial.failure or Failure.OPERATOR
    trial = replace(trial, failure=failure, why=why, stopped=True, answered=False, awaited=None, unsent=())
    if trial.state not in (State.DISARM, State.RESTORE):
        trial = enter(trial, State.DISARM, now_s)
    return replace(trial, repeated_s=now_s), (PerformAction(Action.KILL),)


def quarantine(trial: Trial, why: str, now_s: float) -> Step:
    parts = (trial.why, *(part for part in dict.fromkeys((trial.doubt, why)) if part not in trial.why))
    return replace(enter(trial, State.QUARANTINE, now_s), why=joined(*parts)), ()


def joined(*parts: str) -> str:
    return " ".join(part for part in parts if part)


def send_gains(trial: Trial, event: Event) -> Step:
    """One request in flight: the next safe gain when the last was echoed or 0.1 s have passed; Land after 0.3 s."""
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
"""By what the failure's row in the table says, for a vehicle that has been told to take off and obeys."""
