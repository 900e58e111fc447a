"""Reader of ArduPilot's on-board logs (.bin, "DataFlash"): self-describing binary messages.

Every message begins with A3 95 and its type; messages of type 128 (FMT) define the length, name, format and columns of
each type. Only the few types needed for takeoffs are decoded, so that a log of several hours takes seconds.
"""

import re
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from app.core.records.trajectory import Samples
from app.logs.base import ARDUPILOT_SETS, Contents, Table, contents, names_in, numbers, refused, rows_of
from app.logs.takeoffs import FlightLog, LogEvent, Setting

_SYNC: Final = b"\xa3\x95"
_FMT: Final = 128
_FMT_BYTES: Final = 89
_MAX_OF_A_TYPE: Final = 5_000_000

_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8",
        "f": "<f4", "d": "<f8", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
        "n": "S4", "N": "S16", "Z": "S64", "a": "(32,)<i2",
    }
)  # fmt: skip
_HUNDREDTHS: Final = frozenset("cCeE")

_TAKEOFF, _LAND = 22, 21
_ACCEPTED: Final = (0, 5)
_LANDINGS: Final[Mapping[float, str]] = MappingProxyType({11: "motors off", 18: "the landing"})
_MODES: Final[Mapping[float, str]] = MappingProxyType(
    {0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND", 16: "POSHOLD"}
)

_WANTED: Final = frozenset({"PSCD", "CTUN", "PARM", "MODE", "MAVC", "EV", "BAT"})
_HINT: Final = "Use ArduPilot's .bin log of the flight, recorded with control tuning in LOG_BITMASK (PSCD, CTUN)."


@dataclass(frozen=True, slots=True)
class _Kind:
    """A message type as defined by its FMT message; `length` includes the three bytes before the columns."""

    name: str
    length: int
    dtype: np.dtype[np.void]
    hundredths: frozenset[str]


def is_dataflash(head: bytes) -> bool:
    """Whether a file with this head is a DataFlash log: its first message describes itself."""
    return head.startswith(_SYNC + bytes([_FMT]))


def read_dataflash(stream: BinaryIO) -> FlightLog:
    """Read a whole log. Raises TrajectoryError if it contains no altitude."""
    tables = read_tables(contents(stream), _WANTED)
    time_s, channels, title = _altitude(tables)
    if "BAT" in tables and {"TimeUS", "Volt"} <= tables["BAT"].keys():
        battery = _first_instance(tables["BAT"])
        if len(battery["TimeUS"]):
            channels["battery_v"] = np.interp(time_s, _seconds(battery), numbers(battery["Volt"]))
    starts, ends, landings = _moments(tables)
    return FlightLog(
        title=f"ArduPilot's on-board log, {title}",
        clock="vehicle",
        time_s=time_s,
        channels=channels,
        from_ground=True,
        gain_sets=ARDUPILOT_SETS,
        settings=tuple(_settings(tables)),
        starts=starts,
        ends=[*ends, *landings],
        landings=landings,
    )


def read_tables(data: Contents, wanted: frozenset[str]) -> dict[str, Table]:
    """Messages of the wanted types, by name and column; damaged sections are skipped.

    Integers that represent hundredths are divided by 100; texts are bytes without trailing NULs.
    """
    kinds: dict[int, _Kind] = {}
    places: dict[int, array[int]] = {}
    lengths = [0] * 256
    lengths[_FMT] = _FMT_BYTES
    position, size = 0, len(data)
    while position + 3 <= size:
        head = data[position : position + 3]
        length = lengths[head[2]] if head.startswith(_SYNC) else 0
        if not length:
            position = data.find(_SYNC, position + 1)
            if position < 0:
                break
            continue
        if position + length > size:
            break
        if head[2] == _FMT:
            _define(data[position + 3 : position + length], lengths, kinds, wanted)
        elif head[2] in kinds:
            found = places.setdefault(head[2], array("Q"))
            if len(found) < _MAX_OF_A_TYPE:
                found.append(position)
        position += length
    return {kinds[number].name: _table(data, kinds[number], found) for number, found in places.items()}


def _define(body: bytes, lengths: list[int], kinds: dict[int, _Kind], wanted: frozenset[str]) -> None:
    """Register the type in an FMT message: type, length, name[4], format[16], columns[64]; ignore invalid ones."""
    number, length = body[0], body[1]
    if number == _FMT or length < 3 or lengths[number]:
        return
    lengths[number] = length
    name, letters, columns = (_text(part) for part in (body[2:6], body[6:22], body[22:86]))
    names = columns.split(",")
    if name not in wanted or len(names) != len(letters) or len(set(names)) != len(names):
        return
    if not all(letter in _FORMATS for letter in letters) or not all(re.fullmatch(r"\w+", each) for each in names):
        return
    dtype = np.dtype([(each, _FORMATS[letter]) for each, letter in zip(names, letters, strict=True)])
    if dtype.itemsize == length - 3:
        hundredths = frozenset(each for each, letter in zip(names, letters, strict=True) if letter in _HUNDREDTHS)
        kinds[number] = _Kind(name, length, dtype, hundredths)


def _table(data: Contents, kind: _Kind, places: "array[int]") -> Table:
    packed = b"".join(data[place + 3 : place + kind.length] for place in places)
    rows = np.frombuffer(packed, kind.dtype)
    return {name: rows[name] / 100.0 if name in kind.hundredths else rows[name] for name in kind.dtype.names or ()}


def parameters_in(tables: Mapping[str, Table]) -> Iterator[tuple[float, str, float]]:
    """Time, s, name and value of each parameter, logged at the start of the log and at every change."""
    table = tables.get("PARM", {})
    if {"TimeUS", "Name", "Value"} <= table.keys():
        names = (_text(bytes(raw)) for raw in table["Name"])
        yield from zip(_seconds(table).tolist(), names, numbers(table["Value"]).tolist(), strict=True)


def _text(raw: bytes) -> str:
    return raw.partition(b"\0")[0].decode("ascii", "replace")


def _altitude(tables: Mapping[str, Table]) -> tuple[Samples, dict[str, Samples], str]:
    """Time, channels, and their source: the vertical controller's own message if it is logged."""
    loop, tuning = tables.get("PSCD", {}), tables.get("CTUN", {})
    if {"TimeUS", "PD"} <= loop.keys():
        time_s = _seconds(loop)
        down = {"altitude_m": "PD", "reference_m": "TPD", "climb_rate_m_s": "VD"}
        channels = {channel: -numbers(loop[name]) for channel, name in down.items() if name in loop}
        title = "altitude from PSCD.PD"
    elif {"TimeUS", "Alt"} <= tuning.keys():
        time_s = _seconds(tuning)
        up = {"altitude_m": "Alt", "reference_m": "DAlt"}
        channels = {channel: numbers(tuning[name]) for channel, name in up.items() if name in tuning}
        title = "altitude from CTUN.Alt"
    else:
        raise refused("contains neither PSCD.PD nor CTUN.Alt, the altitude", _HINT)
    if {"TimeUS", "ThO"} <= tuning.keys() and len(tuning["TimeUS"]):
        channels["thrust"] = np.interp(time_s, _seconds(tuning), numbers(tuning["ThO"]))
    return time_s, channels, title


def _settings(tables: Mapping[str, Table]) -> Iterator[Setting]:
    """The gains, logged at the start of the log and at every change."""
    names = names_in(ARDUPILOT_SETS)
    for time_s, name, value in parameters_in(tables):
        if name in names and np.isfinite(value):
            yield Setting(time_s, name, value)


def _moments(tables: Mapping[str, Table]) -> tuple[list[LogEvent], list[LogEvent], list[LogEvent]]:
    """Takeoff commands, events that end the flight, and landings."""
    accepted = [
        (time_s, command)
        for time_s, command, result in rows_of(tables.get("MAVC", {}), "TimeUS", "Cmd", "Res")
        if result in _ACCEPTED
    ]
    starts = [LogEvent(time_s, "the command NAV_TAKEOFF") for time_s, command in accepted if command == _TAKEOFF]
    ends = [LogEvent(time_s, "the command NAV_LAND") for time_s, command in accepted if command == _LAND]
    modes = list(rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"))
    ends += [
        LogEvent(time_s, f"the mode {_MODES.get(mode, f'{mode:g}')}")
        for (_, before), (time_s, mode) in pairwise(modes)
        if mode != before
    ]
    landings = [
        LogEvent(time_s, _LANDINGS[event])
        for time_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id")
        if event in _LANDINGS
    ]
    return starts, ends, landings


def _first_instance(table: Table) -> Table:
    """The first battery, if there are several."""
    instance = next((table[name] for name in ("Inst", "Instance") if name in table), None)
    return table if instance is None else {name: values[numbers(instance) == 0] for name, values in table.items()}


def _seconds(table: Table) -> Samples:
    return numbers(table["TimeUS"]) / 1e6
