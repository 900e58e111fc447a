"""Logged flights in the database: what a model of the flight needs to predict it with other gains, packed.

Version 1: a byte with the version, then zstd level 19 with its checksum over a line of JSON and the columns of all
segments as little-endian int32. They are multiples of a quantum far below what changes a prediction, each as the
difference from the row before, and their four bytes are gathered plane by plane. Not packed, because no prediction
needs them, are the demanded throttle and the climb rate target: they come back as the throttle of the motors and as
what the loop makes of the other columns. What a motor gets between rows is packed at most 100 times a second.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import zstandard
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from app.autopilots.registry import LOOPS, SEGMENTS
from app.common.errors import StorageError
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import InputError
from app.core.models.copter import Copter
from app.core.reasons import Reason, ReasonCode
from app.core.records.trajectory import Samples

VERSION: Final = 1
LARGEST_BYTES: Final = 24 * 1024
_LARGEST_UNPACKED: Final = 4 * 1024 * 1024
_QUANTA: Final[Mapping[str, float]] = MappingProxyType(
    {
        "time_s": 1e-6,
        "z_m": 1e-4,
        "v_m_s": 1e-4,
        "a_m_s2": 1e-3,
        "z_d_m": 1e-4,
        "v_d_m_s": 1e-4,
        "a_d_m_s2": 1e-3,
        "throttle_filtered": 1e-4,
        "assumed_hover": 1e-4,
        "motor_time_s": 1e-6,
        "motor_values": 1e-4,
    }
)
"""Of each column that is packed; times count from the first row."""
_OF_MOTORS: Final = "motor_"
_MOTORS_EVERY_S: Final = 0.01
_UNKNOWN: Final = np.iinfo(np.int32).min
"""Stands for NaN."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredFlight:
    """A flight as far as it was packed, the copters that it allows, and how many of its segments were left out."""

    flight: LoggedFlight
    copters: Sequence[Copter]
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _PackedSegment:
    """Its kind, when it begins, and the number of rows of each column."""

    kind: str
    begin_s: float
    rows: dict[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Header:
    """All but the columns. `loop` holds the fields of its class."""

    autopilot: str
    loop: dict[str, Any]
    segments: list[_PackedSegment]
    activity: float | None
    assumed: list[str]
    lacks: str | None
    copters: list[Copter]
    left_out: int


_HEADER: Final = TypeAdapter(_Header)


def pack_flight(flight: LoggedFlight, copters: Sequence[Copter]) -> bytes:
    """Pack a flight and the copters that it allows into at most 24 KiB: the segments whose altitude changes least are
    left out until they fit, and of the last one its end."""
    kept, left_out = flight, 0
    while len(packed := _packed(kept, copters, left_out)) > LARGEST_BYTES:
        if len(kept.segments) > 1:
            least = min(kept.segments, key=lambda each: float(np.ptp(each.z_d_m)))
            kept, left_out = replace(kept, segments=[each for each in kept.segments if each is not least]), left_out + 1
        else:
            kept = replace(kept, segments=[_first_half(kept.segments[0])])
    return packed


def unpack_flight(content: bytes) -> StoredFlight:
    """Unpack a flight with its loop. Raises StorageError if it is damaged, or was written by a newer version."""
    if content[:1] != bytes([VERSION]):
        raise StorageError(
            "A stored flight of a log has an unknown version.",
            hint="It was written by a newer Gainline; open it with that version, or analyse the log again.",
        )
    try:
        plain = zstandard.ZstdDecompressor().decompress(content[1:], max_output_size=_LARGEST_UNPACKED)
        line, _, columns = plain.partition(b"\n")
        header = _HEADER.validate_json(line)
        loop = TypeAdapter(LOOPS[header.autopilot]).validate_python(header.loop)
        lacks = None if header.lacks is None else Reason(code=ReasonCode[header.lacks])
        flight = LoggedFlight(loop=loop, segments=[], activity=header.activity, assumed=header.assumed, lacks=lacks)
        values = iter(np.frombuffer(columns, np.uint8).reshape(4, -1).T.copy().view("<i4")[:, 0])
        return StoredFlight(
            flight=replace(flight, segments=[_segment(each, values, flight) for each in header.segments]),
            copters=header.copters,
            left_out=header.left_out,
        )
    except (zstandard.ZstdError, ValidationError, InputError, KeyError, TypeError, ValueError) as error:
        raise StorageError(
            "A stored flight of a log is damaged.", hint="Analyse the log again, or restore the database from a backup."
        ) from error


def _packed(flight: LoggedFlight, copters: Sequence[Copter], left_out: int) -> bytes:
    loop, lacks = flight.loop, flight.lacks
    columns = [_columns(each) for each in flight.segments]
    header = _Header(
        autopilot=loop.texts.autopilot,
        loop=TypeAdapter(type(loop)).dump_python(loop, mode="json"),
        segments=[
            _PackedSegment(
                kind=type(segment).__name__,
                begin_s=float(segment.time_s[0]),
                rows={name: len(values) for name, values in packed.items()},
            )
            for segment, packed in zip(flight.segments, columns, strict=True)
        ],
        activity=flight.activity,
        assumed=list(flight.assumed),
        lacks=None if lacks is None else lacks.code.name,
        copters=list(copters),
        left_out=left_out,
    )
    steps = np.concatenate([np.diff(values, prepend=0) for packed in columns for values in packed.values()])
    planes = steps.astype("<i4").view(np.uint8).reshape(-1, 4).T
    plain = _HEADER.dump_json(header) + b"\n" + planes.tobytes()
    return bytes([VERSION]) + zstandard.ZstdCompressor(level=19, write_checksum=True).compress(plain)


def _columns(segment: Segment) -> dict[str, NDArray[np.int32]]:
    """The columns that are packed, as multiples of their quanta."""
    begin_s, motor_s = segment.time_s[0], segment.motor_rows[0]
    every = np.arange(motor_s[0], motor_s[-1], _MOTORS_EVERY_S)
    motor_rows = np.unique(np.append(np.searchsorted(motor_s, every), len(motor_s) - 1))
    packed = {}
    for each in fields(segment):
        if (quantum := _QUANTA.get(each.name)) is not None:
            values = getattr(segment, each.name)
            values = values[motor_rows] if each.name.startswith(_OF_MOTORS) else values
            multiples = (values - (begin_s if each.name.endswith("time_s") else 0.0)) / quantum
            packed[each.name] = np.where(np.isnan(multiples), _UNKNOWN, np.rint(multiples)).astype(np.int32)
    return packed


def _segment(packed: _PackedSegment, steps: Iterator[np.int32], flight: LoggedFlight) -> Segment:
    """The segment of the next of these differences, in a flight under the loop."""
    signals: dict[str, Samples] = {}
    for name, rows in packed.rows.items():
        multiples = np.cumsum(np.fromiter(steps, np.int32, rows), dtype=np.int32)
        values = np.where(multiples == _UNKNOWN, np.nan, multiples * _QUANTA[name])
        signals[name] = values + packed.begin_s if name.endswith("time_s") else values
    unknown = np.full_like(signals["time_s"], np.nan)
    segment = SEGMENTS[packed.kind](**signals, throttle=signals["throttle_filtered"], v_t_m_s=unknown)
    return replace(segment, v_t_m_s=flight.loop.climb_rate_targets(segment))


def _first_half(segment: Segment) -> Segment:
    end_s = segment.time_s[len(segment.time_s) // 2]
    within, motors_within = (times_s <= end_s for times_s in (segment.time_s, segment.motor_rows[0]))
    names = [each.name for each in fields(segment)]
    signals = {name: getattr(segment, name)[motors_within if name.startswith(_OF_MOTORS) else within] for name in names}
    return replace(segment, **signals)
