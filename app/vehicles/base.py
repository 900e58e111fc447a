"""Interface of all vehicles, simulated and real, and their errors.

GainlineError
└── VehicleError                  a vehicle could not carry out a request
    ├── InterruptedByOrderError   an operator's command interrupted it
    └── SafeGainsError            the vehicle may still hold experimental gains: quarantine it
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal, Protocol

from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.core.experiments.takeoff import SET_POINTS, WINDOW_S
from app.core.models.set_points import SetPoints
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.vehicles.flight_end import FlightEnd, Landing, StopRequest, cause_text

OptionValue = bool | int | float | str
Ending = Literal["completed", "aborted", "invalid"]
"""aborted: ended early by a safety limit or a person; invalid: the measurement is unusable for any gains."""


@dataclass(frozen=True, slots=True)
class Sample:
    """Telemetry at one instant: seconds since the takeoff command, and the record's channels for live display,
    including the scored one."""

    time_s: float
    channels: Mapping[str, float]

    def __getitem__(self, channel: str) -> float:
        return self.channels[channel]


ALTITUDE_LIMIT_M: Final = 4.5
"""Height above the ground under a vehicle with a link at which its flight is aborted."""
HIGHEST_SET_POINT_M: Final = ALTITUDE_LIMIT_M - 1.0
"""Highest set point of such a vehicle, with room for its overshoot."""
RECORDED_BEYOND_S: Final = 0.4
"""Time recorded after the end of the scored window."""
LAND_COMMAND_S: Final = 2.0
"""Time left after the record to command the landing, before a flight plan would land the vehicle by itself."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOptions:
    """Options of one flight.

    `seed` makes scatter repeatable: the same vehicle, gains and seed give the same flight. `speed` is simulated time
    over the time of the `clock` (10.0: ten times real time); None runs as fast as possible. Real vehicles ignore both.
    `window_s` is the end of the scored time after the takeoff command; a vehicle with one manoeuvre of fixed length
    ignores it. The set points after the first are flown once the vehicle is at rest there.
    """

    seed: int
    speed: float | None = None
    clock: Clock = REAL_TIME
    window_s: float = WINDOW_S
    set_points: SetPoints = SET_POINTS

    @property
    def record_s(self) -> float:
        """Length of the record after the takeoff command."""
        return self.window_s + RECORDED_BEYOND_S


ShouldStop = Callable[[], StopRequest | None]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRecord:
    """Result of a flight: its trajectory at full rate, and how it ended. If `should_stop` ended it before any limit
    did, that is the `request` of its `end`."""

    trajectory: Trajectory
    ending: Ending
    end: FlightEnd = field(default_factory=FlightEnd)
    settings: Mapping[str, OptionValue] = field(default_factory=dict)

    @property
    def has_flown(self) -> bool:
        """Whether anything was flown: False if the vehicle has certainly never left the ground."""
        return self.end.landed is not Landing.STAYED

    @property
    def reason(self) -> str:
        """Why it ended early or does not count, for people."""
        return cause_text(self.end)


class Vehicle(Protocol):
    """One vehicle under this program's control, between `open_vehicle` and its exit.

    `stage` writes gains and returns the values read back; the vehicle never flies on gains that were not read back.
    """

    @property
    def kind(self) -> str: ...
    @property
    def is_real(self) -> bool: ...
    @property
    def safe_gains(self) -> Gains: ...

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return the values read back."""

    def read_gains(self) -> dict[str, float]:
        """Return the gains that the vehicle holds now."""

    def fly(
        self, order: FlightOptions, *, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> FlightRecord:
        """Take off with the staged gains and record until the manoeuvre is over.

        `on_sample` receives live telemetry at 50 Hz of vehicle time; `should_stop` is called at least as often and
        returns a request once the flight must end early. Raises VehicleError if the flight could not be carried out,
        with `not_flown` set if the vehicle was never commanded to take off. A flight that a request ended before the
        lift-off has a record without `has_flown`.
        """

    def close(self) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Identity of a vehicle: its MAVLink system id, its autopilot, the autopilot's version, and `uid`, the hardware id
    in hexadecimal digits. Version and `uid` are empty if the autopilot does not report them."""

    system_id: int
    autopilot: str
    version: str
    uid: str = ""

    def completed_by(self, other: "Identity | None") -> "Identity":
        """Return this identity, with the other's version and hardware id where this one has none."""
        if other is None:
            return self
        return replace(self, version=self.version or other.version, uid=self.uid or other.uid)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkedVehicle:
    """What is needed to open the link to a vehicle; `identity` is the pinned one, None before the first connection.
    `was_flying`: a process of Gainline may have left it in the air, because its gains, which are only read on the
    ground, have not been read since its last takeoff."""

    vehicle_id: int
    name: str
    kind: str
    options: Mapping[str, OptionValue]
    safe_gains: Gains
    identity: Identity | None
    was_flying: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """Current state of a connected vehicle; None or empty where unknown.

    `step` is the step of the trial ("idle", "preflight", "arm", "take-off", "record", "land", "abort-land", "link
    lost", "disarm", "restore", "quarantined"), or "observing" for a vehicle that is only observed. Ages are seconds
    since the last packet, heartbeat and status text; `held` are the gains last read back, `said` is that text,
    `trouble` a fault of the ground station, `restarts` how often the vehicle has restarted since the link was opened.
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
    said_age_s: float | None = None
    trouble: str = ""
    restarts: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckItem:
    """Result of one preflight check: what was found, what is required, and what to do if they differ."""

    name: str
    title: str
    passed: bool
    found: str
    needed: str
    hint: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionOpened:
    """What was found when the link was opened; `concern` is why the vehicle may only be observed, and `held` are its
    gains, empty where it did not report them."""

    identity: Identity
    concern: str = ""
    held: Mapping[str, float] = field(default_factory=dict)


class ConnectedVehicle(Vehicle, Protocol):
    """A vehicle whose link stays open between flights. To be used by one thread only.

    A vehicle that is armed on connection, or whose state could not be verified, is only observed: `concern` gives the
    reason, and `stage`, `fly` and `parameters` raise SafeGainsError until `release`. `check` only reads; `land` and
    `motors_off` are always possible; `restore` once the vehicle is disarmed. `has_stopped`: the vehicle has confirmed
    that its motors stopped, after the last `motors_off` or flight; None while that is awaited.
    """

    has_stopped: bool | None

    @property
    def identity(self) -> Identity: ...
    @property
    def concern(self) -> str:
        """Reason why the vehicle may only be observed; empty if it may fly."""

    @property
    def has_standing_order(self) -> bool:
        """Whether a command of `land` or `motors_off` is still being repeated because telemetry does not confirm it;
        False once it was repeated for a minute without a packet from the vehicle."""

    def condition(self) -> Condition:
        """Return the state last received, without waiting."""

    def attend(self, timeout_s: float) -> None:
        """Receive for `timeout_s` while sending the ground station's heartbeats. A command of `land` or `motors_off` is
        repeated every second until telemetry confirms it. Raises VehicleError if the link is closed."""

    def confirm_staged(self) -> None:
        """Read the staged gains again after a silence of the vehicle. Raises VehicleError if it restarted meanwhile, or
        does not report the staged gains."""

    def check(self) -> tuple[CheckItem, ...]:
        """Run all preflight checks; a failed check is an item of the result, not an error."""

    def parameters(self) -> dict[str, float]:
        """Read every parameter of the vehicle. Raises VehicleError if they do not arrive."""

    def restore(self) -> dict[str, float]:
        """Write the safe gains and return the values read back, which are equal. A vehicle that is only observed stays
        so. Raises SafeGainsError if the vehicle is armed or does not accept them."""

    def change_safe_gains(self, safe_gains: Gains) -> None:
        """Replace the safe gains and write them, as on connection. A failure becomes the `concern`. Raises GainsError
        for gains that the vehicle cannot hold."""

    def land(self, words: str) -> None:
        """Command the vehicle to land at once, in any state; with the words of who asked, if any."""

    def motors_off(self, words: str) -> None:
        """Stop the motors at once, at any height."""

    def log_to(self, path: Path | None) -> None:
        """Record all packets from now on, in both directions, in this telemetry log; None ends the log. Raises
        VehicleError if the file cannot be opened; the previous log then continues."""

    def release(self) -> None:
        """End the observation after a person has inspected the vehicle. It must be disarmed and hold its safe gains,
        read back. Otherwise raises VehicleError and changes nothing."""


class VehicleError(GainlineError):
    """A vehicle could not carry out a request. `not_flown`: the request was a flight, and the vehicle was never
    commanded to take off."""

    not_flown = False


class InterruptedByOrderError(VehicleError):
    """An operator's command to land or stop the motors, which has been sent, ended what was in progress."""


class SafeGainsError(VehicleError):
    """The safe gains could not be verified on the vehicle; it must not fly until a person has inspected it."""


def find_mismatch(held: Gains, wanted: Gains) -> str:
    """Return how gains that were read back differ from the wanted ones, "kp is 283 instead of 300"; empty if they are
    equal."""
    names = [*wanted, *(name for name in held if name not in wanted)]
    different = [name for name in names if held.get(name) != wanted.get(name)]
    return ", ".join(
        f"{name} is {_shown(held.get(name), 'missing')} instead of {_shown(wanted.get(name), 'none')}"
        for name in different
    )


def _shown(value: float | None, without: str) -> str:
    return without if value is None else f"{value:.9g}"
