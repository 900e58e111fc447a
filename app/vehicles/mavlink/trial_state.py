"""State of one trial on a MAVLink vehicle: its states, and what is known of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from app.autopilots.commands import Setting
from app.autopilots.measurements import Position
from app.vehicles.flight_end import Landing, StopRequest, joined, request_text
from app.vehicles.mavlink.events import Command
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.monitors.commanded import SetPointMonitor, SettingMonitor
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan


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

STATES_WITH_TRIAL_GAINS: Final = frozenset({State.TAKEOFF, State.RECORD})
"""States in which the vehicle flies on the trial's gains."""

OVER: Final = frozenset({State.IDLE, State.QUARANTINE})
QUARANTINE_STATES: Final = frozenset({State.QUARANTINE, State.OBSERVE})
"""States in which only Land and motors off may be sent, until a person releases the vehicle."""


@dataclass(frozen=True, kw_only=True)
class TakeoffCommand:
    """The takeoff command of a trial: its time, the vehicle's own time of the last sample before it (`boot_s`), and its
    mode then. `confirmed_boot_s` is its own time when it first replied to a message sent after the command; until then
    the command may still be under way to it, and a reply was requested at `requested_s`."""

    at_s: float
    boot_s: float
    mode: str
    requested_s: float
    confirmed_boot_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class SafeGainsSent:
    """The safe gains that an abort sends before Land: since when, the one whose echo is awaited, None once all were
    sent, and those that follow it."""

    since_s: float
    sent_s: float
    awaited: Setting | None
    unsent: tuple[Setting, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Trial:
    """State of a trial.

    `failure` is the first failure; `request` ended the trial before any failure of its own;
    `doubt` the reason why the vehicle will be quarantined at the end, however it lands.
    `ground_samples` are its positions between arming and the takeoff command, `ground_shift_m` is the increase of its
    altitude on the ground in that time. `resting_since_s`: since when it is at rest; `repeated_s`: when Land or motors
    off was commanded last. `stopped`: a person has requested motors off; `answered`: the vehicle has replied to the
    command to stop them. `disarmed_m` is its height when its heartbeats began to report its motors off, 0 on the
    ground; `fell_s` the time of its fall.
    """

    plan: Plan
    state: State
    since_s: float
    watch: TrialObservation
    settings: SettingMonitor = field(default_factory=SettingMonitor)
    set_points: SetPointMonitor = field(default_factory=SetPointMonitor)
    failure: Failure | None = None
    request: StopRequest | None = None
    remarks: tuple[str, ...] = ()
    doubt: str = ""
    arm_sent_s: float | None = None
    armed_s: float | None = None
    ground_samples: tuple[Position, ...] = ()
    ground_shift_m: float = 0.0
    takeoff: TakeoffCommand | None = None
    safe_gains: SafeGainsSent | None = None
    repeated_s: float = 0.0
    resting_since_s: float | None = None
    stopped: bool = False
    answered: bool = False
    disarmed_m: float = 0.0
    fell_s: float | None = None
    contact: Landing = Landing.UNKNOWN

    @property
    def is_over(self) -> bool:
        return self.state in OVER

    @property
    def why(self) -> str:
        """Why it failed, for people."""
        return joined("" if self.request is None else request_text(self.request), *self.remarks)

    @property
    def commanded_boot_s(self) -> float | None:
        """The vehicle's own time of the takeoff command."""
        return None if self.takeoff is None else self.takeoff.boot_s

    @property
    def may_take_off(self) -> bool:
        """Whether the takeoff command may yet reach the vehicle, which has not been seen in the air: its position may
        be of the time before, and a command to stop its motors would arrive after it."""
        is_under_way = self.takeoff is not None and self.takeoff.confirmed_boot_s is None
        return is_under_way and not self.watch.climb.lifted

    @property
    def has_confirmed_stop(self) -> bool:
        """Whether a vehicle whose motors a person has stopped reports it, in its newest heartbeat and by a reply."""
        return self.stopped and self.answered and not self.watch.modes.armed


Step = tuple[Trial, tuple[Command, ...]]
