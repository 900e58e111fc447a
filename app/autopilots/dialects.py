"""The supported MAVLink dialects, and the only module that uses the untyped MAVLink library.

The library's connection layer (mavutil) is not used: it changes the protocol version of the whole process when one
frame of MAVLink 2 arrives.

MAVLink 2 can be signed: frames contain a keyed hash, and frames without a valid one count as bad data. Both ends have
the same key of 32 bytes. MAVLink 1, and so Paparazzi, has no signing.
"""

import datetime as dt
import importlib
import struct
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, Final, Protocol

from app.core.errors import InputError, Problem

FieldValue = float | int | str | bytes | Sequence[float]

GROUND_STATION: Final = 255
"""System id of this program."""
BAD_DATA: Final = "BAD_DATA"
UNKNOWN: Final = "UNKNOWN_"
NO_AUTOPILOT: Final = 8
_MAVLINK_1: Final = 0xFE
_SPENT_BYTES: Final = 4096
_KEY_BYTES: Final = 32
_EPOCH_NS: Final = int(dt.datetime(2015, 1, 1, tzinfo=dt.UTC).timestamp()) * 10**9
_TICK_NS: Final = 10_000


class Message(Protocol):
    """One MAVLink message of the library. Its fields are attributes; `number` and `text` read them with a type."""

    def get_type(self) -> str: ...
    def get_srcSystem(self) -> int: ...  # noqa: N802  the library's name
    def get_srcComponent(self) -> int: ...  # noqa: N802
    def get_msgbuf(self) -> bytearray: ...
    def get_fieldnames(self) -> list[str]: ...


class _Packable(Message, Protocol):
    def pack(self, mav: object) -> bytes: ...


def number(message: Message, field: str) -> float:
    """Return the value of a numeric field. Raises AttributeError if the message has no such field."""
    return float(getattr(message, field))


def text(message: Message, field: str) -> str:
    """Return the value of a text field, without its padding of zeros. Raises AttributeError as `number` does."""
    value = getattr(message, field)
    return value.decode("ascii", errors="replace").rstrip("\0") if isinstance(value, bytes) else str(value)


def is_known(message: Message) -> bool:
    """Whether the dialect knows the message: it is neither noise nor a newer id, whose checksum cannot be verified."""
    return message.get_type() != BAD_DATA and not message.get_type().startswith(UNKNOWN)


def is_autopilots_heartbeat(message: Message) -> bool:
    """Whether this is a heartbeat of an autopilot, not of a gimbal, a companion computer or another ground station."""
    return message.get_type() == "HEARTBEAT" and number(message, "autopilot") != NO_AUTOPILOT


def source_system(message: Message) -> int:
    """Return the sender's system id from the frame, because the library does not provide it for unknown messages."""
    frame = message.get_msgbuf()
    return frame[3] if frame[0] == _MAVLINK_1 else frame[5]


def source_component(message: Message) -> int:
    """Return the sender's component id from the frame, for the same reason."""
    frame = message.get_msgbuf()
    return frame[4] if frame[0] == _MAVLINK_1 else frame[6]


def sequence(message: Message) -> int:
    """Return the sender's sequence number (0 to 255) from the frame, for the same reason."""
    frame = message.get_msgbuf()
    return frame[2] if frame[0] == _MAVLINK_1 else frame[4]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """A set of messages and the MAVLink version that carries them."""

    name: str
    module: str
    mavlink: int
    """Version sent, 1 or 2. Both are received."""
    uses_gcs_heartbeats: bool = True
    """Whether this autopilot needs heartbeats of a ground station."""
    uncounted: tuple[str, ...] = ()
    """Prefixes of the names of messages that have a separate sequence counter."""
    plan: str = ""
    """Name of the message that describes an item, numbered `seq`, of the plan that the vehicle's commands refer to."""

    @property
    def library(self) -> ModuleType:
        """Loaded when it is first used, because a dialect contains a thousand classes."""
        return _load(self.module)

    @property
    def can_sign(self) -> bool:
        return self.mavlink >= 2

    def name_of(self, number: int) -> str:
        """Return the name of the message with this number; empty if the dialect has none."""
        return getattr(self.library.mavlink_map.get(number), "msgname", "")

    def message(self, kind: str, fields: Mapping[str, FieldValue]) -> Message:
        """Return a message ready to be packed; `kind` is its name ("PARAM_SET"), text fields are str or bytes.

        Raises ValueError if the dialect has no such message, or the message cannot contain these fields.
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

    def zeros(self, kind: str) -> dict[str, FieldValue]:
        """Return the fields of the message with this name, all 0."""
        known = _classes(self.module)[kind]
        lengths = zip(known.ordered_fieldnames, known.array_lengths, strict=True)  # type: ignore[attr-defined]
        zeros: dict[str, FieldValue] = dict.fromkeys(known.fieldnames, 0)  # type: ignore[attr-defined]
        zeros.update((name, [0] * length) for name, length in lengths if length)
        return zeros | dict.fromkeys(_capacities(known), "")

    def codec(self, *, system: int, component: int, signing_key: bytes | None = None) -> "Codec":
        """Return a codec of this dialect. Raises InputError for a signing key with MAVLink 1, or of a wrong length."""
        return Codec(self, system=system, component=component, signing_key=signing_key)


def read_key(file: Path) -> bytes:
    """Read a signing key of 64 hexadecimal digits. Raises InputError, which does not contain the text: it is secret."""
    try:
        text = file.expanduser().read_text(encoding="ascii")
    except (OSError, ValueError) as error:
        raise InputError(
            "The signing key cannot be read.",
            problems=(Problem("signing_key_file", f"names a file that cannot be read ({type(error).__name__})"),),
            hint=f"Name a file with {2 * _KEY_BYTES} hexadecimal digits that this user can read.",
        ) from error
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    _check_key(key)
    return key


def _check_key(key: bytes) -> None:
    if len(key) != _KEY_BYTES:
        raise InputError(
            "This is not a signing key.",
            problems=(
                Problem("signing_key", f"must be {_KEY_BYTES} bytes, written as {2 * _KEY_BYTES} hexadecimal digits"),
            ),
            hint="Create one with: openssl rand -hex 32",
        )


def signing_time() -> int:
    """Return the time in units of 10 µs since 2015, as in signatures."""
    return (time.time_ns() - _EPOCH_NS) // _TICK_NS


class Codec:
    """Codec of one link: packs with its own identity and sequence numbers, and parses a stream of bytes.

    One thread may pack while another parses, because they use separate states of the library.
    """

    def __init__(self, dialect: Dialect, *, system: int, component: int, signing_key: bytes | None) -> None:
        if signing_key is not None and not dialect.can_sign:
            raise InputError(
                f"The dialect {dialect.name} cannot be signed.",
                problems=(Problem("signing_key", "needs MAVLink 2"),),
                hint="Remove the signing key, and protect the vehicle's network instead.",
            )
        library = _load(dialect.module)
        self._out = library.MAVLink(None, srcSystem=system, srcComponent=component)
        self._in = library.MAVLink(None)
        self._in.robust_parsing = True
        if signing_key is not None:
            _check_key(signing_key)
            for state in (self._out.signing, self._in.signing):  # both sign, and accept only what is signed
                state.secret_key = signing_key
                state.sign_outgoing = True
                state.timestamp = signing_time()

    def pack(self, message: Message) -> bytes:
        """Return the frame of `message` (of `Dialect.message`), with the next sequence number, signed if there is a
        key: with the time, or the latest one seen from the other end if that is ahead, for times must not go back or
        repeat."""
        out = self._out.signing
        if out.sign_outgoing:
            out.timestamp = max(out.timestamp, self._in.signing.timestamp, signing_time())
        packable: _Packable = message  # type: ignore[assignment]  # every message of the library has `pack`
        frame = packable.pack(self._out)
        self._out.seq = (self._out.seq + 1) % 256
        return frame

    def parse(self, data: bytes) -> list[Message]:
        """Return every message that `data` completes, including noise as BAD_DATA; never raises for received data."""
        found: list[Message] = []
        while (message := self._next(data)) is not None:
            found.append(message)
            data = b""
        if self._in.buf_index > _SPENT_BYTES:  # the library frees its buffer only when it is empty
            del self._in.buf[: self._in.buf_index]
            self._in.buf_index = 0
        return found

    def _next(self, data: bytes) -> Message | None:
        """Return the next message that `data` completes, or None.

        The library stores the time stamp of a frame before it has checked the signature. After one corrupt or forged
        frame, all later frames could be refused as old. So the time stamps are reset after a bad frame.
        """
        times = dict(self._in.signing.stream_timestamps)
        message: Message | None = self._in.parse_char(data)
        if message is not None and message.get_type() == BAD_DATA:
            self._in.signing.stream_timestamps = times
        return message


_MOCAP_MESSAGES: Final = ("ODOMETRY", "VISION_", "ATT_POS_MOCAP")
"""Messages that a bridge may send under the vehicle's system id, with its own sequence numbers."""

PAPARAZZI: Final = Dialect(
    name="paparazzi",
    module="pymavlink.dialects.v10.paparazzi",
    mavlink=1,
    uses_gcs_heartbeats=False,
    uncounted=("SCRIPT_", "MISSION_", *_MOCAP_MESSAGES),
    plan="SCRIPT_ITEM",
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
"""Fields in wire order. CRC_EXTRA, 160, follows from these names and types."""
_EVENT_ARGUMENTS: Final = 40


@cache
def _load(module: str) -> ModuleType:
    library = importlib.import_module(module)
    if module == COMMON.module:
        library.mavlink_map.setdefault(_EVENT, _event_of(library))
    return library


def _event_of(library: ModuleType) -> type:
    """Return the class of EVENT (https://mavlink.io/en/messages/common.html#EVENT), which the library lacks."""
    names = list(_EVENT_FIELDS)

    def __init__(self: Any, *values: object, **named: object) -> None:  # noqa: N807 - method of the class created below
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
    """Return the capacity of each text field, in characters."""
    kinds = dict(zip(known.fieldnames, known.fieldtypes, strict=True))  # type: ignore[attr-defined]
    lengths = zip(known.ordered_fieldnames, known.array_lengths, strict=True)  # type: ignore[attr-defined]
    return {name: length for name, length in lengths if kinds[name] == "char"}


def _wire(known: type, name: str, value: FieldValue) -> FieldValue:
    """Convert a field for the library: text to bytes. Raises ValueError for text that it would silently truncate."""
    encoded = value.encode("ascii") if isinstance(value, str) else value
    capacity = _capacities(known).get(name)
    if capacity is not None and isinstance(encoded, bytes) and len(encoded) > capacity:
        raise ValueError(f"{name} holds {capacity} characters, got {value!r}")
    return encoded
