"""Reader of ArduPilot's on-board logs ("DataFlash"): self-describing messages, binary (.bin) or as text (.log).

Every binary message begins with A3 95 and its type; messages of type 128 (FMT) define the length, name, format and
columns of each type, for the messages after them and, the first of a type, for those before it too. Only the few types
that are needed are decoded, so that a log of several hours takes seconds.
"""

import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from operator import attrgetter
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.logs.base import HEAD_BYTES, Contents, Table, numbers, rows_of
from app.logs.boots import CLOCK, Placed, Places, on_one_clock
from app.logs.dataflash_text import SCALES, SYNC, as_binary, is_dataflash_text

_HEADER_BYTES: Final = 3
_LARGEST_BYTES: Final = 255
_FMT: Final = 128
_FMT_BYTES: Final = 89
_DESCRIPTION: Final = re.compile(
    rb"\xa3\x95\x80(.)([\x03-\xff])(?=\w)([\w\0]{4})([\x21-\x7e\0]{16})([\x20-\x7e\0]{64})", re.DOTALL
)
"""Type, length, name, format and columns."""
_MAX_DESCRIPTIONS: Final = 1000
_MAX_OF_A_TYPE: Final = 5_000_000
_AT_ONCE: Final = 4 * 2**20
_FEWEST_MESSAGES: Final = 8
_USUAL_SHARE: Final = 0.9

_FORMATS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4", "q": "<i8", "Q": "<u8",
        "g": "<f2", "f": "<f4", "d": "<f8", "c": "<i2", "C": "<u2", "e": "<i4", "E": "<u4", "L": "<i4",
        "n": "S4", "N": "S16", "Z": "S64", "a": "V64",
    }
)  # fmt: skip
_CLOCKS: Final[Mapping[str, float]] = MappingProxyType({CLOCK: 1.0, "TimeMS": 1e3})
"""Time since the vehicle started, and its unit in µs, where they are the first column: the `TimeMS` of an old GPS
message is the time of the week."""
_UNITS: Final = frozenset({"FMTU", "MULT"})
_ANY: Final = ""
"""The name of all messages of which only the clock is read."""
_SHARES: Final = {ord("%"): 1e-2}


def is_dataflash(head: bytes) -> bool:
    """Whether a file with this head is a DataFlash log: it begins with a message that describes a type, or somewhere in
    one: messages of a type are equally long."""
    marks = pairwise(found.start() for found in re.finditer(SYNC, head))
    lengths = Counter((head[first + len(SYNC)], after - first) for first, after in marks)
    usual = {number: count for (number, _), count in reversed(lengths.most_common())}
    is_regular = sum(usual.values()) > max(_FEWEST_MESSAGES, _USUAL_SHARE * lengths.total())
    return is_regular or head.startswith(SYNC + bytes([_FMT]))


def is_sdlog2(head: bytes) -> bool:
    """Whether a file with this head is a log of PX4's releases before 1.5, which have the same kind of messages: they
    tell the time in a message of its own."""
    return any(found[3].rstrip(b"\0") == b"TIME" and b"StartTime" in found[5] for found in _DESCRIPTION.finditer(head))


@dataclass(frozen=True, slots=True)
class _Kind:
    """A message type from one place in the log on, as its FMT message defines it; `length` includes the three bytes
    before the columns, which end before one with an unknown letter."""

    number: int
    since: int
    name: str
    length: int
    letters: str
    columns: tuple[str, ...]

    @property
    def dtype(self) -> np.dtype[np.void]:
        return np.dtype([(each, _FORMATS[letter]) for each, letter in zip(self.columns, self.letters, strict=False)])

    @property
    def clock_us(self) -> float:
        """The unit of the clock, µs; 0 without one."""
        return _CLOCKS.get(self.columns[0], 0.0) if self.columns else 0.0

    def table(self, content: NDArray[np.uint8], places: Places) -> Table:
        """The columns of the messages at these places of a log, and the clock."""
        windows = np.lib.stride_tricks.sliding_window_view(content[_HEADER_BYTES:], self.dtype.itemsize)
        rows = windows[places].view(self.dtype)[:, 0]
        scales = [(name, SCALES.get(letter)) for name, letter in zip(self.columns, self.letters, strict=False)]
        found = {name: rows[name] if scale is None else scale * rows[name] for name, scale in scales}
        clock = {CLOCK: self.clock_us * numbers(found[self.columns[0]])} if self.clock_us else {}
        return {name: values for name, values in (found | clock).items() if values.dtype.kind != "V"}


@dataclass(frozen=True, slots=True)
class DataflashTables:
    """Messages by name and column, in order of the vehicle's time, and when it started anew within it, s.

    Scaled integers are in their unit; texts are bytes without trailing NULs. Every table has the column `TimeUS`, the
    time in µs, which goes on some time after that of the boot before; none has if no message of the log has the time.
    `factors` by name and column make values SI, angles degrees and percentages shares, where the log tells it (release
    3.6 and later). `skipped_bytes` are in no whole message, and `odd_rows` were left out for their impossible time.
    """

    tables: dict[str, Table]
    boots_s: list[float]
    factors: Mapping[str, Mapping[str, float]]
    skipped_bytes: int
    odd_rows: int


def read_tables(data: Contents, wanted: Collection[str]) -> DataflashTables:
    """Messages of the wanted types; damaged sections are skipped."""
    skipped = 0
    if is_dataflash_text(data[:HEAD_BYTES]):
        data, skipped = as_binary(data)
    kinds, begins = _described(data)
    read = {index: kind for index, kind in enumerate(kinds) if kind.name in {*wanted, *_UNITS} and kind.columns}
    if not all(kind.clock_us for kind in read.values()):
        others = {index: kind for index, kind in enumerate(kinds) if kind.clock_us}
        read = {index: replace(kind, name=_ANY, columns=kind.columns[:1]) for index, kind in others.items()} | read
    content = np.frombuffer(data, np.uint8)
    places, which = (np.concatenate(each) for each in zip(*_messages(content, kinds), strict=True))
    parts: dict[str, list[Placed]] = {}
    for index, kind in read.items():
        mine = places[which == index][:_MAX_OF_A_TYPE]
        if len(mine):
            parts.setdefault(kind.name, []).append((mine, kind.table(content, mine)))
    tables, boots_s, odd_rows = on_one_clock({name: _joined(each) for name, each in parts.items()}, begins)
    lengths = np.array([kind.length for kind in kinds])
    end = int(places[-1] + lengths[which[-1]]) if len(places) else 0
    tail = len(data[end:].rstrip(b"\0\xff"))
    skipped += end - int(np.bincount(which, minlength=len(lengths)) @ lengths) + (tail if tail > _LARGEST_BYTES else 0)
    return DataflashTables(
        tables={name: table for name, table in tables.items() if name in wanted},
        boots_s=boots_s,
        factors=_si_factors(tables, [kind for kind in kinds if kind.name in wanted]),
        skipped_bytes=skipped,
        odd_rows=odd_rows,
    )


def _described(data: Contents) -> tuple[list[_Kind], list[int]]:
    """Every description that makes sense and differs from the one before of its type, and the places at which a log
    describes FMT itself, its first message."""
    kinds, begins = [_Kind(_FMT, 0, "", _FMT_BYTES, "", ())], []
    latest: dict[int, bytes] = {}
    for found in _DESCRIPTION.finditer(data):
        (number,), (length,) = found[1], found[2]
        if number == _FMT:
            begins.append(found.start())
        elif latest.get(number) != found[0] and len(kinds) < _MAX_DESCRIPTIONS:
            name, letters, names = (found[part].partition(b"\0")[0].decode() for part in (3, 4, 5))
            columns, known = names.split(","), "".join(takewhile(_FORMATS.__contains__, letters))
            if len(columns) == len(set(columns)) == len(letters) and all(columns):
                since = found.start() if number in latest else 0
                kind = _Kind(number, since, name, length, known, tuple(columns[: len(known)]))
                size = _HEADER_BYTES + kind.dtype.itemsize
                if size == length or (size < length and known != letters):
                    latest[number] = found[0]
                    kinds.append(kind)
    return sorted(kinds, key=attrgetter("number", "since")), begins


def _messages(content: NDArray[np.uint8], kinds: Sequence[_Kind]) -> Iterator[tuple[Places, NDArray[np.int16]]]:
    """Where whole messages begin and of which kinds they are, some at a time: those that another one or the end of the
    file follows. One that begins within another is part of it."""
    size, free_from = len(content), 0
    lengths, numbers_of = (np.array([getattr(kind, name) for kind in kinds]) for name in ("length", "number"))
    since = np.array([(kind.number << 32) + kind.since for kind in kinds])
    for begin in range(0, max(size, 1), _AT_ONCE):
        part = content[begin : begin + _AT_ONCE + len(SYNC)]
        marks = np.flatnonzero(part[:-2] == SYNC[0])
        places = begin + marks[part[marks + 1] == SYNC[1]]
        types = content[places + len(SYNC)].astype(np.int64)
        which = np.searchsorted(since, (types << 32) + places, side="right") - 1
        is_known = numbers_of[which] == types
        places, which = places[is_known], which[is_known]
        ends = places + lengths[which]
        after = np.minimum(ends, size - len(SYNC))
        is_whole = (content[after] == SYNC[0]) & (content[after + 1] == SYNC[1]) & (after == ends)
        is_whole |= (ends > size - len(SYNC)) & (ends <= size)
        reached = np.maximum.accumulate(np.append(free_from, np.where(is_whole, ends, 0)))
        free_from, found = int(reached[-1]), is_whole & (places >= reached[:-1])
        yield places[found].astype(np.uint32), which[found].astype(np.int16)


def _joined(parts: Sequence[Placed]) -> Placed:
    """Rows of a type under all its descriptions, in order of the file; NaN in a column that one of them lacks."""
    if len(parts) == 1:
        return parts[0]
    places = np.concatenate([each for each, _ in parts])
    order = np.argsort(places, kind="stable")
    found = {
        name: [each.get(name, np.full(len(own), np.nan)) for own, each in parts] for _, table in parts for name in table
    }
    return places[order], {name: np.concatenate(columns)[order] for name, columns in found.items()}


def _si_factors(tables: Mapping[str, Table], kinds: Sequence[_Kind]) -> dict[str, dict[str, float]]:
    """1 of columns with a scaled letter, whose values have their unit already."""
    factors: dict[str, dict[str, float]] = {}
    units = tables.get("FMTU", {})
    if not {"FmtType", "UnitIds", "MultIds"} <= units.keys():
        return factors
    scales = {scale: factor for _, scale, factor in rows_of(tables.get("MULT", {}), CLOCK, "Id", "Mult")}
    texts = (units[name].astype("S16").tolist() for name in ("UnitIds", "MultIds"))
    for number, *ids in dict.fromkeys(zip(numbers(units["FmtType"]).tolist(), *texts, strict=True)):
        for kind in (each for each in kinds if each.number == number):
            for column, letter, unit, scale in zip(kind.columns, kind.letters, *ids, strict=False):
                factor = 1.0 if letter in SCALES else _SHARES.get(unit, 1.0) * (scales.get(scale, np.nan) or 1.0)
                if np.isfinite(factor):
                    factors.setdefault(kind.name, {})[column] = factor
    return factors


def parameters_in(tables: Mapping[str, Table]) -> Iterator[tuple[float, str, float]]:
    """Time, s, name and value of each parameter, logged at the start of the log and at every change."""
    table = tables.get("PARM", {})
    if {CLOCK, "Name", "Value"} <= table.keys():
        names = (bytes(raw).decode("ascii", "replace") for raw in table["Name"].tolist())
        time_s = numbers(table[CLOCK]) / 1e6
        yield from zip(time_s.tolist(), names, numbers(table["Value"]).tolist(), strict=True)
