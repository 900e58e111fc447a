"""Frames of telemetry logs (.tlog): both directions of a MAVLink connection, each preceded by its time in µs."""

import re
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from types import ModuleType
from typing import Final

import numpy as np

from app.logs.base import Contents

_STAMP_BYTES: Final = 8
_MAGICS: Final = (0xFE, 0xFD)
_MAGIC: Final = re.compile(rb"[\xfe\xfd]")
_SIGNED: Final = 0x01
_FIRST_US, _LAST_US = 631_152_000_000_000, 4_102_444_800_000_000
"""Time stamps of the years 1990 … 2100."""
_NUMBERS: Final = 256
_REMEMBERED: Final = 1024


@dataclass(frozen=True, slots=True)
class Frame:
    """Location of a frame: its first byte and the one past its last; its message number, sender and payload, and its
    number among its sender's frames, which returns after 256."""

    start: int
    end: int
    message: int
    system: int
    component: int
    payload: int
    number: int


@dataclass(frozen=True, slots=True)
class Message:
    """A message without damage: its name, its sender, the ground's time, s, the bytes of the payload, and its fields by
    their names in the dialect, those of an array as "q[0]"."""

    name: str
    system: int
    component: int
    stamp_s: float
    payload: bytes
    fields: Mapping[str, float | bytes]

    def __getitem__(self, field: str) -> float:
        value = self.fields[field]
        return np.nan if isinstance(value, bytes) else float(value)

    def text(self, field: str) -> str:
        raw = self.fields[field]
        return raw.partition(b"\0")[0].decode("ascii", "replace") if isinstance(raw, bytes) else ""


def is_tlog(head: bytes) -> bool:
    """Whether a file with this head is a telemetry log: a plausible time stamp, then the first byte of a frame; or
    three frames in a row, if the clock was not set or the first frame is not whole."""
    is_begun = len(head) > _STAMP_BYTES and head[_STAMP_BYTES] in _MAGICS
    if is_begun and _FIRST_US <= int.from_bytes(head[:_STAMP_BYTES], "big") <= _LAST_US:
        return True
    found = list(frames(head))
    return any(
        third.start - first.end == second.end - second.start + 2 * _STAMP_BYTES
        for first, second, third in zip(found, found[1:], found[2:], strict=False)
    )


def frames(data: Contents) -> Iterator[Frame]:
    """Every frame that is followed by another one, or by the log's end; damaged parts are skipped."""
    position, size = _STAMP_BYTES, len(data)
    while position + 12 <= size:
        frame = _frame_at(data, position, size)
        if frame is None:
            found = _MAGIC.search(data, position + 1)
            position = found.start() if found else size
        else:
            yield frame
            position = frame.end + _STAMP_BYTES


def messages(data: Contents, dialect: ModuleType, names: Collection[str]) -> Iterator[Message]:
    """Every message with one of these names and a correct checksum, of any sender; a frame that came again after later
    ones is left out."""
    wanted = [number for number, known in dialect.mavlink_map.items() if known.msgname in names]
    fields = {number: _fields(dialect, number) for number in wanted}
    newest: dict[tuple[int, int], int] = {}
    recent: deque[bytes] = deque(maxlen=_REMEMBERED)
    for frame in frames(data):
        sender = frame.system, frame.component
        is_late = (frame.number - newest.get(sender, frame.number)) % _NUMBERS >= _NUMBERS // 2
        if not is_late:
            newest[sender] = frame.number
        if frame.message not in fields:
            continue
        known = dialect.mavlink_map[frame.message]
        past = frame.payload + data[frame.start + 1]
        checksum = int.from_bytes(data[past : past + 2], "little")
        if dialect.x25crc(data[frame.start + 1 : past] + bytes([known.crc_extra])).crc == checksum:
            content = data[frame.start : past + 2]
            if is_late and content in recent:
                continue
            recent.append(content)
            newest[sender] = frame.number  # also after a restart
            size = known.unpacker.size  # MAVLink 2 truncates trailing zeros
            payload = data[frame.payload : past][:size].ljust(size, b"\0")
            values = dict(zip(fields[frame.message], known.unpacker.unpack(payload), strict=True))
            stamp_s = int.from_bytes(data[frame.start - _STAMP_BYTES : frame.start], "big") / 1e6
            yield Message(known.msgname, frame.system, frame.component, stamp_s, payload, values)


def _fields(dialect: ModuleType, number: int) -> list[str]:
    """The names of a message's values on the wire."""
    known = dialect.mavlink_map[number]
    lengths = zip(known.ordered_fieldnames, known.lengths, strict=True)
    names = ([name] if length == 1 else [f"{name}[{place}]" for place in range(length)] for name, length in lengths)
    return list(chain.from_iterable(names))


def _frame_at(data: Contents, start: int, size: int) -> Frame | None:
    magic, length = data[start], data[start + 1]
    if magic == 0xFE:
        end, payload, number, message = start + 8 + length, start + 6, start + 2, data[start + 5]
    elif magic == 0xFD:
        end, payload, number = start + 12 + length, start + 10, start + 4
        end += 13 if data[start + 2] & _SIGNED else 0
        message = int.from_bytes(data[start + 7 : start + 10], "little")
    else:
        return None
    following = end + _STAMP_BYTES
    if end > size or (following < size and data[following] not in _MAGICS):
        return None
    return Frame(start, end, message, data[number + 1], data[number + 2], payload, data[number])
