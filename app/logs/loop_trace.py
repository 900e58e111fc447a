"""Reader of recorded runs of the vertical loop: CSV, gzipped or not, one row a step, integers throughout."""

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from app.core.control.fixed_point import INT32_MAX, INT32_MIN
from app.core.control.replay import INPUTS, OUTPUTS, LoopTrace
from app.core.control.vertical_loop import MODES
from app.core.errors import InputError, Problem

COLUMNS: Final = ("step", *INPUTS[:7], "zdd", *INPUTS[7:], *OUTPUTS)
MAX_ROWS: Final = 1_000_000
_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,19}")

_HINT: Final = f"A trace has the columns {','.join(COLUMNS)}, one row for each 1/512 s, whole numbers of 32 bits."


def read_loop_trace(path: Path) -> LoopTrace:
    """Read `path` (.csv or .csv.gz). Raises InputError naming the line and the column of the first thing wrong."""
    try:
        with path.open("rb") as raw:
            stream = gzip.GzipFile(fileobj=raw) if path.suffix == ".gz" else raw
            with io.TextIOWrapper(stream, encoding="utf-8", newline="") as text:
                return _read(path.name, text)
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Give a readable trace file, .csv or .csv.gz."
        ) from error
    except (EOFError, zlib.error, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path.name} is damaged or not a text file: {error}.", hint=_HINT) from error


def _read(name: str, text: io.TextIOWrapper) -> LoopTrace:
    reader = csv.reader(text)
    header = next(reader, [])
    missing = [column for column in COLUMNS if column not in header]
    if problems := tuple(Problem(f"line 1, {column}", "column is missing") for column in missing):
        raise InputError(f"{name} is not a trace of the vertical loop.", hint=_HINT, problems=problems)
    if len(header) != len(COLUMNS):
        extra = next((column for column in header if column not in COLUMNS), header[-1])
        raise _malformed(name, 1, extra, "column is unknown or appears twice")
    rows = np.array(list(_rows(name, header, reader)), dtype=np.int64)
    if not len(rows):
        raise InputError(f"{name} holds a header and no rows.", hint=_HINT)
    place = {column: index for index, column in enumerate(header)}
    return LoopTrace(rows[:, [place[column] for column in INPUTS]], rows[:, [place[column] for column in OUTPUTS]])


def _rows(name: str, header: Sequence[str], reader: Iterator[list[str]]) -> Iterator[list[int]]:
    for line, row in enumerate(reader, start=2):
        if line > MAX_ROWS + 1:
            raise _malformed(name, line, header[0], f"a trace may hold at most {MAX_ROWS} rows")
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
        raise _malformed(name, line, column, f"must lie in {low} … {high}, got {value}")
    return value


def _malformed(name: str, line: int, column: str, reason: str) -> InputError:
    return InputError(f"{name} cannot be replayed.", hint=_HINT, problems=(Problem(f"line {line}, {column}", reason),))
