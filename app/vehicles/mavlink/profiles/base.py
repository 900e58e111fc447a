"""What is particular to an autopilot: its gains, what its messages mean, and the messages that it wants."""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Final, Protocol

from app.core.errors import GainsError, Problem
from app.core.policy import Gains, shortened
from app.vehicles.mavlink.dialects import (
    Dialect,
    FieldValue,
    Message,
    is_autopilots_heartbeat,
    number,
    source_component,
    source_system,
    text,
)
from app.vehicles.mavlink.events import (
    Action,
    Battery,
    CommandReply,
    FenceBreach,
    Heartbeat,
    LandedState,
    Measurement,
    Parameter,
    Position,
    Setting,
    StatusText,
    Version,
)

ARMED_BIT: Final = 128
ARM_DISARM: Final = 400
COPTERS: Final = frozenset({0, 2, 3, 4, 13, 14, 15, 29, 35, 43})
"""MAV_TYPE of what hovers: quadrotor, coaxial, helicopter, 6, 8, 3, 12 and 10 rotors, any; or not told."""
FORCED: Final = 21196.0
"""The second parameter of 400 that stops motors in the air."""
REAL32: Final = 9
AUTOPILOT: Final = 1
"""The component id that autopilots have unless somebody changed it."""
_FENCES: Final = MappingProxyType({1: "its least altitude", 2: "its greatest altitude", 3: "its boundary"})
"""FENCE_BREACH."""
_LANDED_STATES: Final = MappingProxyType({1: True, 2: False, 4: False})
"""MAV_LANDED_STATE: on the ground, in the air, landing."""
_PREARM_CHECK: Final = 1 << 28
"""Among the sensors of SYS_STATUS: MAV_SYS_STATUS_PREARM_CHECK."""
_TEXT_LENGTH: Final = 50
_ACCEPTED: Final = 0
_IN_PROGRESS: Final = 5
_RESULTS: Final = ("accepted", "temporarily rejected", "denied", "unsupported", "failed", "in progress", "cancelled")
_UNKNOWN_MV: Final = (0.0, 65535.0)


@dataclass(frozen=True, slots=True)
class GainParameter:
    """A gain by its name here and on the vehicle, the values that may be written (autopilots take any), and the
    vehicle's own number for a gain of 1. `whole`: the vehicle keeps the integer part only. `integrates`: writing it may
    clear an integrator, so it comes last when the vehicle is in the air."""

    gain: str
    parameter: str
    lower: float
    upper: float
    factor: float = 1.0
    whole: bool = False
    integrates: bool = False

    def sent(self, value: float) -> float:
        """What goes on the wire: single precision."""
        return _single(value * self.factor)

    def read(self, wire: float, asked: float | None = None) -> float:
        """What the vehicle holds, to the seven digits of single precision; the very number that was asked where it is
        that one."""
        if self.whole:
            return int(wire)
        return asked if asked is not None and wire == self.sent(asked) else float(f"{wire / self.factor:.7g}")

    def refusal(self, value: float) -> str | None:
        """Why this value may not be written, or None when it may."""
        if not self.lower <= value <= self.upper:
            return f"must lie in {self.lower:g} … {self.upper:g}, got {shortened(value)}"
        return f"must be a whole number of counts, got {value:g}" if self.whole and value != int(value) else None


GainSet = tuple[GainParameter, ...]


def check_gains(gains: Gains, gain_set: GainSet) -> dict[str, float]:
    """The gains, complete and in order. Raises GainsError for those that may not be written: no autopilot checks."""
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
    """A failsafe that has to be on before a flight: a parameter with one of these values, or any but zero."""

    parameter: str
    what: str
    values: frozenset[float] = frozenset()

    def is_met(self, value: float) -> bool:
        return value in self.values if self.values else value != 0.0


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send, by its name and fields."""

    kind: str
    fields: Mapping[str, FieldValue]


@dataclass(frozen=True, slots=True)
class Step:
    """Messages that belong together, and the reply that ends the step (see `Reply.to`), asked for up to `attempts`
    times; without one the step ends after `pause_s`. What is not `needed` may be refused, or not answered."""

    sends: tuple[Outgoing, ...]
    awaits: str = ""
    attempts: int = 5
    pause_s: float = 0.0
    needed: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Whom messages go to, and what is known about it: `component` is its autopilot's, 0 until it is known; `aircraft`
    is the number that Paparazzi matches most messages with, `blocks` are its flight plan's by name, `stop_settings`
    those settings that stop its motors which it was found to have, `stops_by_command` whether it was heard to obey the
    command that does; east and north say where it stands."""

    system: int
    aircraft: int
    component: int = 0
    waypoint: int = 2
    blocks: Mapping[str, int] = field(default_factory=dict)
    stop_settings: tuple[str, ...] = ()
    stops_by_command: bool = False
    east_m: float = 0.0
    north_m: float = 0.0
    altitude_m: float = 3.0


Ask = Callable[[Outgoing, Callable[[Measurement], bool]], Measurement | None]
"""Send, again if need be, until an answer fits; None when there is none."""


class Profile(Protocol):
    """One autopilot. Pure data and pure functions: what is sent is decided here, when is decided elsewhere."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def experiment(self) -> str:
        """The one that tunes its gains."""
        ...

    @property
    def dialect(self) -> Dialect: ...
    @property
    def autopilot(self) -> int:
        """The number of its make in a heartbeat."""
        ...

    @property
    def heartbeat_s(self) -> float: ...
    @property
    def lift_off_s(self) -> float:
        """How long after the command it may still stand on the ground."""
        ...

    @property
    def land_again_s(self) -> float:
        """How long a landing takes on the ground to be over, where every order to land begins it anew."""
        ...

    @property
    def climbs_from_ground(self) -> bool:
        """Whether the altitude commanded is above the place of take-off, rather than above the autopilot's origin."""
        ...

    @property
    def flying_modes(self) -> frozenset[str]: ...
    @property
    def hovering_modes(self) -> frozenset[str]:
        """Those of the flying modes that it goes into once it has climbed; none where one mode serves for both."""
        ...

    @property
    def landing_modes(self) -> frozenset[str]: ...
    @property
    def manual_modes(self) -> frozenset[str]:
        """In which a person flies it."""
        ...

    @property
    def mode_names(self) -> Mapping[str, str]:
        """What people call its modes, by what a heartbeat names them; one that is not here goes by that."""
        ...

    @property
    def deaf_modes(self) -> Mapping[str, str]:
        """Those in which it obeys no order to land, with what it does in them."""
        ...

    @property
    def arming_blocks(self) -> frozenset[str]:
        """Of its flight plan, where it has one: in which it stands on the ground before the take-off."""
        ...

    @property
    def flying_blocks(self) -> frozenset[str]: ...
    @property
    def landing_blocks(self) -> frozenset[str]: ...
    @property
    def gain_sets(self) -> tuple[GainSet, ...]:
        """The gains under the names that releases have for them, newest last."""
        ...

    @property
    def stop_settings(self) -> tuple[str, ...]:
        """Settings that stop the motors, by the names that releases have for them; none where a command always does."""
        ...

    @property
    def requirements(self) -> tuple[Requirement, ...]: ...
    def measure(self, message: Message) -> Measurement | None: ...
    def explore(self, ask: Ask, aim: Target) -> Mapping[str, int]:
        """The blocks of the flight plan, where there is one. Raises VehicleError when one is missing that is needed."""
        ...

    def conclude(self, aim: Target) -> tuple[Outgoing, ...]:
        """What ends an exploration, however it went."""
        ...

    def prepare(self, aim: Target, telemetry_hz: float) -> tuple[Step, ...]:
        """Ask for telemetry, which changes nothing that lasts."""
        ...

    def make_armable(self, aim: Target, mode: str) -> tuple[Step, ...]:
        """What brings a disarmed vehicle out of a mode in which it does not arm; nothing for other modes."""
        ...

    def take_off_settings(self, aim: Target) -> tuple[Setting, ...]:
        """Parameters that have to be so for a take-off to the altitude of `aim`."""
        ...

    def ask_version(self, aim: Target) -> Outgoing | None:
        """None where it tells unasked, or never."""
        ...

    def ask_checks(self, aim: Target) -> Outgoing | None:
        """Have it run its own checks before arming and tell the results by events; None where it knows none."""
        ...

    def steps(self, action: Action, aim: Target) -> tuple[Step, ...]:
        """Raises KeyError when it takes a block of the flight plan that `aim` does not have."""
        ...

    def set_parameter(self, aim: Target, parameter: str, value: float) -> Outgoing: ...
    def read_parameter(self, aim: Target, parameter: str) -> Outgoing: ...


def set_parameter(aim: Target, parameter: str, value: float, *, component: int = 0) -> Outgoing:
    """A floating-point parameter, the only type that gains have. Some vehicles heed no PARAM_SET to all components (0),
    among them MAVSDK's."""
    return Outgoing(
        "PARAM_SET",
        {
            "target_system": aim.aircraft,
            "target_component": component,
            "param_id": parameter,
            "param_value": value,
            "param_type": REAL32,
        },
    )


def read_parameter(aim: Target, parameter: str) -> Outgoing:
    return Outgoing(
        "PARAM_REQUEST_READ",
        {"target_system": aim.aircraft, "target_component": 0, "param_id": parameter, "param_index": -1},
    )


def list_parameters(aim: Target) -> Outgoing:
    return Outgoing("PARAM_REQUEST_LIST", {"target_system": aim.aircraft, "target_component": 0})


def read_place(aim: Target, place: int) -> Outgoing:
    """A parameter by its place in the vehicle's list, never past its end: Paparazzi reads on behind its table."""
    return Outgoing(
        "PARAM_REQUEST_READ",
        {"target_system": aim.aircraft, "target_component": 0, "param_id": "", "param_index": place},
    )


def command(aim: Target, code: int, *parameters: float) -> Outgoing:
    """COMMAND_LONG; what is not given is 0."""
    filled = (*parameters, *(0.0 for _ in range(7 - len(parameters))))
    return Outgoing(
        "COMMAND_LONG",
        {
            "target_system": aim.aircraft,
            "target_component": 0,
            "command": code,
            "confirmation": 0,
            **{f"param{place + 1}": value for place, value in enumerate(filled)},
        },
    )


def position(message: Message) -> Position:
    """LOCAL_POSITION_NED, turned upside down."""
    return Position(
        time_boot_s=number(message, "time_boot_ms") / 1000.0,
        altitude_m=-number(message, "z"),
        climb_rate_m_s=-number(message, "vz"),
        north_m=number(message, "x"),
        east_m=number(message, "y"),
    )


def heartbeat(message: Message, mode: str) -> Heartbeat | None:
    """None where it is not a copter's autopilot's but that of something else on board."""
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
    """SYS_STATUS, whose voltage is in mV."""
    millivolts = number(message, "voltage_battery")
    told, health = (int(number(message, f"onboard_control_sensors_{word}")) for word in ("present", "health"))
    return Battery(
        voltage_v=None if millivolts in _UNKNOWN_MV else millivolts / 1000.0,
        may_arm=bool(health & _PREARM_CHECK) if told & _PREARM_CHECK else None,
    )


def parameter(message: Message) -> Parameter:
    count, place = int(number(message, "param_count")), int(number(message, "param_index"))
    in_list = place if 0 <= place < count else None
    return Parameter(text(message, "param_id"), number(message, "param_value"), in_list, count)


def answer(message: Message) -> CommandReply | None:
    """COMMAND_ACK; None while the vehicle is still at it."""
    result = int(number(message, "result"))
    if result == _IN_PROGRESS:
        return None
    known = _RESULTS[result] if result < len(_RESULTS) else "unknown"
    return CommandReply(f"command {number(message, 'command'):.0f}", result == _ACCEPTED, f"result {result}, {known}")


def disarm(aim: Target, *, forced: bool = False) -> Outgoing:
    """`forced`: in the air too, where an autopilot would refuse it."""
    return command(aim, ARM_DISARM, 0.0, FORCED if forced else 0.0)


def parse_status_text(message: Message) -> StatusText:
    """STATUSTEXT; in MAVLink 2 a long one comes in pieces, the last of which is not full."""
    said = text(message, "text")
    number_of, place = (int(getattr(message, field, 0)) for field in ("id", "chunk_seq"))
    return StatusText(said, number_of, place, is_last=not number_of or len(said) < _TEXT_LENGTH)


def breach(message: Message) -> FenceBreach | None:
    """FENCE_STATUS."""
    kind = int(number(message, "breach_type"))
    return FenceBreach(_FENCES.get(kind, "")) if number(message, "breach_status") else None


def landed_state(message: Message) -> LandedState | None:
    """EXTENDED_SYS_STATE; None where the vehicle does not know, or is only about to take off."""
    told = _LANDED_STATES.get(int(number(message, "landed_state")))
    return None if told is None else LandedState(on_ground=told)


def version(message: Message) -> Version | None:
    """AUTOPILOT_VERSION: a byte each for major, minor and patch, and the hardware's id, of which the longer `uid2` is
    the newer; None where neither is told."""
    packed = int(number(message, "flight_sw_version"))
    told = f"{packed >> 24}.{packed >> 16 & 0xFF}.{packed >> 8 & 0xFF}" if packed else ""
    uid = _hardware_id(message)
    return Version(told, uid) if told or uid else None


def _hardware_id(message: Message) -> str:
    """In hexadecimal digits; empty where it is not told. Raises AttributeError as `number` does."""
    short, long = getattr(message, "uid"), bytes(getattr(message, "uid2"))  # noqa: B009 - the library has no types
    return long.hex() if any(long) else f"{short:016x}" if short else ""


def bytewise_integer(value: float) -> int:
    """The 32-bit integer whose bytes a float field carries."""
    return int(struct.unpack("<i", struct.pack("<f", value))[0])


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0]) if math.isfinite(value) else value


Readers = Mapping[str, Callable[[Message], Measurement | None]]

READERS: Final[Readers] = MappingProxyType(
    {
        "LOCAL_POSITION_NED": position,
        "SYS_STATUS": battery,
        "PARAM_VALUE": parameter,
        "COMMAND_ACK": answer,
        "STATUSTEXT": parse_status_text,
        "FENCE_STATUS": breach,
        "EXTENDED_SYS_STATE": landed_state,
        "AUTOPILOT_VERSION": version,
    }
)
"""What most autopilots mean by their messages, by the message's name."""


def read(readers: Readers, message: Message) -> Measurement | None:
    """None for a message that measures nothing, or holds what is no number: no vehicle can be there, and no value is
    that."""
    reader = readers.get(message.get_type())
    measurement = None if reader is None else reader(message)
    return measurement if measurement is not None and _is_finite(measurement) else None


def _is_finite(measurement: Measurement) -> bool:
    values = (getattr(measurement, each.name) for each in fields(measurement))
    return all(math.isfinite(value) for value in values if isinstance(value, float))
