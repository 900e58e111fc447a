"""Interface of autopilot profiles: gains, reading of messages, and messages to send; and their common parts."""

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import ClassVar, Final, Literal

from app.autopilots.dialects import (
    Dialect,
    FieldValue,
    Message,
    is_autopilots_heartbeat,
    number,
    source_component,
    source_system,
    text,
)
from app.core.errors import GainsError, Problem
from app.core.policy import Gains, shortened
from app.vehicles.mavlink.events import (
    Action,
    AltitudeError,
    Attitude,
    Battery,
    CommandReply,
    FenceBreach,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    ModeParameter,
    Parameter,
    Position,
    Setting,
    StatusText,
    TargetAltitude,
    Throttle,
    Version,
)

ARMED_BIT: Final = 128
ARM_DISARM: Final = 400
COPTERS: Final = frozenset({0, 2, 3, 4, 13, 14, 15, 29, 35, 43})
"""MAV_TYPE of vehicles that hover: quadrotor, coaxial, helicopter, 6, 8, 3, 12 and 10 rotors, any; and generic."""
FORCED: Final = 21196.0
"""The second parameter of 400 that stops motors in the air."""
REAL32: Final = 9
AUTOPILOT: Final = 1
"""Default component id of autopilots."""
TARGET: Final = "position target"
"""`Step.awaits` of a step that ends when the vehicle reports the position target of the step."""
POSITION_ALONE: Final = 0b110111111000
"""POSITION_TARGET_TYPEMASK: everything but the position is ignored."""
WITH_ACCELERATION: Final = POSITION_ALONE & ~(1 << 8)
"""Position and vertical acceleration: bits 6 and 7 go on ignoring the horizontal ones."""
_IGNORES_Z: Final = 1 << 2
_LOCAL_NED: Final = 1
SET_POINT_ATTEMPTS: Final = 3
"""Sendings of a set point; together shorter than the time between two set points."""
_FENCES: Final = MappingProxyType({1: "its least altitude", 2: "its greatest altitude", 3: "its boundary"})
"""FENCE_BREACH."""
_LANDED_STATES: Final = MappingProxyType({1: True, 2: False, 4: False})
"""MAV_LANDED_STATE: on the ground, in the air, landing."""
_PREARM_CHECK: Final = 1 << 28
"""MAV_SYS_STATUS_PREARM_CHECK, a bit of the sensors in SYS_STATUS."""
_TEXT_LENGTH: Final = 50
_THROTTLE_UNUSED: Final = 1 << 6
"""ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE."""
_ACCEPTED: Final = 0
_IN_PROGRESS: Final = 5
_RESULTS: Final = ("accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress", "cancelled")
_UNKNOWN_MV: Final = (0.0, 65535.0)


@dataclass(frozen=True, slots=True)
class GainParameter:
    """A gain by its name here and on the vehicle, the range of values that may be written (autopilots accept any), and
    the `factor` from the gain to the vehicle's value. `whole`: the vehicle keeps only the integer part. `integrates`:
    writing it may clear an integrator, so it is sent last in flight."""

    gain: str
    parameter: str
    lower: float
    upper: float
    factor: float = 1.0
    whole: bool = False
    integrates: bool = False

    def sent(self, value: float) -> float:
        """Return the value to send, in single precision."""
        return _single(value * self.factor)

    def read(self, wire: float, requested: float | None = None) -> float:
        """Return the gain for a value of the vehicle, to the seven digits of single precision; exactly `requested` if
        the value is the one sent for it."""
        if self.whole:
            return int(wire)
        return (
            requested if requested is not None and wire == self.sent(requested) else float(f"{wire / self.factor:.7g}")
        )

    def refusal(self, value: float) -> str | None:
        """Return why this value may not be written, or None if it may."""
        if not self.lower <= value <= self.upper:
            return f"must be between {self.lower:g} and {self.upper:g}, got {shortened(value)}"
        return f"must be a whole number of counts, got {value:g}" if self.whole and value != int(value) else None


GainSet = tuple[GainParameter, ...]
ReferenceSource = Literal["replica", "error", "target"]
"""Source of an autopilot's own reference: the replica of its loop computes it; it sends its altitude error; it is the
position target, which it sends."""


def check_gains(gains: Gains, gain_set: GainSet) -> dict[str, float]:
    """Return the gains, complete and in order. Raises GainsError for those that may not be written, because autopilots
    do not check."""
    known = {gain.gain: gain for gain in gain_set}
    problems = [Problem(f"gains.{name}", "is not a gain of this vehicle") for name in gains if name not in known]
    for name, gain in known.items():
        reason = gain.refusal(gains[name]) if name in gains else "is missing"
        if reason is not None:
            problems.append(Problem(f"gains.{name}", reason))
    if problems:
        raise GainsError(
            "These gains may not be written to the vehicle.",
            problems=tuple(problems),
            hint=f"Send {', '.join(known)}, each within its range.",
        )
    return {name: int(gains[name]) if gain.whole else float(gains[name]) for name, gain in known.items()}


@dataclass(frozen=True, slots=True)
class Requirement:
    """Part of a failsafe that must be enabled before a flight: a parameter with one of these values, or else at least
    `least`, by default above zero, at most `most`, and with all of these `bits`; or, if there are any `clear_bits`,
    without these. `what`: these values, with their effect in brackets. `newer_name`: the parameter's name in newer
    releases. `may_lack`: older releases lack it, and what it sets."""

    parameter: str
    what: str
    values: frozenset[float] = frozenset()
    bits: int = 0
    clear_bits: int = 0
    least: float = math.ulp(0.0)
    most: float = math.inf
    newer_name: str = ""
    may_lack: bool = False

    def is_met(self, value: float) -> bool:
        if self.values:
            return value in self.values
        if self.clear_bits:
            return not int(value) & self.clear_bits
        return self.least <= value <= self.most and int(value) & self.bits == self.bits


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send, by its name and fields."""

    kind: str
    fields: Mapping[str, FieldValue]


@dataclass(frozen=True, slots=True)
class Step:
    """Messages sent together, up to `attempts` times, and the reply that ends the step: see `CommandReply.to`, or
    `TARGET` with its `altitude_m`, or "mode " and the mode of a heartbeat; if it awaits none, the step ends after
    `pause_s`. `shown_by`: the "mode " of a heartbeat that ends it too, for replies get lost. A step that is not
    `needed` may be refused, or have no reply; one that `persists` is sent again after a refusal, up to `attempts`
    times. If there are `modes`, it is sent only right after a heartbeat that reports one of them."""

    sends: tuple[Outgoing, ...]
    awaits: str = ""
    shown_by: str = ""
    attempts: int = 5
    pause_s: float = 0.0
    needed: bool = True
    persists: bool = False
    altitude_m: float = math.nan
    modes: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Recipient of messages. `component` is its autopilot's, 0 until it is known; `aircraft` is the id that Paparazzi
    matches in most messages; `newer_names` are the parameters found on it that newer releases name differently, by
    their older names; `blocks` are the numbers of its flight plan's blocks by name; `stop_settings` are the
    settings found on it that stop its motors, `stops_by_command`: it has accepted the command that stops them;
    `east_m` and `north_m` are its place on the ground; `acceleration_m_s2`, up, is fed forward beside the altitude."""

    system: int
    aircraft: int
    component: int = 0
    waypoint: int = 2
    blocks: Mapping[str, int] = field(default_factory=dict)
    newer_names: Mapping[str, str] = field(default_factory=dict)
    stop_settings: tuple[str, ...] = ()
    stops_by_command: bool = False
    east_m: float = 0.0
    north_m: float = 0.0
    altitude_m: float = 3.0
    acceleration_m_s2: float = 0.0


Ask = Callable[[Outgoing, Callable[[Measurement], bool]], Measurement | None]
"""Sends a request, repeatedly if necessary, until a reply fits; returns None without one."""


class Profile(ABC):
    """Profile of one autopilot, as data and pure functions: it decides what is sent, not when. The defaults are those
    of autopilots that fly by modes, without a flight plan in blocks, and execute Land and the command that stops the
    motors in every mode."""

    name: ClassVar[str]
    title: ClassVar[str]
    experiments: ClassVar[tuple[str, ...]]
    """Experiments that tune its gains, the default first."""
    dialect: ClassVar[Dialect]
    autopilot: ClassVar[int]
    """MAV_AUTOPILOT in its heartbeats."""
    heartbeat_s: ClassVar[float] = 1.0
    lift_off_s: ClassVar[float]
    """Time after the takeoff command for which it may still stand on the ground."""
    land_again_s: ClassVar[float] = 1.0
    """Interval at which Land may be repeated, if every command restarts the landing: the time that the landing takes on
    the ground to end."""
    climbs_from_ground: ClassVar[bool] = True
    """Whether the altitude commanded is above the place of takeoff, rather than above the autopilot's origin."""
    reference: ClassVar[ReferenceSource]
    """Where its own reference comes from."""
    holds_first: ClassVar[bool] = True
    """Whether it must hold its first set point by position targets (`Action.HOLD`) before it flies to others."""
    flying_modes: ClassVar[frozenset[str]]
    following_modes: ClassVar[frozenset[str]]
    """Modes that it may be in once it follows set points."""
    hovering_modes: ClassVar[frozenset[str]] = frozenset()
    """Flying modes that it enters after the climb; none if it climbs and hovers in one mode."""
    landing_modes: ClassVar[frozenset[str]]
    automatic_modes: ClassVar[frozenset[str]]
    """Modes in which it flies by itself. In any other, known or not, a pilot flies it."""
    mode_names: ClassVar[Mapping[str, str]]
    """Display names of its modes by their names in `Heartbeat`; others are displayed by those."""
    modes_without_land: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Modes in which it does not execute Land, with a description of its behaviour in them."""
    arming_blocks: ClassVar[frozenset[str]] = frozenset()
    """Blocks of its flight plan, if it has one, in which it stands on the ground before the takeoff."""
    ground_blocks: ClassVar[tuple[str, ...]] = ()
    """Blocks of its flight plan that set its ground reference, in order: it passes through them by itself, and the
    reference is set once it enters the last; none if arming sets the reference."""
    flying_blocks: ClassVar[frozenset[str]] = frozenset()
    landing_blocks: ClassVar[frozenset[str]] = frozenset()
    landed_blocks: ClassVar[frozenset[str]] = frozenset()
    """Those of them that it enters once it has landed."""
    gain_sets: ClassVar[tuple[GainSet, ...]]
    """The gains by their names in the releases of the autopilot, newest last; in the order of its experiment."""
    stop_settings: ClassVar[tuple[str, ...]] = ()
    """Settings that stop the motors, by their names in the releases; none if a command always does."""
    mode_parameter: ClassVar[ModeParameter | None] = None
    """Its mode as a parameter, if its heartbeats do not distinguish all modes."""
    requirements: ClassVar[tuple[Requirement, ...]] = ()
    set_point_requirements: ClassVar[tuple[Requirement, ...]] = ()
    """Further requirements of flights with several set points."""
    loop_parameters: ClassVar[tuple[tuple[str, ...], ...]] = ()
    """Parameters of its vertical loop for each of `gain_sets`, which are kept with a flight with several set points.
    None if the replica of its loop has no parameters but its gains."""
    may_lack: ClassVar[frozenset[str]] = frozenset()
    """Those of them that some releases lack, whose replica then has their default."""
    parameter_component: ClassVar[int] = AUTOPILOT
    """Component that a PARAM_SET names. Some vehicles, such as MAVSDK's, ignore one to all components (0)."""

    def hover_limits(self, parameters: Mapping[str, float]) -> tuple[float, float] | None:  # noqa: B027 - None by default
        """Return the least and the largest hover throttle that its loop can find in flight with these parameters of it;
        None without such limits: it keeps to what it is told or has learned. Raises VehicleError for a parameter out of
        its range."""

    @abstractmethod
    def measure(self, message: Message) -> Measurement | None: ...

    def explore(self, ask: Ask, target: Target) -> Mapping[str, int]:  # noqa: ARG002 - there are no blocks
        """Return the blocks of the flight plan, if there is one. Raises VehicleError if a required one is missing."""
        return {}

    def conclude(self, target: Target) -> tuple[Outgoing, ...]:  # noqa: ARG002 - nothing was begun
        """Return the messages that end an exploration, successful or not."""
        return ()

    def prepare(self, target: Target, telemetry_hz: float) -> tuple[Step, ...]:  # noqa: ARG002 - none by default
        """Return the steps that request telemetry, without lasting changes."""
        return ()

    def prepare_set_points(self, target: Target) -> tuple[Step, ...]:  # noqa: ARG002 - none by default
        """Return the steps that request the further telemetry of a flight with several set points."""
        return ()

    def make_armable(self, target: Target, mode: str, *, may_arm: bool | None) -> tuple[Step, ...]:  # noqa: ARG002 - arming begins with its mode
        """Return the steps out of a mode in which it does not arm; none for other modes. `may_arm` is what it reports,
        None if nothing."""
        return ()

    def refer_to_ground(self, target: Target) -> tuple[Step, ...]:  # noqa: ARG002 - none by default
        """Return the steps by which its flight plan sets the ground reference anew; none if the plan cannot."""
        return ()

    def take_off_settings(self, target: Target) -> tuple[Setting, ...]:  # noqa: ARG002 - the command contains the altitude
        """Return the parameters required for a takeoff to the altitude of `target`."""
        return ()

    def set_point_settings(self, target: Target) -> tuple[Setting, ...]:  # noqa: ARG002 - none by default
        """Return the further parameters required for a flight with several set points."""
        return ()

    def stream(self, target: Target) -> tuple[Outgoing, ...]:  # noqa: ARG002 - it keeps its target by itself
        """Return the messages that it must receive all the time while it follows set points."""
        return ()

    def version_request(self, target: Target) -> Outgoing | None:  # noqa: B027 - None by default
        """Return the request for its version; None if it sends that unrequested, or never."""

    def checks_request(self, target: Target) -> Outgoing | None:  # noqa: B027 - None by default
        """Return the request to run its arming checks and send the results as events; None if unsupported: failed
        checks are then reported as status texts."""

    @abstractmethod
    def steps(self, action: Action, target: Target) -> tuple[Step, ...]:
        """Return the steps of an action. Raises KeyError if it needs a block of the flight plan that `target` lacks."""

    def set_parameter(self, target: Target, parameter: str, value: float) -> Outgoing:
        """Return the message that sets a floating-point parameter, the type of all gains."""
        return Outgoing(
            "PARAM_SET",
            {
                "target_system": target.aircraft,
                "target_component": self.parameter_component,
                "param_id": parameter,
                "param_value": value,
                "param_type": REAL32,
            },
        )

    def read_parameter(self, target: Target, parameter: str) -> Outgoing:
        return Outgoing(
            "PARAM_REQUEST_READ",
            {"target_system": target.aircraft, "target_component": 0, "param_id": parameter, "param_index": -1},
        )


def list_parameters(target: Target) -> Outgoing:
    return Outgoing("PARAM_REQUEST_LIST", {"target_system": target.aircraft, "target_component": 0})


def read_place(target: Target, place: int) -> Outgoing:
    """Return a request for the parameter at a place in the vehicle's list, which must not be past its end, because
    Paparazzi reads beyond its table."""
    return Outgoing(
        "PARAM_REQUEST_READ",
        {"target_system": target.aircraft, "target_component": 0, "param_id": "", "param_index": place},
    )


def command(target: Target, code: int, *parameters: float) -> Outgoing:
    """Return a COMMAND_LONG; missing parameters are 0."""
    filled = (*parameters, *(0.0 for _ in range(7 - len(parameters))))
    return Outgoing(
        "COMMAND_LONG",
        {
            "target_system": target.aircraft,
            "target_component": 0,
            "command": code,
            "confirmation": 0,
            **{f"param{place + 1}": value for place, value in enumerate(filled)},
        },
    )


def position(message: Message) -> Position:
    """Read LOCAL_POSITION_NED, with altitude positive up."""
    return Position(
        time_boot_s=number(message, "time_boot_ms") / 1000.0,
        altitude_m=-number(message, "z"),
        climb_rate_m_s=-number(message, "vz"),
        north_m=number(message, "x"),
        east_m=number(message, "y"),
    )


def attitude(message: Message) -> Attitude:
    """Read ATTITUDE."""
    return Attitude(math.hypot(number(message, "roll"), number(message, "pitch")))


def heartbeat(message: Message, mode: str) -> Heartbeat | None:
    """Read a HEARTBEAT; None if it is not of the autopilot of a copter."""
    if not is_autopilots_heartbeat(message) or number(message, "type") not in COPTERS:
        return None
    return Heartbeat(
        autopilot=int(number(message, "autopilot")),
        armed=bool(int(number(message, "base_mode")) & ARMED_BIT),
        mode=mode,
        system=source_system(message),
        component=source_component(message),
    )


def battery(message: Message) -> Battery:
    """Read SYS_STATUS, whose voltage is in mV. Since release 1.14 PX4 reports that it may be armed by the health bit
    alone, and nothing while it may not."""
    millivolts = number(message, "voltage_battery")
    present, health = (int(number(message, f"onboard_control_sensors_{bits}")) for bits in ("present", "health"))
    return Battery(
        voltage_v=None if millivolts in _UNKNOWN_MV else millivolts / 1000.0,
        may_arm=bool(health & _PREARM_CHECK) if (present | health) & _PREARM_CHECK else None,
    )


def position_target(target: Target) -> Outgoing:
    """Return SET_POSITION_TARGET_LOCAL_NED: position, and a vertical acceleration if one is fed forward, in the
    vehicle's local frame, whose z points down."""
    unused = dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "yaw", "yaw_rate"), 0.0)
    return Outgoing(
        "SET_POSITION_TARGET_LOCAL_NED",
        {
            "time_boot_ms": 0,
            "target_system": target.aircraft,
            "target_component": target.component,
            "coordinate_frame": _LOCAL_NED,
            "type_mask": WITH_ACCELERATION if target.acceleration_m_s2 else POSITION_ALONE,
            "x": target.north_m,
            "y": target.east_m,
            "z": -target.altitude_m,
            "afz": -target.acceleration_m_s2,
            **unused,
        },
    )


def follow_target(target: Target) -> Step:
    """Return the step that sends a position target until the vehicle reports it."""
    sends = (position_target(target),)
    return Step(sends, awaits=TARGET, attempts=SET_POINT_ATTEMPTS, altitude_m=target.altitude_m)


def altitude_error(message: Message) -> AltitudeError:
    """Read NAV_CONTROLLER_OUTPUT."""
    return AltitudeError(number(message, "alt_error"))


def target_altitude(message: Message) -> TargetAltitude | None:
    """Read POSITION_TARGET_LOCAL_NED; None if it has no altitude."""
    has_none = int(number(message, "type_mask")) & _IGNORES_Z
    return None if has_none else TargetAltitude(-number(message, "z"))


def throttle(message: Message) -> Throttle | None:
    """Read VFR_HUD, whose throttle is in percent; None if it is out of range."""
    return _throttle(number(message, "throttle") / 100.0)


def commanded_throttle(message: Message) -> Throttle | None:
    """Read ATTITUDE_TARGET, whose thrust is a share of full; None if it is out of range or marked as unused."""
    is_unused = int(number(message, "type_mask")) & _THROTTLE_UNUSED
    return None if is_unused else _throttle(number(message, "thrust"), exact=True)


def _throttle(share: float, *, exact: bool = False) -> Throttle | None:
    return Throttle(share, exact) if 0.0 <= share <= 1.0 else None


def parameter(message: Message) -> Parameter:
    count, place = int(number(message, "param_count")), int(number(message, "param_index"))
    in_list = place if 0 <= place < count else None
    return Parameter(text(message, "param_id"), number(message, "param_value"), in_list, count)


def answer(message: Message) -> CommandReply | None:
    """Read COMMAND_ACK; None while the command is in progress."""
    result = int(number(message, "result"))
    if result == _IN_PROGRESS:
        return None
    known = _RESULTS[result] if result < len(_RESULTS) else "unknown"
    return CommandReply(f"command {number(message, 'command'):.0f}", result == _ACCEPTED, f"result {result}, {known}")


def disarm(target: Target, *, forced: bool = False) -> Outgoing:
    """Return the command to disarm; `forced` also in flight, where an autopilot would refuse it."""
    return command(target, ARM_DISARM, 0.0, FORCED if forced else 0.0)


def parse_status_text(message: Message) -> StatusText:
    """Read STATUSTEXT; in MAVLink 2 a long text is sent in chunks, the last of which is not full."""
    chunk = text(message, "text")
    number_of, place = (int(getattr(message, field, 0)) for field in ("id", "chunk_seq"))
    return StatusText(chunk, number_of, place, is_last=not number_of or len(chunk) < _TEXT_LENGTH)


def breach(message: Message) -> FenceBreach | None:
    """Read FENCE_STATUS; None without a breach."""
    kind = int(number(message, "breach_type"))
    return FenceBreach(_FENCES.get(kind, "")) if number(message, "breach_status") else None


def landed_state(message: Message) -> LandedState | None:
    """Read EXTENDED_SYS_STATE; None if the state is undefined or taking off."""
    on_ground = _LANDED_STATES.get(int(number(message, "landed_state")))
    return None if on_ground is None else LandedState(on_ground=on_ground)


def version(message: Message) -> Version | None:
    """Read AUTOPILOT_VERSION: major, minor and patch in one byte each, and the hardware id, preferably the newer and
    longer `uid2`; None if it has neither."""
    packed = int(number(message, "flight_sw_version"))
    release = f"{packed >> 24}.{packed >> 16 & 0xFF}.{packed >> 8 & 0xFF}" if packed else ""
    uid = _hardware_id(message)
    return Version(release, uid) if release or uid else None


def _hardware_id(message: Message) -> str:
    """Return the hardware id in hexadecimal digits; empty if not reported. Raises AttributeError as `number` does."""
    short, long = getattr(message, "uid"), bytes(getattr(message, "uid2"))  # noqa: B009 - the library has no types
    return long.hex() if any(long) else f"{short:016x}" if short else ""


def bytewise_integer(value: float) -> int:
    """Return the 32-bit integer whose bytes are in a float field."""
    return int(struct.unpack("<i", struct.pack("<f", value))[0])


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0]) if math.isfinite(value) else value


Readers = Mapping[str, Callable[[Message], Measurement | None]]

READERS: Final[Readers] = MappingProxyType(
    {
        "ATTITUDE": attitude,
        "LOCAL_POSITION_NED": position,
        "SYS_STATUS": battery,
        "VFR_HUD": throttle,
        "PARAM_VALUE": parameter,
        "COMMAND_ACK": answer,
        "STATUSTEXT": parse_status_text,
        "FENCE_STATUS": breach,
        "EXTENDED_SYS_STATE": landed_state,
        "AUTOPILOT_VERSION": version,
    }
)
"""Readers that most autopilots have in common, by message name."""


def read(readers: Readers, message: Message) -> Measurement | None:
    """Read a message; None if it contains no measurement, or a value that is not finite. Of a position with such a
    value, the time is read."""
    reader = readers.get(message.get_type())
    measurement = None if reader is None else reader(message)
    if measurement is None or _is_finite(measurement):
        return measurement
    return InvalidPosition(measurement.time_boot_s) if isinstance(measurement, Position) else None


def _is_finite(measurement: Measurement) -> bool:
    values = (getattr(measurement, each.name) for each in fields(measurement))
    return all(math.isfinite(value) for value in values if isinstance(value, float))
