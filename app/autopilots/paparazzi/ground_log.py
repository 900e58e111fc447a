"""Messages of Paparazzi's ground logs (.data): one per line, with the time in seconds, the aircraft's number, the
message's name and its fields, separated by blanks.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.paparazzi.replica.loop_log import FIELDS, LoopLog
from app.autopilots.recording import increasing
from app.core.control.vertical_guidance import INT32_MAX, INT32_MIN
from app.logs.base import refused
from app.logs.formats import is_ground_log

_MAX_SAMPLES: Final = 2_000_000
_MAX_LINE_BYTES: Final = 4096
_WANTED: Final = frozenset({b"VERT_LOOP", b"ROTORCRAFT_FP", b"DL_VALUE"})
HINT: Final = "Use the .data file of Paparazzi's ground log, with VERT_LOOP or ROTORCRAFT_FP in it."


@dataclass(slots=True)
class GroundLog:
    """Messages of one aircraft: the first one that reports its altitude."""

    aircraft: str = ""
    others: set[str] = field(default_factory=set)
    loop_time_s: "array[float]" = field(default_factory=lambda: array("d"))
    loop: "array[int]" = field(default_factory=lambda: array("q"))
    time_s: "array[float]" = field(default_factory=lambda: array("d"))
    up: "array[int]" = field(default_factory=lambda: array("q"))
    up_speed: "array[int]" = field(default_factory=lambda: array("q"))
    values: list[tuple[float, int, float]] = field(default_factory=list)

    def loop_log(self) -> LoopLog:
        """The samples whose time increases."""
        time_s, values = np.array(self.loop_time_s), np.array(self.loop, dtype=np.int64).reshape(-1, len(FIELDS))
        return LoopLog(time_s, values).part(increasing(time_s))


def read_lines(stream: BinaryIO) -> GroundLog:
    """Parse the stream; lines other than these messages are skipped."""
    lines = GroundLog()
    stream.seek(0)
    if not is_ground_log(stream.read(_MAX_LINE_BYTES)):
        raise refused("does not start with a line of time, aircraft and message", HINT)
    stream.seek(0)
    while line := stream.readline(_MAX_LINE_BYTES):
        fields = line.split(maxsplit=3)
        if len(fields) == 4 and fields[2] in _WANTED:
            _take(lines, fields[0], fields[1].decode("ascii", "replace")[:32], fields[2], fields[3].split())
    return lines


def _take(lines: GroundLog, time: bytes, aircraft: str, message: bytes, fields: Sequence[bytes]) -> None:
    time_s = number_in(time)
    if not np.isfinite(time_s) or (lines.aircraft and aircraft != lines.aircraft):
        lines.others.update([aircraft] if len(lines.others) < 5 and aircraft != lines.aircraft else [])
        return
    if message == b"VERT_LOOP" and len(lines.loop_time_s) < _MAX_SAMPLES:
        if (numbers := _whole(fields, len(FIELDS))) is not None:
            lines.loop_time_s.append(time_s)
            lines.loop.extend(numbers)
            lines.aircraft = aircraft
    elif message == b"ROTORCRAFT_FP" and len(lines.time_s) < _MAX_SAMPLES:
        if (numbers := _whole(fields, 6)) is not None:
            lines.time_s.append(time_s)
            lines.up.append(numbers[2])
            lines.up_speed.append(numbers[5])
            lines.aircraft = aircraft
    elif message == b"DL_VALUE" and lines.aircraft and len(fields) == 2 and len(lines.values) < _MAX_SAMPLES:
        number, value = _whole(fields, 1), number_in(fields[1])
        if number is not None and np.isfinite(value):
            lines.values.append((time_s, number[0], value))


def _whole(fields: Sequence[bytes], count: int) -> list[int] | None:
    """The first fields as 32-bit integers; None if there are fewer, or other values."""
    if len(fields) < count:
        return None
    try:
        numbers = [int(each) for each in fields[:count]]
    except ValueError:
        return None
    return numbers if min(numbers) >= INT32_MIN and max(numbers) <= INT32_MAX else None


def number_in(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
