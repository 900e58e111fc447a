"""A MAVLink message to a measurement, the same for a live link and a telemetry log."""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import fields
from types import MappingProxyType
from typing import Final

from app.autopilots.dialects import (
    Message,
    is_autopilots_heartbeat,
    number,
    source_component,
    source_system,
    text,
)
from app.autopilots.measurements import (
    Attitude,
    Battery,
    CommandReply,
    FenceBreach,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    Parameter,
    Position,
    StatusText,
    TargetAltitude,
    Throttle,
    Version,
)

ARMED_BIT: Final = 128
COPTERS: Final = frozenset({0, 2, 3, 4, 13, 14, 15, 29, 35, 43})
"""MAV_TYPE of vehicles that hover: quadrotor, coaxial, helicopter, 6, 8, 3, 12 and 10 rotors, any; and generic."""
_IGNORES_Z: Final = 1 << 2
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


def hardware_id(digits: str) -> str:
    """The id of a board, by which its logs are told from others', in lower-case hexadecimal digits as in `Version.uid`;
    empty for what many vehicles share: no id, or the text that simulations and Linux computers send in place of one.

    Over MAVLink 1, which lacks `uid2`, a board has a shorter id than elsewhere.
    """
    try:
        raw = bytes.fromhex(digits)
    except ValueError:
        return ""
    is_unique = len(set(raw)) >= _FEWEST_BYTES and not raw[_SERIAL].isalnum()
    return raw.hex() if is_unique else ""


UID2_BYTES: Final = 18
_FEWEST_BYTES: Final = 4
"""An id with fewer different bytes is a filler: zeros, 0xFF, or the kind of processor alone."""
_SERIAL: Final = slice(1, 4)
"""Numbers in the ids of processors: the place on the wafer, or the kind of processor."""


def version(message: Message) -> Version | None:
    """Read AUTOPILOT_VERSION: major, minor and patch in one byte each, and the hardware id, preferably the newer and
    longer `uid2`, in hexadecimal digits; None if it has neither."""
    packed = int(number(message, "flight_sw_version"))
    release = f"{packed >> 24}.{packed >> 16 & 0xFF}.{packed >> 8 & 0xFF}" if packed else ""
    short, long = getattr(message, "uid"), bytes(getattr(message, "uid2"))  # noqa: B009 - the library has no types
    uid = uid_of(short.to_bytes(8, "little"), long)
    return Version(release, uid) if release or uid else None


def uid_of(uid: bytes, uid2: bytes) -> str:
    """The hardware id in hexadecimal digits from the fields of AUTOPILOT_VERSION, as bytes; empty if both are 0."""
    return uid2.hex() if any(uid2) else uid[::-1].hex() if any(uid) else ""


def bytewise_integer(value: float) -> int:
    """Return the 32-bit integer whose bytes are in a float field."""
    return int(struct.unpack("<i", struct.pack("<f", value))[0])


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
