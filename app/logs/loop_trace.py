"""Reader of recorded runs of the vertical loop: CSV, optionally gzipped, one row per step, integers only."""

import csv
import gzip
import io
import re
import tempfile
import zlib
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from app.core.control.paparazzi import INPUTS, INT32_MAX, INT32_MIN, MODES, OUTPUTS, LoopTrace
from app.core.errors import InputError, Problem

COLUMNS: Final = ("step", *INPUTS[:7], "zdd", *INPUTS[7:], *OUTPUTS)
MAX_ROWS: Final = 1_000_000
MAX_BYTES: Final = 256 * 2**20
GZIP: Final = b"\x1f\x8b"
IN_MEMORY_BYTES: Final = 2**22
_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,19}")

_HINT: Final = f"A trace has the columns {','.join(COLUMNS)}, one row per 1/512 s, as 32-bit integers."


def read_loop_trace(path: Path) -> LoopTrace:
    """Read `path` (.csv or .csv.gz). Raises InputError naming the line and the column of the first error."""
    try:
        with path.open("rb") as raw:
            return _read_bytes(path.name, raw, zipped=path.suffix == ".gz")
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Use a readable trace file, .csv or .csv.gz."
        ) from error


def read_loop_trace_stream(stream: BinaryIO, *, name: str) -> LoopTrace:
    """As `read_loop_trace`, from a stream; gzip is detected from its first bytes."""
    stream.seek(0)
    zipped = stream.read(len(GZIP)) == GZIP
    stream.seek(0)
    try:
        return _read_bytes(name, stream, zipped=zipped)
    except gzip.BadGzipFile as error:
        raise _damaged(name, error) from error


def may_be_loop_trace(head: bytes) -> bool:
    """Whether a file with this head can be a trace: gzipped, or text whose first line names a column of a trace."""
    first = head.partition(b"\n")[0]
    return head.startswith(GZIP) or bool({b"mode", b"z_ref", b"r33"} & {column.strip() for column in first.split(b",")})


def _read_bytes(name: str, raw: BinaryIO, *, zipped: bool) -> LoopTrace:
    try:
        with tempfile.SpooledTemporaryFile(IN_MEMORY_BYTES) as plain:
            unpack(name, gzip.GzipFile(fileobj=raw, mode="rb") if zipped else raw, plain)
            with io.TextIOWrapper(plain, encoding="utf-8", newline="") as text:
                return _read(name, text)
    except (EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise _damaged(name, error) from error


def unpack(name: str, source: BinaryIO | gzip.GzipFile, plain: BinaryIO | tempfile.SpooledTemporaryFile[bytes]) -> None:
    """Decompress to a bounded size: a small file may expand to a huge one."""
    while chunk := source.read(2**20):
        plain.write(chunk)
        if plain.tell() > MAX_BYTES:
            raise InputError(
                f"{name} cannot be replayed.",
                hint=f"Trim the run: at most {MAX_BYTES // 2**20} MiB of text and {MAX_ROWS} rows can be read.",
                problems=(Problem("file", f"contains more than {MAX_BYTES // 2**20} MiB of text"),),
            )
    plain.seek(0)


def _damaged(name: str, error: Exception) -> InputError:
    return InputError(
        f"{name} is damaged or not a text file: {error}.",
        hint=_HINT,
        problems=(Problem("file", "is damaged or not a text file"),),
    )


def _read(name: str, text: io.TextIOWrapper) -> LoopTrace:
    reader = csv.reader(text)
    header = next(reader, [])
    missing = [column for column in COLUMNS if column not in header]
    if problems := tuple(Problem(f"line 1, {column}", "column is missing") for column in missing):
        raise InputError(f"{name} is not a trace of the vertical loop.", hint=_HINT, problems=problems)
    if len(header) != len(COLUMNS):
        extra = next((column for column in header if column not in COLUMNS), header[-1])
        raise _malformed(name, 1, extra, "column is unknown or appears twice")
    values = array("q")
    for row in _rows(name, header, reader):
        values.extend(row)
    if not values:
        raise InputError(f"{name} has a header and no rows.", hint=_HINT, problems=(Problem("file", "has no rows"),))
    rows = np.array(values, dtype=np.int64).reshape(-1, len(header))
    place = {column: index for index, column in enumerate(header)}
    return LoopTrace(rows[:, [place[column] for column in INPUTS]], rows[:, [place[column] for column in OUTPUTS]])


def _rows(name: str, header: Sequence[str], reader: Iterator[list[str]]) -> Iterator[list[int]]:
    for line, row in enumerate(reader, start=2):
        if line > MAX_ROWS + 1:
            raise _malformed(name, line, header[0], f"a trace may have at most {MAX_ROWS} rows")
        if len(row) != len(header):
            column = header[min(len(row), len(header) - 1)]
            raise _malformed(name, line, column, f"the row has {len(row)} values, the header {len(header)}")
        yield [_value(name, line, column, text) for column, text in zip(header, row, strict=True)]


def _value(name: str, line: int, column: str, text: str) -> int:
    if column == "mode":
        if text not in MODES:
            raise _malformed(name, line, column, f"must be one of {', '.join(MODES)}, got {text!r}")
        return MODES[text]
    if not _INTEGER.fullmatch(text):
        raise _malformed(name, line, column, f"must be a whole number, got {text[:40]!r}")
    value = int(text)
    low, high = (0, 1) if column == "in_flight" else (INT32_MIN, INT32_MAX)
    if not low <= value <= high:
        raise _malformed(name, line, column, f"must be between {low} and {high}, got {value}")
    return value


def _malformed(name: str, line: int, column: str, reason: str) -> InputError:
    return InputError(f"{name} cannot be replayed.", hint=_HINT, problems=(Problem(f"line {line}, {column}", reason),))
