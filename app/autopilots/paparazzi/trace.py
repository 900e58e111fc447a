"""Reader of recorded runs of Paparazzi's vertical loop: CSV, optionally gzipped, one row per step, integers only."""

import csv
import gzip
import re
from array import array
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from app.core.control.vertical_guidance import INPUTS, INT32_MAX, INT32_MIN, MODES, OUTPUTS, LoopTrace
from app.core.errors import InputError, Problem
from app.logs.trace_table import GZIP, TraceChecks, is_zipped, read_rows, text_of

COLUMNS: Final = ("step", *INPUTS[:7], "zdd", *INPUTS[7:], *OUTPUTS)
_INTEGER: Final = re.compile(r"[+-]?[0-9]{1,19}")
_HINT: Final = f"A trace has the columns {','.join(COLUMNS)}, one row per 1/512 s, as 32-bit integers."


def read_loop_trace(path: Path) -> LoopTrace:
    """Read `path` (.csv or .csv.gz). Raises InputError naming the line and the column of the first error."""
    try:
        with path.open("rb") as raw:
            return _read(TraceChecks(path.name, _HINT), raw, zipped=path.suffix == ".gz")
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.", hint="Use a readable trace file, .csv or .csv.gz."
        ) from error


def read_loop_trace_stream(stream: BinaryIO, *, name: str) -> LoopTrace:
    """As `read_loop_trace`, from a stream; gzip is detected from its first bytes."""
    checks = TraceChecks(name, _HINT)
    try:
        return _read(checks, stream, zipped=is_zipped(stream))
    except gzip.BadGzipFile as error:
        raise checks.damaged(error) from error


def may_be_loop_trace(head: bytes) -> bool:
    """Whether a file with this head can be a trace: gzipped, or text whose first line names a column of a trace."""
    first = head.partition(b"\n")[0]
    return head.startswith(GZIP) or bool({b"mode", b"z_ref", b"r33"} & {column.strip() for column in first.split(b",")})


def _read(checks: TraceChecks, raw: BinaryIO, *, zipped: bool) -> LoopTrace:
    with text_of(checks, raw, zipped=zipped) as text:
        reader = csv.reader(text)
        header = next(reader, [])
        if problems := tuple(Problem(f"line 1, {each}", "column is missing") for each in COLUMNS if each not in header):
            raise InputError(f"{checks.name} is not a trace of the vertical loop.", hint=_HINT, problems=problems)
        if len(header) != len(COLUMNS):
            extra = next((column for column in header if column not in COLUMNS), header[-1])
            raise checks.malformed(f"line 1, {extra}", "column is unknown or appears twice")
        values = array("q", read_rows(checks, reader, header, _value, first_line=2))
    rows = np.array(values, dtype=np.int64).reshape(-1, len(header))
    return LoopTrace(*(rows[:, [header.index(column) for column in columns]] for columns in (INPUTS, OUTPUTS)))


def _value(column: str, text: str) -> int:
    if column == "mode":
        if text not in MODES:
            raise ValueError(f"must be one of {', '.join(MODES)}, got {text!r}")
        return MODES[text]
    if not _INTEGER.fullmatch(text):
        raise ValueError(f"must be a whole number, got {text[:40]!r}")
    value = int(text)
    low, high = (0, 1) if column == "in_flight" else (INT32_MIN, INT32_MAX)
    if not low <= value <= high:
        raise ValueError(f"must be between {low} and {high}, got {value}")
    return value
