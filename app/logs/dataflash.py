"""Reader of ArduPilot's on-board logs (.bin, "DataFlash"): self-describing binary messages.

Every message begins with A3 95 and its type; messages of type 128 (FMT) define the length, name, format and columns of
each type. Only the few types needed for takeoffs are decoded, so that a log of several hours takes seconds.
"""

import re
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from app.core.records.trajectory import Samples
from app.logs.base import Contents, Table, numbers

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
        yield from zip(seconds(table).tolist(), names, numbers(table["Value"]).tolist(), strict=True)


def _text(raw: bytes) -> str:
    return raw.partition(b"\0")[0].decode("ascii", "replace")


def seconds(table: Table) -> Samples:
    return numbers(table["TimeUS"]) / 1e6
