"""Frames of telemetry logs (.tlog): both directions of a MAVLink connection, each preceded by its time in µs."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from types import ModuleType
from typing import Final

from app.logs.base import Contents

_STAMP_BYTES: Final = 8
_MAGICS: Final = (0xFE, 0xFD)
_MAGIC: Final = re.compile(rb"[\xfe\xfd]")
_SIGNED: Final = 0x01
_FIRST_US, _LAST_US = 631_152_000_000_000, 4_102_444_800_000_000
"""Time stamps of the years 1990 … 2100."""


@dataclass(frozen=True, slots=True)
class Frame:
    """Location of a frame: its first byte and the one past its last; its message number, sender and payload."""

    start: int
    end: int
    message: int
    system: int
    component: int
    payload: int

    def stamp_s(self, data: Contents) -> float:
        return int.from_bytes(data[self.start - _STAMP_BYTES : self.start], "big") / 1e6


def is_tlog(head: bytes) -> bool:
    """Whether a file with this head is a telemetry log: a plausible time stamp, then the first byte of a frame."""
    return (
        len(head) > _STAMP_BYTES
        and head[_STAMP_BYTES] in _MAGICS
        and _FIRST_US <= int.from_bytes(head[:_STAMP_BYTES], "big") <= _LAST_US
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


def _frame_at(data: Contents, start: int, size: int) -> Frame | None:
    magic, length = data[start], data[start + 1]
    if magic == 0xFE:
        end, payload, sender, message = start + 8 + length, start + 6, start + 3, data[start + 5]
    elif magic == 0xFD:
        end, payload, sender = start + 12 + length, start + 10, start + 5
        end += 13 if data[start + 2] & _SIGNED else 0
        message = int.from_bytes(data[start + 7 : start + 10], "little")
    else:
        return None
    following = end + _STAMP_BYTES
    if end > size or (following < size and data[following] not in _MAGICS):
        return None
    return Frame(start, end, message, data[sender], data[sender + 1], payload)


def is_whole(dialect: ModuleType, data: Contents, frame: Frame, extra: bytes) -> bool:
    """Whether the checksum is correct; pymavlink's own decoding takes ten times as long."""
    past = _past_payload(data, frame)
    checksum = int.from_bytes(data[past : past + 2], "little")
    return bool(dialect.x25crc(data[frame.start + 1 : past] + extra).crc == checksum)


def _past_payload(data: Contents, frame: Frame) -> int:
    return frame.payload + data[frame.start + 1]


def payload_of(data: Contents, frame: Frame, size: int) -> bytes:
    """The payload, zero-padded: MAVLink 2 truncates trailing zeros."""
    return data[frame.payload : _past_payload(data, frame)][:size].ljust(size, b"\0")
