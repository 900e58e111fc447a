"""Paparazzi's ground log to a `Recording`.

A log is a .data file, and its .log companion, XML, with the airframe and the settings. The .data file has one message
per line, with the time in seconds, the aircraft's number, the message's name and its fields, separated by blanks.
VERT_LOOP contains the complete state of the vertical loop, in its own integers; without it the altitude comes from
ROTORCRAFT_FP.
"""

import re
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, pairwise, product
from typing import BinaryIO, Final
from xml.parsers import expat

import numpy as np

from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.paparazzi.replica.loop_log import FIELDS, GAINS, Counts, FlownGains, LoopLog, flown_gains
from app.autopilots.recording import Column, Event, EventKind, Recording, Setting, date_of, increasing
from app.core.control.vertical_guidance import FULL_THRUST, INT32_MAX, INT32_MIN
from app.core.policy import Gains
from app.core.records.trajectory import Samples
from app.logs.base import refused
from app.logs.formats import head_of, is_ground_log

MAX_COMPANION_BYTES: Final = 16 * 2**20
_GAIN: Final = re.compile(r"guidance_v[._]k([pid])", re.IGNORECASE)
_AIRFRAME_GAIN: Final = re.compile(r"(?:GUIDANCE_V_)?HOVER_K([PID])")
_SETTINGS: Final = 256
_LONGEST_NAME: Final = 60
_MOST_CANDIDATES: Final = 32
_PLATEAU_S: Final = 2.0
_MAX_SAMPLES: Final = 2_000_000
_MAX_LINE_BYTES: Final = 4096
_LOOP, _POSITION = b"VERT_LOOP", b"ROTORCRAFT_FP"
_COUNTS: Final[Mapping[bytes, int]] = {_LOOP: len(FIELDS), _POSITION: 6}
"""Number of the fields that are read, all integers."""
_WANTED: Final = frozenset({*_COUNTS, b"DL_VALUE"})
HINT: Final = "Use the .data file of Paparazzi's ground log, with VERT_LOOP or ROTORCRAFT_FP in it."


@dataclass(frozen=True, slots=True, kw_only=True)
class PaparazziRecording(Recording):
    """With the samples of the vertical loop, None if they were not logged, and the gains that its commands follow from;
    `are_logged`: all of these are in the log's files."""

    loop: LoopLog | None
    flown: Sequence[FlownGains]
    are_logged: bool


def read_paparazzi(stream: BinaryIO, companion: BinaryIO | None = None) -> PaparazziRecording:
    """Decode a .data file and its companion, if given. The gains are those that the loop's commands follow from;
    without VERT_LOOP those in the companion, as far as they are certain.

    Raises TrajectoryError if either cannot be read.
    """
    lines = _read_lines(stream)
    configuration = _Configuration(lines.aircraft)
    if companion is not None:
        configuration.read(companion, lines.values)
    loop = LoopLog(*lines.samples(_LOOP)) if lines.times_s[_LOOP] else None
    flown = [] if loop is None else flown_gains(loop, configuration.candidates)
    others = ", ".join(sorted(lines.others)[:5])
    return PaparazziRecording(
        title=f"Paparazzi's ground log of aircraft {lines.aircraft}",
        autopilot=PAPARAZZI,
        clock="ground",
        vehicle_name=configuration.name,
        columns=_columns(lines, loop),
        settings=list(configuration.settings(flown)),
        events=[] if loop is None else list(_events(loop)),
        notes=list(configuration.notes(flown)),
        remarks=[f"other aircraft in the log left out: {others}"] if others else [],
        started_at=date_of(configuration.began_s),
        loop=loop,
        flown=flown,
        are_logged=configuration.contains(flown),
    )


@dataclass(slots=True)
class _GroundLog:
    """Messages of one aircraft: the first one that reports its altitude."""

    aircraft: str = ""
    others: set[str] = field(default_factory=set)
    times_s: "dict[bytes, array[float]]" = field(default_factory=lambda: {each: array("d") for each in _COUNTS})
    counts: "dict[bytes, array[int]]" = field(default_factory=lambda: {each: array("q") for each in _COUNTS})
    values: list[tuple[float, int, float]] = field(default_factory=list)

    def samples(self, message: bytes) -> tuple[Samples, Counts]:
        """Those of a message whose time increases: time, shape (n,), and its first fields, (n, k)."""
        time_s, counts = np.array(self.times_s[message]), np.array(self.counts[message], dtype=np.int64)
        rows = increasing(time_s)
        return time_s[rows], counts.reshape(-1, _COUNTS[message])[rows]


def _read_lines(stream: BinaryIO) -> _GroundLog:
    """Parse the stream; lines other than these messages are skipped."""
    lines = _GroundLog()
    if not is_ground_log(head_of(stream)):
        raise refused("does not start with a line of time, aircraft and message", HINT)
    while line := stream.readline(_MAX_LINE_BYTES):
        fields = line.split(maxsplit=3)
        if len(fields) == 4 and fields[2] in _WANTED:
            _take(lines, fields[0], fields[1].decode("ascii", "replace")[:32], fields[2], fields[3].split())
    return lines


def _take(lines: _GroundLog, time: bytes, aircraft: str, message: bytes, fields: Sequence[bytes]) -> None:
    time_s = _number_in(time)
    if not np.isfinite(time_s) or (lines.aircraft and aircraft != lines.aircraft):
        lines.others.update([aircraft] if len(lines.others) < 5 and aircraft != lines.aircraft else [])
        return
    if message in _COUNTS:
        numbers = _whole(fields, _COUNTS[message])
        if numbers is not None and len(lines.times_s[message]) < _MAX_SAMPLES:
            lines.times_s[message].append(time_s)
            lines.counts[message].extend(numbers)
            lines.aircraft = aircraft
    elif lines.aircraft and len(fields) == 2 and len(lines.values) < _MAX_SAMPLES:
        number, value = _whole(fields, 1), _number_in(fields[1])
        if number is not None and np.isfinite(value):
            lines.values.append((time_s, number[0], value))


def _columns(lines: _GroundLog, loop: LoopLog | None) -> dict[str, Column]:
    """Columns of the loop, and of the position if its message is more frequent."""
    columns = {} if loop is None else _loop_columns(loop)
    if len(lines.times_s[_LOOP]) >= len(lines.times_s[_POSITION]):
        return columns
    time_s, counts = lines.samples(_POSITION)
    return columns | {
        "altitude_m": Column(time_s, counts[:, 2] / 2**8, "ROTORCRAFT_FP.up"),
        "climb_rate_m_s": Column(time_s, counts[:, 5] / 2**19, "ROTORCRAFT_FP.vup"),
    }


def _loop_columns(log: LoopLog) -> dict[str, Column]:
    """Altitudes in metres, positive up; commands as shares of full thrust."""
    channels = {
        "altitude_m": -log["z"] / 2**8,
        "climb_rate_m_s": -log["zd"] / 2**19,
        "set_point_m": -log["z_sp"] / 2**8,
        "reference_m": -log["z_ref"] / 2**8,
        "thrust": log["thrust"] / FULL_THRUST,
        "feed_forward": log["ff_cmd"] / FULL_THRUST,
        "feedback": log["fb_cmd"] / FULL_THRUST,
    }
    return {name: Column(log.time_s, values, "VERT_LOOP") for name, values in channels.items()}


def _events(log: LoopLog) -> Iterator[Event]:
    """The last samples before the reference starts to move by itself; when the loop becomes inactive; and when a set
    point that was held for two seconds changes."""
    idle, set_point = log.idle, log["z_sp"]
    for place in np.flatnonzero(idle[:-1] & ~idle[1:]):
        yield Event(EventKind.TAKEOFF, float(log.time_s[place]), "the reference starting to move")
    for place in np.flatnonzero(~idle[:-1] & idle[1:]):
        yield Event(EventKind.COMMAND, float(log.time_s[place]), "the loop being switched off")
    held_since_s = float(log.time_s[0])
    for place in np.flatnonzero(np.diff(set_point) != 0):
        now_s, is_working = float(log.time_s[place]), not idle[place] and not idle[place + 1]
        if is_working and now_s - held_since_s >= _PLATEAU_S:
            yield Event(EventKind.COMMAND, now_s, f"the set point becoming {-set_point[place + 1] / 2**8:g} m")
        held_since_s = float(log.time_s[place + 1])


@dataclass(slots=True)
class _Configuration:
    """Gains of one aircraft in a .log companion, which may describe several.

    `known` are all values of each gain with the time from which they are known: built in, then reported (DL_VALUE) by
    the setting's number, which counts all settings in the order of the generated file. Newer releases append that to
    the .log. In other logs, some settings are missing and files are in another order, but each group has its own: there
    the numbers of the gains are those whose first values are the gains built in. `is_certain`: the numbers are.
    """

    aircraft: str
    began_s: float = 0.0
    """The ground station's time since 1970 at the beginning of the log."""
    known: dict[str, list[tuple[float, float]]] = field(default_factory=lambda: {gain: [] for gain in GAINS})
    is_certain: bool = True
    is_described: bool = True
    name: str = ""
    _is_mine: bool = False
    _groups: list[list[str]] = field(default_factory=lambda: [[]])
    _generated: list[str] | None = None

    @property
    def candidates(self) -> list[Gains]:
        """Gain sets of all values."""
        sets = product(*({value for _, value in self.known[gain]} for gain in GAINS))
        return [dict(zip(GAINS, each, strict=True)) for each in islice(sets, _MOST_CANDIDATES)]

    def contains(self, flown: Sequence[FlownGains]) -> bool:
        return all(each.gains is None or each.gains in self.candidates for each in flown)

    def settings(self, flown: Sequence[FlownGains]) -> Iterator[Setting]:
        """The gains flown, or else those reported. A report is late by up to one cycle of all settings, so a gain that
        changed is unknown between the reports of two values, and after the last one."""
        for change, gain in product(flown, GAINS):
            yield Setting(change.after_s, gain, change.gains[gain] if change.gains else np.nan)
        for gain, known in self.known.items() if self.is_certain and not flown else ():
            yield from (Setting(since_s, gain, value) for since_s, value in known[:1])
            for (before_s, before), (now_s, now) in pairwise(known):
                if now != before:
                    yield from (Setting(before_s, gain, np.nan), Setting(now_s, gain, now))
            if len({value for _, value in known}) > 1:
                yield Setting(known[-1][0], gain, np.nan)

    def notes(self, flown: Sequence[FlownGains]) -> Iterator[str]:
        if not self.is_described:
            yield "the .log file does not describe this aircraft"
        elif not self.is_certain and not flown:
            yield "the .log file does not establish which settings the vehicle reported"
        if not self.contains(flown):
            yield "gains computed from the loop's commands"

    def read(self, companion: BinaryIO, values: Sequence[tuple[float, int, float]]) -> None:
        """Parse the companion. Raises TrajectoryError if it is not a .log file, or larger than 16 MiB."""
        companion.seek(0)
        text = companion.read(MAX_COMPANION_BYTES + 1)
        if len(text) > MAX_COMPANION_BYTES:
            raise refused("has a companion file of more than 16 MiB", "Add the .log file that was written with it.")
        self.is_described = False
        parser = expat.ParserCreate()
        parser.StartElementHandler = self._element
        parser.EntityDeclHandler = _no_entities
        try:
            parser.Parse(text, True)
        except (expat.ExpatError, ValueError) as error:
            raise refused(
                f"has a companion file that is not XML: {error}", "Add the .log file that was written with it, or none."
            ) from error
        numbers = self._numbers({number: value for _, number, value in reversed(values)})
        self.is_certain = bool(numbers) or not values
        for time_s, number, value in values:
            if number in numbers:
                self.known[numbers[number]].append((time_s, value))

    def _numbers(self, first: Mapping[int, float]) -> dict[int, str]:
        """The numbers of the gains, from the first value reported of each setting; empty if they are not certain."""
        if self._generated is not None and max(first, default=0) < len(self._generated):
            return {number: gain for number, gain in enumerate(self._generated) if gain}
        built_in = {gain: known[0][1] for gain, known in self.known.items() if known}
        groups = [each for each in self._groups if sorted(filter(None, each)) == sorted(GAINS) == sorted(built_in)]
        found = []
        for group, start in product(groups, range(_SETTINGS)):
            numbers = {number: gain for number, gain in enumerate(group, start) if gain}
            if all(first.get(number) == built_in[gain] for number, gain in numbers.items()):
                found.append(numbers)
        return found[0] if found and all(each == found[0] for each in found) else {}

    def _element(self, tag: str, attributes: dict[str, str]) -> None:
        given, kind = {name.lower(): value for name, value in attributes.items()}, tag.lower()
        if kind == "configuration":
            self.began_s = _number_in(given.get("time_of_day", "").encode())
        elif kind == "aircraft":
            self._is_mine = given.get("ac_id") == self.aircraft
            self.is_described |= self._is_mine
            if self._is_mine:
                self.name = f"{given.get('name', '')[:_LONGEST_NAME]} ({self.aircraft})".strip()
        elif not self._is_mine:
            return
        elif kind == "generated_settings":
            self._generated = []
        elif kind == "dl_settings":
            self._groups.append([])
        elif kind == "dl_setting":
            match = _GAIN.fullmatch(given.get("var", "")) or _AIRFRAME_GAIN.fullmatch(given.get("param", ""))
            group = self._groups[-1] if self._generated is None else self._generated
            group.append(f"k{match[1].lower()}" if match else "")
        elif kind == "define" and (match := _AIRFRAME_GAIN.fullmatch(given.get("name", ""))):
            value = _number_in(given.get("value", "").encode())
            if np.isfinite(value):
                self.known[f"k{match[1].lower()}"] = [(-np.inf, abs(value))]


def _no_entities(*_declared: object) -> None:
    raise ValueError("it declares entities")


def _whole(fields: Sequence[bytes], count: int) -> list[int] | None:
    """The first fields as 32-bit integers; None if there are fewer, or other values."""
    if len(fields) < count:
        return None
    try:
        numbers = [int(each) for each in fields[:count]]
    except ValueError:
        return None
    return numbers if min(numbers) >= INT32_MIN and max(numbers) <= INT32_MAX else None


def _number_in(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan
