"""Reader of ArduPilot's on-board logs (.bin, "DataFlash"): self-describing binary messages.

Every message begins with A3 95 and its type; messages of type 128 (FMT) define the length, name, format and columns of
each type. Only the few types that are needed are decoded, so that a log of several hours takes seconds.
"""

import re
from array import array
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.logs.base import Contents, Table, numbers

_SYNC: Final = b"\xa3\x95"
_FMT: Final = 128
_FMT_BYTES: Final = 89
_MAX_OF_A_TYPE: Final = 5_000_000
_BACK_US: Final = 1e6
"""If the clock goes back by more than this, the vehicle restarted."""
_BETWEEN_BOOTS_US: Final = 20e6

_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8",
        "f": "<f4", "d": "<f8", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
        "n": "S4", "N": "S16", "Z": "S64", "a": "(32,)<i2",
    }
)  # fmt: skip
_HUNDREDTHS: Final = frozenset("cCeE")


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


@dataclass(frozen=True, slots=True)
class DataflashTables:
    """Messages by name and column, in order of the file, and when the vehicle started anew within it, s.

    Integers that represent hundredths are divided by 100; texts are bytes without trailing NULs. The clock (`TimeUS`)
    of each boot goes on some time after that of the one before.
    """

    tables: dict[str, Table]
    boots_s: list[float]


def read_tables(data: Contents, wanted: Collection[str]) -> DataflashTables:
    """Messages of the wanted types; damaged sections are skipped."""
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
    tables = {kinds[number].name: _table(data, kinds[number], found) for number, found in places.items()}
    timed = {kinds[number].name: np.array(found) for number, found in places.items()}
    return _on_one_clock(tables, {name: found for name, found in timed.items() if "TimeUS" in tables[name]})


def _on_one_clock(tables: dict[str, Table], places: Mapping[str, NDArray[np.uint64]]) -> DataflashTables:
    """The tables by one clock for all boots; `places` are those of the rows of each table that has a clock. A row whose
    time is far from that of the rows around it is damaged, and left out."""
    if not places:
        return DataflashTables(tables, [])
    order = np.argsort(np.concatenate(list(places.values())), kind="stable")
    time_us = np.concatenate([numbers(tables[name]["TimeUS"]) for name in places])[order]
    before, now, after = time_us[:-2], time_us[1:-1], time_us[2:]
    is_alone = (after >= before - _BACK_US) & ((now > after + _BACK_US) | (now < before - _BACK_US))
    kept = np.flatnonzero(~np.pad(is_alone, 1)[: len(order)])
    time_us = time_us[kept]
    begins = np.flatnonzero(np.diff(time_us) < -_BACK_US) + 1
    boots = np.split(time_us, begins)
    for earlier, later in pairwise(boots):
        np.add(later, np.fmax.reduce(earlier) + _BETWEEN_BOOTS_US - later[0], out=later)
    if len(boots) > 1 or len(kept) < len(order):
        counts = [len(each) for each in places.values()]
        owner = np.repeat(np.arange(len(counts)), counts)[order][kept]
        rows = np.concatenate([np.arange(each) for each in counts])[order][kept]
        for number, name in enumerate(places):
            mine = owner == number
            columns = {column: values[rows[mine]] for column, values in tables[name].items()}
            tables[name] = columns | {"TimeUS": time_us[mine]}
    return DataflashTables(tables, [float(boot[0]) / 1e6 for boot in boots[1:]])


def _define(body: bytes, lengths: list[int], kinds: dict[int, _Kind], wanted: Collection[str]) -> None:
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
        time_s = numbers(table["TimeUS"]) / 1e6
        yield from zip(time_s.tolist(), names, numbers(table["Value"]).tolist(), strict=True)


def _text(raw: bytes) -> str:
    return raw.partition(b"\0")[0].decode("ascii", "replace")
