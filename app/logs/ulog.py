"""Reader of PX4's logs (.ulg, "ULog").

The file is filtered first: only messages needed for takeoffs, with flat and valid formats, are passed to pyulog. This
bounds memory and time by the flight, whatever a file claims to contain.

A takeoff is detected from the land detector (`vehicle_land_detected`), the arming state and the mode
(`vehicle_status`). A log without them is searched for rises of the altitude, and a note reports this.
"""

import io
import re
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, BinaryIO, Final

import numpy as np

from app.core.records.trajectory import Samples
from app.logs.base import PX4_SETS, Contents, Table, contents, names_in, numbers, refused, rows_of
from app.logs.takeoffs import FlightLog, LogEvent, Setting, Span

if TYPE_CHECKING:
    from pyulog import ULog

_MAGIC: Final = b"ULog\x01\x12\x35"
_HEADER_BYTES: Final = 16
_SYNC: Final = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_TYPES: Final = frozenset(b"BFIMPQARDLCSO")
_LARGEST_MESSAGE: Final = 10_000
_LARGEST_ARRAY: Final = 64
_MAX_FIELDS: Final = 300
_FIELD: Final = re.compile(r"(u?int(?:8|16|32|64)_t|float|double|bool|char)(?:\[(\d{1,3})\])? (\w+)")
_APPENDED: Final = 0x01

_POSITION, _SET_POINT, _THRUST = "vehicle_local_position", "vehicle_local_position_setpoint", "vehicle_thrust_setpoint"
_BATTERY, _STATUS, _LANDED = "battery_status", "vehicle_status", "vehicle_land_detected"
_COMMAND, _ANSWER = "vehicle_command", "vehicle_command_ack"
_TOPICS: Final = frozenset({_POSITION, _SET_POINT, _THRUST, _BATTERY, _STATUS, _LANDED, _COMMAND, _ANSWER})

_TAKEOFF, _LAND = 22, 21
_ACCEPTED: Final = 0
_ANSWERED_WITHIN_S: Final = 2.0
_TAKEOFF_MODE, _HOVER_MODE = 17, 4
_COMING_DOWN: Final = frozenset({5.0, 12.0, 18.0, 20.0})
"""Return, descend, land, precision landing: no takeoff begins in these modes."""
_ARMED: Final = 2.0
_BOUNCE_S: Final = 2.0
"""Leaving the ground sooner than this after a touchdown is not a new takeoff."""
_MODES: Final[Mapping[float, str]] = {0: "manual", 1: "altitude", 2: "position", 3: "mission", 5: "return", 18: "land"}

_HINT: Final = "Use PX4's .ulg log of the flight, with vehicle_local_position in it."


def is_ulog(head: bytes) -> bool:
    """Whether a file with this head is a ULog."""
    return head.startswith(_MAGIC)


def read_ulog(stream: BinaryIO) -> FlightLog:
    """Read a whole log. Raises TrajectoryError if it contains no altitude."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    data = contents(stream)
    if not is_ulog(data[:_HEADER_BYTES]) or len(data) < _HEADER_BYTES:
        raise refused("is not a ULog file", _HINT)
    sieve = _LogFilter()
    sieve.filter(data)
    try:
        log = ULog(io.BytesIO(sieve.kept))
    except (ULogException, ValueError, KeyError, IndexError, TypeError) as error:
        raise refused(f"is damaged: {error}", _HINT) from error
    topics: dict[str, Table] = {each.name: each.data for each in log.data_list}
    position = topics.get(_POSITION, {})
    if not {"timestamp", "z"} <= position.keys():
        raise refused("contains no vehicle_local_position.z, the altitude", _HINT)
    starts, ends, landings = _moments(topics)
    return FlightLog(
        title="PX4's log (ULog)",
        clock="vehicle",
        time_s=_seconds(position),
        channels=_channels(position, topics),
        from_ground=True,
        gain_sets=PX4_SETS,
        settings=tuple(_settings(log)),
        starts=starts,
        ends=[*ends, *landings],
        landings=landings,
        in_air=_in_air(topics),
        armed=_armed(topics),
        notes=(*_notes(sieve, log), *_missing(topics)),
    )


@dataclass(slots=True)
class _LogFilter:
    """Filters the messages of a log. `damages` counts the sections that were skipped."""

    kept: bytearray = field(default_factory=bytearray)
    damages: int = 0
    _formats: set[str] = field(default_factory=set)
    _subscribed: set[int] = field(default_factory=set)
    _appended: list[int] = field(default_factory=list)

    def filter(self, data: Contents) -> None:
        """Go through all messages; after damage, resume at the next synchronisation mark of the logger."""
        self.kept += _MAGIC + b"\x01" + data[len(_MAGIC) + 1 : _HEADER_BYTES]
        position, size = _HEADER_BYTES, len(data)
        while position + 3 <= size:
            length, kind = data[position] | data[position + 1] << 8, data[position + 2]
            end = position + 3 + length
            if self._appended and end > self._appended[0]:
                position = max(self._appended.pop(0), position)
            elif end > size:
                break
            elif kind not in _TYPES or not 0 < length <= _LARGEST_MESSAGE:
                self.damages += 1
                found = data.find(_SYNC, position + 1)
                position = found + len(_SYNC) if found >= 0 else size
            else:
                if self._is_wanted(kind, data, position + 3, end):
                    self.kept += data[position:end]
                position = end

    def _is_wanted(self, kind: int, data: Contents, start: int, end: int) -> bool:
        if kind == ord("D"):
            return end - start > 2 and (data[start] | data[start + 1] << 8) in self._subscribed
        if kind == ord("O"):
            return end - start == 2
        if kind == ord("F"):
            return self._takes_format(data[start:end])
        if kind == ord("A"):
            return self._subscribes(data[start:end])
        if kind == ord("P"):
            return _is_gain(data[start:end])
        if kind == ord("B"):
            self._flags(data[start:end])
        return False

    def _takes_format(self, body: bytes) -> bool:
        """Whether this is the format of a wanted topic: flat, with unique names, including a time stamp."""
        name, _, described = body.decode("ascii", "replace").partition(":")
        parts = [part for part in described.split(";") if part]
        if name not in _TOPICS or len(parts) > _MAX_FIELDS:
            return False
        found = [_FIELD.fullmatch(part) for part in parts]
        fields = [each.groups() for each in found if each is not None]
        names = [each[2] for each in fields]
        sound = (
            len(fields) == len(parts)
            and len(set(names)) == len(names)
            and ("uint64_t", None, "timestamp") in fields
            and all(size is None or 0 < int(size) <= _LARGEST_ARRAY for _, size, _ in fields)
        )
        if sound:
            self._formats.add(name)
        return sound

    def _subscribes(self, body: bytes) -> bool:
        """Whether this subscribes to the first instance of a wanted topic."""
        if len(body) < 4:
            return False
        instance, number, name = body[0], body[1] | body[2] << 8, body[3:].decode("ascii", "replace")
        if instance or name not in self._formats or number in self._subscribed:
            return False
        self._subscribed.add(number)
        return True

    def _flags(self, body: bytes) -> None:
        if len(body) < 40:
            return
        if body[8] & ~_APPENDED or any(body[9:16]):
            raise refused("was written by a newer PX4 in an unsupported format", _HINT)
        offsets = [int.from_bytes(body[at : at + 8], "little") for at in (16, 24, 32)]
        self._appended = sorted(offset for offset in offsets if offset)


def _is_gain(body: bytes) -> bool:
    """Whether a parameter is one of the gains, in PX4's form: "float NAME" and its value."""
    key = body[1 : 1 + body[0]].decode("ascii", "replace")
    kind, _, name = key.partition(" ")
    return kind == "float" and name in names_in(PX4_SETS) and len(body) == 1 + body[0] + 4


def _settings(log: "ULog") -> Iterator[Setting]:
    for name, value in log.initial_parameters.items():
        if np.isfinite(value):
            yield Setting(-np.inf, name, float(value))
    for time_us, name, value in log.changed_parameters:
        if np.isfinite(value):
            yield Setting(time_us / 1e6, name, float(value))


def _channels(position: Table, topics: Mapping[str, Table]) -> dict[str, Samples]:
    """Altitude where the estimator reports it as valid, and the other channels, at the times of the position."""
    time_s, altitude_m = _seconds(position), -numbers(position["z"])
    if "z_valid" in position:
        altitude_m = np.where(numbers(position["z_valid"]) != 0.0, altitude_m, np.nan)
    channels = {"altitude_m": altitude_m}
    if "vz" in position:
        channels["climb_rate_m_s"] = -numbers(position["vz"])
    for channel, topic, name, sign in (
        ("reference_m", _SET_POINT, "z", -1.0),
        ("thrust", _THRUST, "xyz[2]", -1.0),
        ("battery_v", _BATTERY, "voltage_v", 1.0),
    ):
        table = topics.get(topic, {})
        if {"timestamp", name} <= table.keys():
            channels[channel] = np.interp(time_s, _seconds(table), sign * numbers(table[name]))
    return channels


def _moments(topics: Mapping[str, Table]) -> tuple[list[LogEvent], list[LogEvent], list[LogEvent]]:
    """Takeoff commands and modes, those that end a flight, and landings."""
    starts: list[LogEvent] = []
    ends: list[LogEvent] = []
    landings: list[LogEvent] = []
    refusals = [
        (time_s, command)
        for time_s, command, result in rows_of(topics.get(_ANSWER, {}), "timestamp", "command", "result")
        if result
    ]
    for time_s, command in rows_of(topics.get(_COMMAND, {}), "timestamp", "command"):
        refused_at = [at for at, what in refusals if what == command and 0.0 <= at - time_s <= _ANSWERED_WITHIN_S]
        if command in {_TAKEOFF, _LAND} and not refused_at:
            moments, name = (starts, "NAV_TAKEOFF") if command == _TAKEOFF else (ends, "NAV_LAND")
            moments.append(LogEvent(time_s, f"the command {name}"))
    before: float | None = None
    is_armed = _at(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    was_taking_off = False
    for time_s, mode in rows_of(topics.get(_STATUS, {}), "timestamp", "nav_state"):
        takes_off = mode == _TAKEOFF_MODE and is_armed(time_s) in {_ARMED, None}
        if takes_off and not was_taking_off:
            starts.append(LogEvent(time_s, "the takeoff mode"))
        elif before not in {None, mode} and mode not in {_TAKEOFF_MODE, _HOVER_MODE}:
            ends.append(LogEvent(time_s, f"the mode {_MODES.get(mode, f'{mode:g}')}"))
        before, was_taking_off = mode, takes_off
    before = None
    for time_s, landed in rows_of(topics.get(_LANDED, {}), "timestamp", "landed"):
        if landed and before == 0.0:
            landings.append(LogEvent(time_s, "the landing"))
        before = landed
    return starts, ends, landings


def _in_air(topics: Mapping[str, Table]) -> list[Span] | None:
    """Intervals from each lift-off to the touchdown, from the land detector, with the motors armed if that is known.

    A lift-off in a descending mode, or within two seconds of a touchdown (a bounce), is not counted. None without the
    land detector.
    """
    landed = list(rows_of(topics.get(_LANDED, {}), "timestamp", "landed"))
    if not landed:
        return None
    arming = list(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    mode = _at(rows_of(topics.get(_STATUS, {}), "timestamp", "nav_state"))
    is_landed, is_armed = _at(landed), _at(arming)
    times = sorted({time_s for time_s, _ in (*landed, *arming)})
    spans = _spans((time_s, is_landed(time_s) == 0.0 and is_armed(time_s) in {_ARMED, None}) for time_s in times)
    touched_s = [-np.inf, *(span.end_s for span in spans)]
    return [
        span
        for span, before_s in zip(spans, touched_s, strict=False)
        if mode(span.begin_s) not in _COMING_DOWN and span.begin_s - before_s >= _BOUNCE_S
    ]


def _armed(topics: Mapping[str, Table]) -> list[Span] | None:
    """Intervals with the motors armed; None if the log does not report them."""
    arming = list(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    return _spans((time_s, state == _ARMED) for time_s, state in arming) if arming else None


def _spans(states: Iterable[tuple[float, bool]]) -> list[Span]:
    """Intervals in which a condition held, from timed reports of it."""
    spans: list[Span] = []
    since_s: float | None = None
    for time_s, holds in states:
        if holds and since_s is None:
            since_s = time_s
        elif not holds and since_s is not None:
            spans.append(Span(since_s, time_s))
            since_s = None
    return spans if since_s is None else [*spans, Span(since_s, np.inf)]


def _at(rows: Iterable[tuple[float, ...]]) -> Callable[[float], float | None]:
    """A function of time that returns the latest value of these rows (time, value); None before the first."""
    samples = sorted((time_s, value) for time_s, value in rows)
    times = [time_s for time_s, _ in samples]

    def value_at(time_s: float) -> float | None:
        place = bisect_right(times, time_s)
        return samples[place - 1][1] if place else None

    return value_at


def _missing(topics: Mapping[str, Table]) -> Iterator[str]:
    """Notes on missing topics, needed to tell a takeoff from a jump of the altitude, and on the method used instead."""
    has_status = any(True for _ in rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state", "nav_state"))
    if not any(True for _ in rows_of(topics.get(_LANDED, {}), "timestamp", "landed")):
        how = "while it was armed" if has_status else "armed or not"
        yield (
            f"no {_LANDED} in the log, so the takeoff is found from a rise of the altitude, {how}: check that "
            "it is the right flight"
        )
    elif not has_status:
        yield (
            f"no {_STATUS} in the log, so the takeoff is found from the land detector alone: check that it is "
            "the flight"
        )


def _notes(sieve: _LogFilter, log: "ULog") -> Iterator[str]:
    if sieve.damages:
        yield f"{sieve.damages} damaged sections skipped"
    if log.dropouts:
        lost_s = sum(each.duration for each in log.dropouts) / 1000
        yield f"the logger dropped data {len(log.dropouts)} times, {lost_s:.2f} s in total"


def _seconds(table: Table) -> Samples:
    return numbers(table["timestamp"]) / 1e6
