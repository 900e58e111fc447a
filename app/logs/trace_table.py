"""Recorded runs of a control loop: CSV, optionally gzipped, one row per step.

Of a described run, line 1 is `# ` and a JSON object that describes it, line 2 the header, then come rows of numbers; an
empty field is NaN.
"""

import csv
import gzip
import io
import json
import tempfile
import zlib
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import BinaryIO, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from app.core.errors import InputError, Problem
from app.core.records.trajectory import Samples
from app.logs.formats import head_of

MAX_ROWS: Final = 1_000_000
MAX_BYTES: Final = 256 * 2**20
_GZIP: Final = b"\x1f\x8b"
_DESCRIPTION_CHARACTERS: Final = 2**16
_GZIP_WINDOW: Final = 31
_FIRST_ROW: Final = 3
"""Line of the first row."""

Number = TypeVar("Number", int, float)


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

    def numbers_in(self, described: Mapping[str, object], key: str) -> dict[str, float]:
        given = self.object_in(described, key)
        return {each: self.number_in(given, each) for each in given}

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
    first, _, rest = unzipped(beginning).partition(b"\n")
    header = rest.partition(b"\n")[0].decode("utf-8", "replace")
    return first.startswith(b"#") and set(columns) <= {name.strip() for name in header.split(",")}


def unzipped(head: bytes) -> bytes:
    """The beginning of the file that is gzipped into one with this head; the head itself if it is not gzipped."""
    try:
        return zlib.decompressobj(_GZIP_WINDOW).decompress(head)
    except zlib.error:
        return head


@contextmanager
def text_of(checks: TraceChecks, stream: BinaryIO) -> Iterator[io.TextIOWrapper]:
    """The text of a run, plain or gzipped, decompressed to a bounded size: a small file may expand to a huge one.
    Raises InputError, also while it is read, if it is damaged."""
    source = gzip.GzipFile(fileobj=stream, mode="rb") if head_of(stream).startswith(_GZIP) else stream
    try:
        with tempfile.SpooledTemporaryFile(max_size=2**22) as plain:
            while chunk := source.read(2**20):
                plain.write(chunk)
                if plain.tell() > MAX_BYTES:
                    raise InputError(
                        f"{checks.name} cannot be replayed.",
                        hint=f"Trim the run: at most {MAX_BYTES // 2**20} MiB of text and {MAX_ROWS} rows can be read.",
                        problems=(Problem("file", f"contains more than {MAX_BYTES // 2**20} MiB of text"),),
                    )
            plain.seek(0)
            with io.TextIOWrapper(plain, encoding="utf-8", newline="") as text:
                yield text
    except (EOFError, zlib.error, gzip.BadGzipFile, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{checks.name} is damaged or not a text file: {error}.",
            hint=checks.hint,
            problems=(Problem("file", "is damaged or not a text file"),),
        ) from error


def read_rows(
    checks: TraceChecks,
    rows: Iterator[list[str]],
    header: Sequence[str],
    value: Callable[[str, str], Number],
    *,
    first_line: int,
) -> Iterator[Number]:
    """The values of all rows; `value` makes one of a column and its text, and raises ValueError with a reason. Raises
    InputError naming the line and the column of the first error, or if there is no row."""
    line = first_line - 1
    for line, row in enumerate(rows, start=first_line):
        if line >= MAX_ROWS + first_line:
            raise checks.malformed(f"line {line}, {header[0]}", f"a trace may have at most {MAX_ROWS} rows")
        if len(row) != len(header):
            column = header[min(len(row), len(header) - 1)]
            raise checks.malformed(f"line {line}, {column}", f"the row has {len(row)} values, the header {len(header)}")
        for column, text in zip(header, row, strict=True):
            try:
                yield value(column, text)
            except ValueError as error:
                raise checks.malformed(f"line {line}, {column}", str(error)) from error
    if line < first_line:
        raise InputError(
            f"{checks.name} has a header and no rows.", hint=checks.hint, problems=(Problem("file", "has no rows"),)
        )


def read_trace_table(
    stream: BinaryIO, *, name: str, columns: Collection[str], may_be_empty: Collection[str] = ()
) -> TraceTable:
    """Read a run with at least these columns; fields of `may_be_empty` may be empty.

    Raises InputError naming the line and the column of the first error.
    """
    hint = f"A trace has # and a JSON object, the columns {','.join(columns)}, and one row of numbers per step."
    checks = TraceChecks(name, hint)

    def value(column: str, text: str) -> float:
        return np.nan if not text and column in may_be_empty else _finite(text)

    with text_of(checks, stream) as text:
        description = _description(checks, text.readline(_DESCRIPTION_CHARACTERS))
        reader = csv.reader(text)
        header = next(reader, [])
        if missing := tuple(Problem(f"line 2, {each}", "column is missing") for each in columns if each not in header):
            raise InputError(f"{name} is not a trace of this loop.", hint=hint, problems=missing)
        if twice := next((each for each in header if header.count(each) > 1), None):
            raise checks.malformed(f"line 2, {twice}", "column appears twice")
        values = array("d", read_rows(checks, reader, header, value, first_line=_FIRST_ROW))
    table = np.array(values).reshape(-1, len(header))
    return TraceTable(description, {each: np.ascontiguousarray(table[:, k]) for k, each in enumerate(header)})


def _description(checks: TraceChecks, line: str) -> Mapping[str, object]:
    try:
        read: object = json.loads(line.removeprefix("#"))
    except (ValueError, RecursionError):
        read = None
    if not line.startswith("#") or not isinstance(read, dict):
        raise checks.malformed("line 1, description", "must be # and a JSON object")
    return read


def _finite(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise ValueError(f"must be a finite number, got {text[:40]!r}")
    return value
