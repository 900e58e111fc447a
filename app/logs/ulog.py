"""Tables of PX4's logs (.ulg, "ULog"): the wanted topics, all parameters, and the wanted values about the log.

The file is filtered first: only messages that are wanted, with flat and valid formats, are passed to pyulog. This
bounds memory and time by the flight, whatever a file claims to contain.
"""

import io
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from operator import attrgetter
from typing import Any, BinaryIO, Final

import numpy as np

from app.core.formatting import count, grouped, times
from app.logs.base import Contents, Table, contents, refused

_MAGIC: Final = b"ULog\x01\x12\x35"
_HEADER_BYTES: Final = 16
_SYNC: Final = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_TYPES: Final = frozenset(b"BFIMPQARDLCSO")
_LARGEST_MESSAGE: Final = 10_000
_LARGEST_ARRAY: Final = 64
_MAX_FIELDS: Final = 300
_FIELD: Final = re.compile(r"(u?int(?:8|16|32|64)_t|float|double|bool|char)(?:\[(\d{1,3})\])? (\w+)")
_APPENDED: Final = 0x01
_TEXTS: Final = {f"char[{size}]": size for size in range(1, 65)}
_VALUES: Final[Mapping[str, Mapping[str, int]]] = {
    "P": {"float": 4, "int32_t": 4},
    "I": {"uint32_t": 4, "uint64_t": 8, **_TEXTS},
}
"""Types of parameters, and of the values about the log, with their bytes."""
_PARAMETER: Final = re.compile(r"[A-Z0-9_]{1,16}")
_MOST_PARAMETERS: Final = 5_000

HINT: Final = "Use PX4's .ulg log of the flight, with vehicle_local_position in it."


@dataclass(frozen=True, slots=True, kw_only=True)
class ULogTables:
    """The lowest instance of each wanted topic; time, s, name and value of the parameters in order of their time, of
    which those from before the log are at −∞; the wanted numbers and texts about the log, and remarks on what it lacks.
    """

    topics: Mapping[str, Table]
    settings: Sequence[tuple[float, str, float]]
    information: Mapping[str, int]
    texts: Mapping[str, str]
    notes: Sequence[str]


def is_ulog(head: bytes) -> bool:
    """Whether a file with this head is a ULog."""
    return head.startswith(_MAGIC)


def read_ulog_tables(stream: BinaryIO, *, topics: Collection[str], values: Collection[str]) -> ULogTables:
    """Read all parameters, these topics and these `values` about the log, of a whole log. Raises TrajectoryError if it
    is not a readable ULog."""
    from pyulog import ULog
    from pyulog.exceptions import ULogException

    data = contents(stream)
    if not is_ulog(data[:_HEADER_BYTES]) or len(data) < _HEADER_BYTES:
        raise refused("is not a ULog file", HINT)
    sieve = _LogFilter(topics, values)
    sieve.filter(data)
    try:
        log = ULog(io.BytesIO(sieve.kept))
    except (ULogException, ValueError, KeyError, IndexError, TypeError) as error:
        raise refused(f"is damaged: {error}", HINT) from error
    changes = ((time_us / 1e6, name, value) for time_us, name, value in log.changed_parameters)
    settings = [*((-np.inf, name, value) for name, value in log.initial_parameters.items()), *changes]
    notes = [f"{count(sieve.damages, 'damaged section')} skipped"] if sieve.damages else []
    if sieve.unread_bytes:
        why = "the file ends in the middle of a message, or is damaged there"
        notes.append(f"{why}: its last {grouped(sieve.unread_bytes)} bytes were not read")
    if log.dropouts:
        lost_s = sum(each.duration for each in log.dropouts) / 1000
        notes.append(f"the logger dropped data {times(len(log.dropouts))}, {lost_s:.2f} s in total")
    return ULogTables(
        topics=_lowest_instances(log.data_list),
        settings=tuple((at_s, name, float(value)) for at_s, name, value in settings if np.isfinite(value)),
        information={name: value for name, value in log.msg_info_dict.items() if isinstance(value, int)},
        texts={name: value for name, value in log.msg_info_dict.items() if isinstance(value, str)},
        notes=notes,
    )


def _lowest_instances(subscribed: Sequence[Any]) -> dict[str, Table]:
    """The rows of the lowest instance of each topic, of all with rows, which are in order of names and instances."""
    tables: dict[str, Table] = {}
    for (name, _), same in groupby(subscribed, key=attrgetter("name", "multi_id")):
        tables.setdefault(name, _joined([each.data for each in same]))
    return tables


def _joined(tables: Sequence[Table]) -> Table:
    """The rows of one topic in order of time, if it was subscribed several times."""
    if len(tables) == 1:
        return tables[0]
    order = np.argsort(np.concatenate([each["timestamp"] for each in tables]), kind="stable")
    return {name: np.concatenate([each[name] for each in tables])[order] for name in tables[0]}


@dataclass(slots=True)
class _LogFilter:
    """Filters the messages of a log. `damages` counts the sections that were skipped; `unread_bytes` are behind the
    last message that is complete."""

    topics: Collection[str]
    values: Collection[str]
    kept: bytearray = field(default_factory=bytearray)
    damages: int = 0
    unread_bytes: int = 0
    _formats: set[str] = field(default_factory=set)
    _parameters: set[str] = field(default_factory=set)
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
        self.unread_bytes = max(size - position, 0)

    def _is_wanted(self, kind: int, data: Contents, start: int, end: int) -> bool:
        match chr(kind):
            case "D":
                return end - start > 2 and (data[start] | data[start + 1] << 8) in self._subscribed
            case "O":
                return end - start == 2
            case "F":
                return self._takes_format(data[start:end])
            case "A":
                return self._subscribes(data[start:end])
            case "P" | "I" as letter:
                return self._is_value(data[start:end], letter)
            case "B":
                self._flags(data[start:end])
        return False

    def _takes_format(self, body: bytes) -> bool:
        """Whether this is the format of a wanted topic: flat, with unique names, including a time stamp."""
        name, _, described = body.decode("ascii", "replace").partition(":")
        parts = [part for part in described.split(";") if part]
        if name not in self.topics or len(parts) > _MAX_FIELDS:
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
        """Whether this subscribes to an instance of a wanted topic."""
        if len(body) < 4:
            return False
        number, name = body[1] | body[2] << 8, body[3:].decode("ascii", "replace")
        if name not in self._formats or number in self._subscribed:
            return False
        self._subscribed.add(number)
        return True

    def _flags(self, body: bytes) -> None:
        if len(body) < 40:
            return
        if body[8] & ~_APPENDED or any(body[9:16]):
            raise refused("was written by a newer PX4 in an unsupported format", HINT)
        offsets = [int.from_bytes(body[at : at + 8], "little") for at in (16, 24, 32)]
        self._appended = sorted(offset for offset in offsets if offset)

    def _is_value(self, body: bytes, letter: str) -> bool:
        """Whether this is a name in PX4's form, "float NAME", of a parameter or a wanted one, and its value."""
        kind, _, name = body[1 : 1 + body[0]].decode("ascii", "replace").partition(" ")
        value = body[1 + body[0] :]
        if len(value) != _VALUES[letter].get(kind) or (kind in _TEXTS and not value.isascii()):
            return False
        if letter == "P" and _PARAMETER.fullmatch(name) and len(self._parameters) < _MOST_PARAMETERS:
            self._parameters.add(name)
        return name in (self._parameters if letter == "P" else self.values)
