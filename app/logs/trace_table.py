"""Reader of recorded runs of the loops of ArduCopter and PX4: CSV, optionally gzipped, one row per step.

Line 1 is `# ` and a JSON object that describes the run, line 2 the header, then come rows of numbers; an empty field is
NaN.
"""

import csv
import gzip
import io
import json
import tempfile
import zlib
from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.errors import InputError, Problem
from app.core.records.trajectory import Samples
from app.logs.loop_trace import GZIP, IN_MEMORY_BYTES, MAX_ROWS, unpack

_DESCRIPTION_CHARACTERS: Final = 2**16
_GZIP_WINDOW: Final = 31
_FIRST_ROW: Final = 3
"""Line of the first row."""


@dataclass(frozen=True, slots=True)
class TraceTable:
    """A recorded run: its description, and its columns by name, shape (n,) each, n ≥ 1."""

    description: Mapping[str, object]
    columns: Mapping[str, Samples]

    def __getitem__(self, column: str) -> Samples:
        return self.columns[column]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True, slots=True)
class TraceChecks:
    """Checks of a run in the file `name`, with the `hint` of its kind. Each raises InputError naming the line and the
    column or key."""

    name: str
    hint: str

    def malformed(self, field: str, reason: str) -> InputError:
        return InputError(f"{self.name} cannot be replayed.", hint=self.hint, problems=(Problem(field, reason),))

    def require_flags(self, table: TraceTable, columns: Collection[str]) -> None:
        for column in columns:
            self._require(np.isin(table[column], (0.0, 1.0)), column, "must be 0 or 1")

    def require_positive(self, table: TraceTable, column: str) -> None:
        self._require(table[column] > 0.0, column, "must be positive")

    def _require(self, holds: NDArray[np.bool_], column: str, reason: str) -> None:
        if not holds.all():
            raise self.malformed(f"line {int(np.argmin(holds)) + _FIRST_ROW}, {column}", reason)

    def object_in(self, described: Mapping[str, object], key: str) -> Mapping[str, object]:
        found = described.get(key)
        if not isinstance(found, dict):
            raise self.malformed(f"line 1, {key}", "must be a JSON object")
        return found

    def number_in(self, described: Mapping[str, object], key: str) -> float:
        found = described.get(key)
        if isinstance(found, bool) or not isinstance(found, int | float) or not np.isfinite(found):
            raise self.malformed(f"line 1, {key}", "must be a finite number")
        return float(found)

    def positive_in(self, described: Mapping[str, object], key: str) -> float:
        found = self.number_in(described, key)
        if found <= 0.0:
            raise self.malformed(f"line 1, {key}", "must be positive")
        return found


def has_columns(beginning: bytes, columns: Collection[str]) -> bool:
    """Whether a file with this beginning, plain or gzipped, is such a run with at least these columns."""
    first, _, rest = _unzipped(beginning).partition(b"\n")
    header = rest.partition(b"\n")[0].decode("utf-8", "replace")
    return first.startswith(b"#") and set(columns) <= {name.strip() for name in header.split(",")}


def _unzipped(head: bytes) -> bytes:
    """The beginning of the file that is gzipped into one with this head; the head itself if it is not gzipped."""
    try:
        return zlib.decompressobj(_GZIP_WINDOW).decompress(head)
    except zlib.error:
        return head


def read_trace_table(
    stream: BinaryIO, *, name: str, columns: Collection[str], may_be_empty: Collection[str] = ()
) -> TraceTable:
    """Read a run with at least these columns; fields of `may_be_empty` may be empty.

    Raises InputError naming the line and the column of the first error.
    """
    stream.seek(0)
    zipped = stream.read(len(GZIP)) == GZIP
    stream.seek(0)
    try:
        with tempfile.SpooledTemporaryFile(IN_MEMORY_BYTES) as plain:
            unpack(name, gzip.GzipFile(fileobj=stream, mode="rb") if zipped else stream, plain)
            with io.TextIOWrapper(plain, encoding="utf-8", newline="") as text:
                return _read(name, text, columns, frozenset(may_be_empty))
    except (EOFError, zlib.error, UnicodeDecodeError, csv.Error, gzip.BadGzipFile) as error:
        raise InputError(
            f"{name} is damaged or not a text file: {error}.",
            hint=_hint(columns),
            problems=(Problem("file", "is damaged or not a text file"),),
        ) from error


def _read(name: str, text: io.TextIOWrapper, columns: Collection[str], may_be_empty: frozenset[str]) -> TraceTable:
    description = _description(name, text.readline(_DESCRIPTION_CHARACTERS), columns)
    reader = csv.reader(text)
    header = next(reader, [])
    if missing := tuple(Problem(f"line 2, {each}", "column is missing") for each in columns if each not in header):
        raise InputError(f"{name} is not a trace of this loop.", hint=_hint(columns), problems=missing)
    if twice := next((each for each in header if header.count(each) > 1), None):
        raise _malformed(name, 2, twice, "column appears twice", columns)
    values = array("d")
    for line, row in enumerate(reader, start=_FIRST_ROW):
        values.extend(_row(name, line, header, row, may_be_empty, columns))
    if not values:
        raise InputError(
            f"{name} has a header and no rows.", hint=_hint(columns), problems=(Problem("file", "has no rows"),)
        )
    table = np.array(values).reshape(-1, len(header))
    return TraceTable(description, {each: np.ascontiguousarray(table[:, k]) for k, each in enumerate(header)})


def _description(name: str, line: str, columns: Collection[str]) -> Mapping[str, object]:
    try:
        read: object = json.loads(line.removeprefix("#"))
    except (ValueError, RecursionError):
        read = None
    if not line.startswith("#") or not isinstance(read, dict):
        raise _malformed(name, 1, "description", "must be # and a JSON object", columns)
    return read


def _row(
    name: str, line: int, header: Sequence[str], row: list[str], may_be_empty: frozenset[str], columns: Collection[str]
) -> Iterator[float]:
    if line > MAX_ROWS + 2:
        raise _malformed(name, line, header[0], f"a trace may have at most {MAX_ROWS} rows", columns)
    if len(row) != len(header):
        column = header[min(len(row), len(header) - 1)]
        reason = f"the row has {len(row)} values, the header {len(header)}"
        raise _malformed(name, line, column, reason, columns)
    for column, text in zip(header, row, strict=True):
        if not text and column in may_be_empty:
            yield np.nan
            continue
        try:
            value = float(text)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise _malformed(name, line, column, f"must be a finite number, got {text[:40]!r}", columns)
        yield value


def _hint(columns: Collection[str]) -> str:
    return f"A trace has # and a JSON object, the columns {','.join(columns)}, and one row of numbers per step."


def _malformed(name: str, line: int, column: str, reason: str, columns: Collection[str]) -> InputError:
    problems = (Problem(f"line {line}, {column}", reason),)
    return InputError(f"{name} cannot be replayed.", hint=_hint(columns), problems=problems)
