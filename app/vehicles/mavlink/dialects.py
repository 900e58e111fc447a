"""The MAVLink dialects spoken here, and the one place that touches the untyped MAVLink library.

The library's connection layer (mavutil) is not used: it changes the protocol version of the whole process when one
frame of MAVLink 2 arrives.
"""

import importlib
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType, ModuleType
from typing import Any, Final, Protocol

from app.core.errors import InputError, Problem
from app.vehicles.mavlink import signing

FieldValue = float | int | str | bytes | Sequence[float]

BAD_DATA: Final = "BAD_DATA"
UNKNOWN: Final = "UNKNOWN_"
NO_AUTOPILOT: Final = 8
_MAVLINK_1: Final = 0xFE
_SPENT_BYTES: Final = 4096


class Message(Protocol):
    """One MAVLink message of the library. Its fields are attributes; `number` and `text` read them with a type."""

    def get_type(self) -> str: ...
    def get_msgId(self) -> int: ...  # noqa: N802  the library's name
    def get_srcSystem(self) -> int: ...  # noqa: N802
    def get_srcComponent(self) -> int: ...  # noqa: N802
    def get_msgbuf(self) -> bytearray: ...
    def get_fieldnames(self) -> list[str]: ...


class _Packable(Message, Protocol):
    def pack(self, mav: object) -> bytes: ...


def number(message: Message, field: str) -> float:
    """The value of a numeric field. Raises AttributeError when the message has no such field."""
    return float(getattr(message, field))


def text(message: Message, field: str) -> str:
    """The value of a text field, without the zeros that fill it. Raises AttributeError as `number` does."""
    value = getattr(message, field)
    return value.decode("ascii", errors="replace").rstrip("\0") if isinstance(value, bytes) else str(value)


def is_known(message: Message) -> bool:
    """Whether the dialect knows the message: it is neither noise nor a newer id, whose checksum cannot be judged."""
    return message.get_type() != BAD_DATA and not message.get_type().startswith(UNKNOWN)


def is_autopilots_heartbeat(message: Message) -> bool:
    """Not that of a gimbal, a companion computer or another ground station."""
    return message.get_type() == "HEARTBEAT" and number(message, "autopilot") != NO_AUTOPILOT


def source_system(message: Message) -> int:
    """The sender's system id, read from the frame: the library does not tell it for unknown ids."""
    frame = message.get_msgbuf()
    return frame[3] if frame[0] == _MAVLINK_1 else frame[5]


def source_component(message: Message) -> int:
    """The sender's component id, read from the frame for the same reason."""
    frame = message.get_msgbuf()
    return frame[4] if frame[0] == _MAVLINK_1 else frame[6]


def sequence(message: Message) -> int:
    """The sender's sequence number (0 to 255), read from the frame for the same reason."""
    frame = message.get_msgbuf()
    return frame[2] if frame[0] == _MAVLINK_1 else frame[4]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """A set of messages and the MAVLink version that carries them."""

    name: str
    module: str
    mavlink: int
    """1 or 2: the version sent. Both are understood."""
    uses_gcs_heartbeats: bool = True
    """Whether this autopilot wants to hear a ground station's heartbeat."""
    uncounted: tuple[str, ...] = ()
    """Beginnings of the names of messages whose sequence numbers are another counter's."""

    @property
    def can_sign(self) -> bool:
        return self.mavlink >= 2

    def message(self, kind: str, fields: Mapping[str, FieldValue]) -> Message:
        """A message ready to be packed, `kind` its name ("PARAM_SET"), text fields as str or bytes.

        Raises ValueError when the dialect has no such message, or it cannot carry these fields.
        """
        known = _classes(self.module).get(kind)
        if known is None:
            raise ValueError(f"The dialect {self.name} has no message {kind}.")
        try:
            message: _Packable = known(**{name: _wire(known, name, value) for name, value in fields.items()})
            message.pack(_load(self.module).MAVLink(None))
        except (AttributeError, IndexError, OverflowError, TypeError, ValueError, struct.error) as error:
            raise ValueError(f"{kind} cannot carry these fields: {error}") from error
        return message

    def codec(self, *, system: int, component: int, signing_key: bytes | None = None) -> "Codec":
        """One end of a conversation in this dialect. Raises InputError when signing was asked of MAVLink 1."""
        return Codec(self, system=system, component=component, signing_key=signing_key)


class Codec:
    """One end of one conversation: packs with its own identity and sequence numbers, and parses a stream of bytes.

    One thread may pack while another parses, for the library's state of the two is kept apart.
    """

    def __init__(self, dialect: Dialect, *, system: int, component: int, signing_key: bytes | None) -> None:
        if signing_key is not None and not dialect.can_sign:
            raise InputError(
                f"The dialect {dialect.name} cannot be signed.",
                problems=(Problem("signing_key", "needs MAVLink 2"),),
                hint="Leave the signing key away, and keep strangers off the vehicle's network.",
            )
        library = _load(dialect.module)
        self._out = library.MAVLink(None, srcSystem=system, srcComponent=component)
        self._in = library.MAVLink(None)
        self._in.robust_parsing = True
        self._signs = signing_key is not None
        if signing_key is not None:
            signing.enable(self._out.signing, signing_key)
            signing.enable(self._in.signing, signing_key)

    def pack(self, message: Message) -> bytes:
        """The frame of `message` (of `Dialect.message`), with the next sequence number, signed when that was set up."""
        if self._signs:
            signing.refresh(self._out.signing, seen=self._in.signing.timestamp)
        packable: _Packable = message  # type: ignore[assignment]  # every message of the library can
        frame = packable.pack(self._out)
        self._out.seq = (self._out.seq + 1) % 256
        return frame

    def parse(self, data: bytes) -> list[Message]:
        """Every message that `data` completes, noise among them as BAD_DATA; never raises for what comes in."""
        found: list[Message] = []
        while (message := self._next(data)) is not None:
            found.append(message)
            data = b""
        if self._in.buf_index > _SPENT_BYTES:  # the library frees its buffer only when that happens to run empty
            del self._in.buf[: self._in.buf_index]
            self._in.buf_index = 0
        return found

    def _next(self, data: bytes) -> Message | None:
        """The next message that `data` completes.

        The library believes the time stamp of a frame before it has checked the signature: one flipped bit, or one
        forged frame, and everything after it would be refused as old. So what a bad frame said of time is forgotten.
        """
        times = dict(self._in.signing.stream_timestamps)
        message: Message | None = self._in.parse_char(data)
        if message is not None and message.get_type() == BAD_DATA:
            self._in.signing.stream_timestamps = times
        return message


_MOCAP_MESSAGES: Final = ("ODOMETRY", "VISION_", "ATT_POS_MOCAP")
"""What a bridge may say in the vehicle's name, by numbers of its own."""

PAPARAZZI: Final = Dialect(
    name="paparazzi",
    module="pymavlink.dialects.v10.paparazzi",
    mavlink=1,
    uses_gcs_heartbeats=False,
    uncounted=("SCRIPT_", "MISSION_", *_MOCAP_MESSAGES),
)
ARDUPILOTMEGA: Final = Dialect(
    name="ardupilotmega",
    module="pymavlink.dialects.v20.ardupilotmega",
    mavlink=2,
    uncounted=_MOCAP_MESSAGES,
)
COMMON: Final = Dialect(
    name="common",
    module="pymavlink.dialects.v20.common",
    mavlink=2,
    uncounted=_MOCAP_MESSAGES,
)


_EVENT: Final = 410
_EVENT_FIELDS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "id": "uint32_t",
        "event_time_boot_ms": "uint32_t",
        "sequence": "uint16_t",
        "destination_component": "uint8_t",
        "destination_system": "uint8_t",
        "log_levels": "uint8_t",
        "arguments": "uint8_t",
    }
)
"""In the order of the wire. CRC_EXTRA, 160, follows from these names and types."""
_EVENT_ARGUMENTS: Final = 40


@cache
def _load(module: str) -> ModuleType:
    library = importlib.import_module(module)
    if module == COMMON.module:
        library.mavlink_map.setdefault(_EVENT, _event_of(library))
    return library


def _event_of(library: ModuleType) -> type:
    """EVENT (https://mavlink.io/en/messages/common.html#EVENT), which the library leaves out."""
    names = list(_EVENT_FIELDS)

    def __init__(self: Any, *values: object, **named: object) -> None:  # noqa: N807 - of the class that is made here
        library.MAVLink_message.__init__(self, _EVENT, "EVENT")
        self._fieldnames = names
        for name, value in {**dict(zip(names, values, strict=False)), **named}.items():
            setattr(self, name, value)

    def pack(self: Any, mav: object, force_mavlink1: bool = False) -> bytes:
        *scalars, arguments = (getattr(self, name) for name in names)
        payload = self.unpacker.pack(*scalars, *arguments)
        packed: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return packed

    lengths = [1] * (len(names) - 1)
    described = {
        "id": _EVENT,
        "msgname": "EVENT",
        "fieldnames": names,
        "ordered_fieldnames": names,
        "fieldtypes": list(_EVENT_FIELDS.values()),
        "orders": list(range(len(names))),
        "lengths": [*lengths, _EVENT_ARGUMENTS],
        "array_lengths": [*(0 for _ in lengths), _EVENT_ARGUMENTS],
        "crc_extra": 160,
        "unpacker": struct.Struct(f"<IIHBBB{_EVENT_ARGUMENTS}B"),
        "__init__": __init__,
        "pack": pack,
    }
    return type("MAVLink_event_message", (library.MAVLink_message,), described)


@cache
def _classes(module: str) -> Mapping[str, type]:
    return {known.msgname: known for known in _load(module).mavlink_map.values()}


@cache
def _capacities(known: type) -> Mapping[str, int]:
    """How many characters each text field holds."""
    kinds = dict(zip(known.fieldnames, known.fieldtypes, strict=True))  # type: ignore[attr-defined]
    lengths = zip(known.ordered_fieldnames, known.array_lengths, strict=True)  # type: ignore[attr-defined]
    return {name: length for name, length in lengths if kinds[name] == "char"}


def _wire(known: type, name: str, value: FieldValue) -> FieldValue:
    """As the library wants it: text as bytes, and none that it would cut without a word."""
    encoded = value.encode("ascii") if isinstance(value, str) else value
    capacity = _capacities(known).get(name)
    if capacity is not None and isinstance(encoded, bytes) and len(encoded) > capacity:
        raise ValueError(f"{name} holds {capacity} characters, got {value!r}")
    return encoded
