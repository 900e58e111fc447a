"""Reader of takeoffs flown elsewhere: CSV with the columns time_s, altitude_m and optionally more.

UTF-8 (with or without a byte order mark), commas between values, decimal points, lines ending in LF or CRLF; one header
line, then one line per sample. `time_s` counts from the command and increases strictly; altitude is positive up. Of
further columns, known channels are kept and others ignored. Gaps are read without a check: scoring the flight detects
them.
"""

import codecs
import csv
import io
import math
from array import array
from collections.abc import Iterator, Sequence
from typing import BinaryIO, Final

import numpy as np

from app.core.errors import Problem, TrajectoryError
from app.core.formatting import count
from app.core.records.trajectory import CHANNEL_UNITS, Samples, Trajectory
from app.logs.base import refused

MAX_ROWS: Final = 200_000
MIN_ROWS: Final = 20

_REQUIRED: Final = ("time_s", "altitude_m")
_MISSING: Final = ("", "nan")
_MAX_LINE_BYTES: Final = 4096
_LARGEST: Final = 1e6
_LATEST: Final = 1e9
"""Of the times: some programs write microseconds."""

_FORMAT_HINT: Final = (
    "Save the flight as CSV in UTF-8 with the header time_s,altitude_m, commas between values and "
    "decimal points, time in seconds since the command, altitude in metres up."
)
_ROW_HINT: Final = "Correct or remove this line, then upload the file again; nothing was stored."


def read_takeoff_csv(stream: BinaryIO | bytes) -> Trajectory:
    """Read a whole file; memory is bounded by 200 000 rows whatever its length.

    An optional column with missing values is left out and named in the trajectory's `source`. Raises TrajectoryError
    naming the line and the column of the first error, and what to do about it.
    """
    reader = csv.reader(_lines(io.BytesIO(stream) if isinstance(stream, bytes) else stream), strict=True)
    try:
        header = [name.strip() for name in next(reader, [])]
        columns = _columns(header)
        values, numbers = _read_rows(((reader.line_num, row) for row in reader), header, columns)
    except csv.Error as error:
        raise refused(f"is not a line of CSV: {error}", _ROW_HINT, field=f"line {reader.line_num}") from error
    time_s, *channels = (np.array(column, dtype=np.float64) for column in values)
    if len(time_s) < MIN_ROWS:
        raise TrajectoryError(
            f"The file has {count(len(time_s), 'sample')}; a flight needs at least {MIN_ROWS}.",
            hint="Upload the whole takeoff, from the command to the end of the scored window.",
            problems=(Problem("time_s", "has too few rows"),),
        )
    _require_rising_when_stored(time_s, numbers)
    complete, source = _without_holes(dict(zip(columns[1:], channels, strict=True)), numbers)
    return Trajectory(time_s, complete, source=source, clock="vehicle")


def _without_holes(channels: dict[str, Samples], numbers: "array[int]") -> tuple[dict[str, Samples], str]:
    """The columns without missing values, and the flight's source, which names the others."""
    holes = {name: int(np.isnan(values).argmax()) for name, values in channels.items() if np.isnan(values).any()}
    complete = {name: values for name, values in channels.items() if name not in holes}
    if not holes:
        return complete, "csv"
    named = ", ".join(f"{name} (line {numbers[row]})" for name, row in holes.items())
    return complete, f"csv; left out, with its first missing value: {named}"


def _lines(stream: BinaryIO) -> Iterator[str]:
    """Text lines of a byte stream, each of bounded length."""
    number = 0
    while raw := stream.readline(_MAX_LINE_BYTES + 1):
        number += 1
        where = f"line {number}"
        if number > MAX_ROWS + 1:
            raise refused(
                f"is one too many: a flight may have at most {MAX_ROWS} rows",
                "Trim the log to the takeoff, or keep every tenth row: 50 rows per second are enough.",
                field=where,
            )
        if number == 1:
            if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
                raise refused("is text in UTF-16, not UTF-8", _FORMAT_HINT, field=where)
            raw = raw.removeprefix(codecs.BOM_UTF8)
        if b"\0" in raw:
            raise refused("contains bytes that are not text", _FORMAT_HINT, field=where)
        if len(raw) > _MAX_LINE_BYTES:
            raise refused(f"is longer than {_MAX_LINE_BYTES} bytes", _FORMAT_HINT, field=where)
        try:
            yield raw.decode("utf-8")
        except UnicodeDecodeError as error:
            raise refused(f"is not UTF-8 text (byte {error.start + 1})", _FORMAT_HINT, field=where) from error


def _columns(header: Sequence[str]) -> list[str]:
    """The columns to keep, time first."""
    if not header:
        raise TrajectoryError("The file is empty.", hint=_FORMAT_HINT, problems=(Problem("line 1", "is missing"),))
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            raise refused(f"has its columns separated by {name}, not commas", _FORMAT_HINT, field="line 1")
    problems = [Problem(f"line 1, column {name}", "is missing") for name in _REQUIRED if name not in header]
    problems += [
        Problem(f"line 1, column {name}", "appears twice")
        for name in sorted(set(header))
        if header.count(name) > 1 and name in (*_REQUIRED, *CHANNEL_UNITS)
    ]
    if problems:
        found = ", ".join(header[:10])
        raise TrajectoryError(
            f"The header is not that of a flight: {found}.", hint=_FORMAT_HINT, problems=tuple(problems)
        )
    return ["time_s", *(name for name in CHANNEL_UNITS if name in header)]


def _read_rows(
    rows: Iterator[tuple[int, list[str]]], header: Sequence[str], columns: Sequence[str]
) -> tuple[list["array[float]"], "array[int]"]:
    """Values of the kept columns, and the line number of each row. Empty lines are skipped."""
    places = [header.index(name) for name in columns]
    values = [array("d") for _ in columns]
    numbers = array("L")
    last_s = -math.inf
    for line, row in rows:
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise refused(
                f"has {len(row)} values where the header names {len(header)} columns", _ROW_HINT, field=f"line {line}"
            )
        numbers_of_row = [_value(row[place], line, name) for place, name in zip(places, columns, strict=True)]
        if numbers_of_row[0] <= last_s:
            raise refused(
                f"must increase, but {numbers_of_row[0]:g} s follows {last_s:g} s",
                _ROW_HINT,
                field=f"line {line}, column time_s",
            )
        last_s = numbers_of_row[0]
        for column, value in zip(values, numbers_of_row, strict=True):
            column.append(value)
        numbers.append(line)
    return values, numbers


def _value(text: str, line: int, column: str) -> float:
    """The value of a cell; NaN for a missing optional one."""
    if column not in _REQUIRED and text.strip().lower() in _MISSING:
        return math.nan
    where = f"line {line}, column {column}"
    try:
        value = float(text)
    except ValueError as error:
        raise refused(f"is not a number: {text.strip()[:40]!r}", _ROW_HINT, field=where) from error
    if not math.isfinite(value) or "_" in text:
        raise refused(f"is not a finite number: {text.strip()[:40]!r}", _ROW_HINT, field=where)
    if abs(value) > (_LATEST if column == "time_s" else _LARGEST):
        raise refused(
            f"is outside the range of a takeoff: {value:g}",
            "Count time from the command and use metres and seconds.",
            field=where,
        )
    return value


def _require_rising_when_stored(time_s: Samples, numbers: "array[int]") -> None:
    """Trajectories are stored in single precision; time stamps must remain distinct there."""
    if (late := np.flatnonzero(np.diff(time_s.astype(np.float32)) <= 0.0)).size:
        raise refused(
            "is too close to the previous line",
            "Count time from the command, and keep at most a few thousand rows per second.",
            field=f"line {numbers[int(late[0]) + 1]}, column time_s",
        )
