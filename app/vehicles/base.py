"""The interface between the program and anything that flies, and the errors of vehicles.

GainlineError
└── VehicleError                  a vehicle could not do what was asked
    ├── InterruptedByOrderError   a person ordered something else meanwhile
    └── SafeGainsError            it may still hold experimental gains: to be quarantined
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal, Protocol

from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory

OptionValue = bool | int | float | str
Ending = Literal["completed", "aborted", "invalid"]
"""aborted: cut short, a safety limit or a person; invalid: the measurement is no good, whatever the gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOption:
    """One setting of a vehicle kind, with its unit, range and default."""

    name: str
    title: str
    unit: str
    default: OptionValue
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True, slots=True)
class Sample:
    """Telemetry of one instant: seconds since the command, and the channels of a record that are worth watching, the
    scored one among them."""

    time_s: float
    channels: Mapping[str, float]

    def __getitem__(self, channel: str) -> float:
        return self.channels[channel]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions:
    """What one flight is to do.

    `seed` makes scatter repeatable: the same vehicle, gains and seed give the same flight. `speed` is simulated time
    over that of the `clock` (10.0: ten times as fast as life); None runs as fast as possible. Vehicles that own no
    time ignore both.
    """

    seed: int
    speed: float | None = None
    clock: Clock = REAL_TIME


@dataclass(frozen=True, slots=True)
class StopRequest:
    """What ends a flight early. `motors_off` stops the motors at once, at any height; without it the vehicle lands."""

    reason: str
    motors_off: bool = False


ShouldStop = Callable[[], StopRequest | None]
MOTORS_OFF_ASKED: Final = "Motors off was asked for: "


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRecord:
    """What a flight left: its full-rate trajectory, how it ended, and why when it was cut short.

    A flight that `should_stop` ended, and no limit before it, has a `reason` that begins with the stop's, or with
    `MOTORS_OFF_ASKED` and the stop's. `on_request` says so of an aborted one, once whoever asked has looked.
    """

    trajectory: Trajectory
    ending: Ending
    reason: str = ""
    on_request: bool = False
    settings: Mapping[str, OptionValue] = field(default_factory=dict)


class Vehicle(Protocol):
    """One vehicle under this program's control, between `open_vehicle` and its exit.

    Nothing flies on gains that were not read back: `stage` writes and returns what the vehicle now holds.
    """

    @property
    def kind(self) -> str: ...
    @property
    def is_real(self) -> bool: ...
    @property
    def safe_gains(self) -> Gains: ...

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return what was read back."""
        ...

    def read_gains(self) -> dict[str, float]:
        """What the vehicle holds now."""
        ...

    def fly(
        self, order: FlightOptions, *, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> FlightRecord:
        """Take off with the staged gains and record until the manoeuvre is over.

        `on_sample` gets telemetry at 50 Hz of vehicle time while it happens; `should_stop` is asked at least as often
        and says so once the flight is to end early. Raises VehicleError when the flight could not be carried out;
        it is `not_flown` when the vehicle was never told to take off.
        """
        ...

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Who a vehicle is: its MAVLink system id, the make of its autopilot, what that tells of its version, and `uid`,
    its hardware's own id in hexadecimal digits. Both are empty where it does not tell them."""

    system_id: int
    autopilot: str
    version: str
    uid: str = ""

    def completed_by(self, other: "Identity | None") -> "Identity":
        """With the other's version and hardware id where this one has none."""
        if other is None:
            return self
        return replace(self, version=self.version or other.version, uid=self.uid or other.uid)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """How a connected vehicle is now; None and empty where it is not known.

    `step` is where it is in a trial ("idle", "arm", "take-off", "record", "land", "abort-land", "link lost", "disarm",
    "restore", "quarantined"), or "observing" for one that is only watched. Ages are seconds since the last packet and
    heartbeat; `held` are the gains as last read back, `said` is its last line of text, `trouble` what does not
    work on our side.
    """

    step: str
    packet_age_s: float | None = None
    heartbeat_age_s: float | None = None
    armed: bool | None = None
    mode: str = ""
    altitude_m: float | None = None
    climb_rate_m_s: float | None = None
    battery_v: float | None = None
    position_hz: float | None = None
    lost_share: float | None = None
    held: Mapping[str, float] = field(default_factory=dict)
    said: str = ""
    trouble: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckItem:
    """One thing that has to be so before a flight: what was found, what is needed, and what to do where they differ."""

    name: str
    title: str
    passed: bool
    found: str
    needed: str
    hint: str = ""


class ConnectedVehicle(Vehicle, Protocol):
    """A vehicle whose link stays open between flights. For one thread.

    Met armed, or in doubt, it is only observed: `concern` says why, and `stage`, `fly` and `parameters` raise
    SafeGainsError until `release`. `check` only reads; `land` and `motors_off` are possible always; `restore` once it
    is disarmed.
    """

    @property
    def identity(self) -> Identity: ...
    @property
    def concern(self) -> str:
        """Why it may only be observed; empty when it may fly."""
        ...

    @property
    def has_standing_order(self) -> bool:
        """Whether it has not obeyed yet what `land` or `motors_off` asked for, which is repeated."""
        ...

    def condition(self) -> Condition:
        """How it is, as last heard: nothing is waited for."""
        ...

    def attend(self, timeout_s: float) -> None:
        """Listen for so long, and tell the vehicle that its ground station is there. What `land` or `motors_off` asked
        for is repeated every second until telemetry agrees. Raises VehicleError when the link is closed."""
        ...

    def check(self) -> tuple[CheckItem, ...]:
        """Look at everything that has to be so before a flight; what is not so is an item, not an error."""
        ...

    def parameters(self, on_progress: Callable[[int, int], None]) -> dict[str, float]:
        """Every parameter of the vehicle; `on_progress` is told how many came, of how many. Raises VehicleError when
        they do not come."""
        ...

    def restore(self) -> dict[str, float]:
        """Write the safe gains and return what was read back, which is them. One that is only observed stays so. Raises
        SafeGainsError when it is armed or does not take them."""
        ...

    def change_safe_gains(self, safe_gains: Gains) -> None:
        """Take other safe gains, and write them as connecting does. What goes wrong becomes a concern. Raises
        GainsError for gains that it cannot hold."""
        ...

    def land(self, reason: str) -> None:
        """Tell it to land, at once, whatever state it is in."""
        ...

    def motors_off(self, reason: str) -> None:
        """Stop its motors, at once and at any height."""
        ...

    def log_to(self, path: Path | None) -> None:
        """Write what passes from now on, in both directions, to this telemetry log; None ends the log. Raises
        VehicleError when the file cannot be opened: the log before goes on then."""
        ...

    def release(self) -> None:
        """A person has looked at it: out of observation, once it is disarmed and holds its safe gains, read back.
        Raises VehicleError when it is not or does not; it stays as it was then."""
        ...


class VehicleError(GainlineError):
    """A vehicle could not do what was asked of it. `not_flown`: that was to fly, and it was never told to take off."""

    not_flown = False


class InterruptedByOrderError(VehicleError):
    """What was under way with the vehicle was ended by a person's order to land or to stop its motors, which has gone
    out."""


class SafeGainsError(VehicleError):
    """The safe gains could not be verified on the vehicle; it must not fly until a person has looked at it."""
