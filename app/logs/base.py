"""What every log reader needs: a log's bytes, memory-mapped where possible, and tables of its messages."""

import io
import mmap
from collections.abc import Iterator, Mapping
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples

MAX_BYTES: Final = 512 * 2**20
HEAD_BYTES: Final = 16 * 2**10
"""So many bytes tell the format of a file: a log may begin with the end of another one."""

Table = Mapping[str, NDArray[np.generic]]
"""Columns of one message type or topic, each of shape (n,)."""

Contents = bytes | mmap.mmap
"""Both support slicing, searching and indexing."""


def contents(stream: BinaryIO) -> Contents:
    """All bytes of a stream, mapped if it has a file. Raises TrajectoryError if it is larger than 512 MiB."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    if size > MAX_BYTES:
        raise TrajectoryError(
            f"The log is too large: {size / 2**20:.0f} MiB.",
            hint=f"Trim it to the flight: at most {MAX_BYTES / 2**20:g} MiB can be read.",
            problems=(Problem("file", f"is larger than {MAX_BYTES / 2**20:g} MiB"),),
        )
    if not size:
        return b""
    try:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError):  # not a file, or one that cannot be mapped
        return stream.read()


def refused(reason: str, hint: str, *, field: str = "file") -> TrajectoryError:
    """The error for a file that cannot be read as the expected kind of log."""
    return TrajectoryError("This file cannot be read as a flight.", hint=hint, problems=(Problem(field, reason),))


def numbers(column: NDArray[np.generic]) -> Samples:
    """The column as floats; NaN if a damaged description made it a text."""
    if column.ndim != 1 or column.dtype.kind not in "iuf":
        return np.full(len(column), np.nan)
    with np.errstate(invalid="ignore"):  # a damaged number may be a signalling NaN
        return column.astype(np.float64)


def rows_of(table: Table, clock: str, *names: str) -> Iterator[tuple[float, ...]]:
    """Time, in s, and columns of a table, row by row; none if a column is missing. `clock` is the one in µs."""
    if {clock, *names} <= table.keys():
        columns = [numbers(table[clock]) / 1e6, *(numbers(table[name]) for name in names)]
        yield from zip(*(column.tolist() for column in columns), strict=True)
