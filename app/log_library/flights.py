"""Logged flights in the database: what a model of the flight needs to predict it with other gains, packed.

Version 1: a byte with the version, then zstd level 19 with its checksum over a line of JSON and the columns of all
segments as little-endian int32. They are multiples of a quantum far below what changes a prediction, each as the
difference from the row before, and their four bytes are gathered plane by plane. Not packed, because no prediction
needs them, are the demanded throttle and the climb rate target: they come back as the throttle of the motors and as
what the loop makes of the other columns.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import numpy as np
import zstandard
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from app.autopilots.log_readers import LOOPS, SEGMENTS
from app.common.errors import StorageError
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import InputError
from app.core.models.copter import Copter
from app.core.reasons import Reason, ReasonCode

LARGEST_BYTES: Final = 24 * 1024
_VERSION: Final = b"\x01"
_LARGEST_UNPACKED: Final = 4 * 1024 * 1024
_DERIVED: Final = ("throttle", "v_t_m_s")
_QUANTUM, _QUANTUM_S = 1e-4, 1e-6
"""Of all columns, and of times, which count from the first row."""
_UNKNOWN: Final = np.iinfo(np.int32).min
"""Stands for NaN."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredFlight:
    """A flight as far as it was packed, the copters that it allows, and how many of its segments were left out."""

    flight: LoggedFlight
    copters: Sequence[Copter]
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    """All but the columns: the autopilot, the fields of its loop, and of each segment its kind, when it begins, s, and
    the number of rows of each column."""

    autopilot: str
    loop: dict[str, Any]
    segments: list[tuple[str, float, dict[str, int]]]
    activity: float | None
    lacks: str | None
    copters: list[Copter]
    left_out: int


_HEADER: Final = TypeAdapter(_Header)


def pack_flight(flight: LoggedFlight, copters: Sequence[Copter]) -> bytes:
    """Pack a flight and the copters that it allows into at most 24 KiB: the segments whose altitude changes least are
    left out until they fit, and of the last one its end."""
    kept = [*flight.segments]
    while True:
        packed = _packed(replace(flight, segments=kept), copters, len(flight.segments) - len(kept))
        if len(packed) <= LARGEST_BYTES:
            return packed
        least = int(np.argmin([np.ptp(each.z_d_m) for each in kept]))
        kept[least : least + 1] = [_first_half(kept[least])] if len(kept) == 1 else []


def unpack_flight(content: bytes) -> StoredFlight:
    """Unpack a flight with its loop. Raises StorageError if it is damaged, or was written by another version."""
    try:
        if not content.startswith(_VERSION):
            raise ValueError("another version")
        plain = zstandard.ZstdDecompressor().decompress(content[1:], max_output_size=_LARGEST_UNPACKED)
        line, _, columns = plain.partition(b"\n")
        header = _HEADER.validate_json(line)
        loop = TypeAdapter(LOOPS[header.autopilot]).validate_python(header.loop)
        lacks = None if header.lacks is None else Reason(code=ReasonCode[header.lacks])
        flight = LoggedFlight(loop=loop, segments=[], activity=header.activity, lacks=lacks)
        steps = iter(np.frombuffer(columns, np.uint8).reshape(4, -1).T.copy().view("<i4")[:, 0])
        segments = [_segment(*each, steps, flight) for each in header.segments]
    except (zstandard.ZstdError, ValidationError, InputError, KeyError, TypeError, ValueError) as error:
        raise StorageError(
            "A stored flight cannot be read: it is damaged, or another version of Gainline wrote it.",
            hint="Analyse the log again.",
        ) from error
    return StoredFlight(flight=replace(flight, segments=segments), copters=header.copters, left_out=header.left_out)


def _packed(flight: LoggedFlight, copters: Sequence[Copter], left_out: int) -> bytes:
    loop, lacks = flight.loop, flight.lacks
    columns = [_columns(each) for each in flight.segments]
    header = _Header(
        autopilot=loop.texts.autopilot,
        loop=TypeAdapter(type(loop)).dump_python(loop, mode="json"),
        segments=[
            (type(segment).__name__, float(segment.time_s[0]), {name: len(values) for name, values in packed.items()})
            for segment, packed in zip(flight.segments, columns, strict=True)
        ],
        activity=flight.activity,
        lacks=None if lacks is None else lacks.code.name,
        copters=list(copters),
        left_out=left_out,
    )
    steps = np.concatenate([np.diff(values, prepend=0) for packed in columns for values in packed.values()])
    planes = steps.astype("<i4").view(np.uint8).reshape(-1, 4).T
    plain = _HEADER.dump_json(header) + b"\n" + planes.tobytes()
    return _VERSION + zstandard.ZstdCompressor(level=19, write_checksum=True).compress(plain)


def _scale(name: str, begin_s: float) -> tuple[float, float]:
    """What a column counts from, and its quantum."""
    return (begin_s, _QUANTUM_S) if name.endswith("time_s") else (0.0, _QUANTUM)


def _columns(segment: Segment) -> dict[str, NDArray[np.int32]]:
    """The columns that are packed, as multiples of their quanta."""
    packed = {}
    for name in (each.name for each in fields(segment) if each.name not in _DERIVED):
        origin, quantum = _scale(name, float(segment.time_s[0]))
        multiples = (getattr(segment, name) - origin) / quantum
        packed[name] = np.where(np.isnan(multiples), _UNKNOWN, np.rint(multiples)).astype(np.int32)
    return packed


def _segment(
    kind: str, begin_s: float, rows: dict[str, int], steps: Iterator[np.int32], flight: LoggedFlight
) -> Segment:
    """The segment of the next of these differences, in a flight under the loop."""
    signals = {}
    for name, count in rows.items():
        origin, quantum = _scale(name, begin_s)
        multiples = np.cumsum(np.fromiter(steps, np.int32, count), dtype=np.int32)
        signals[name] = np.where(multiples == _UNKNOWN, np.nan, multiples * quantum) + origin
    segment = SEGMENTS[kind](**signals, throttle=signals["throttle_filtered"], v_t_m_s=signals["time_s"])
    return replace(segment, v_t_m_s=flight.loop.climb_rate_targets(segment))


def _first_half(segment: Segment) -> Segment:
    end_s = segment.time_s[len(segment.time_s) // 2]
    signals = {}
    for name in (each.name for each in fields(segment)):
        time_s = segment.motor_rows[0] if name.startswith("motor_") else segment.time_s
        signals[name] = getattr(segment, name)[time_s <= end_s]
    return replace(segment, **signals)
