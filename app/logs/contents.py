"""Access to the bytes of a log, memory-mapped where possible."""

import io
import mmap
from typing import BinaryIO, Final

from app.core.errors import Problem, TrajectoryError

MAX_BYTES: Final = 512 * 2**20

Contents = bytes | mmap.mmap
"""Both support slicing, searching and indexing."""


def contents(stream: BinaryIO) -> Contents:
    """All bytes of a stream, mapped if it has a file. Raises TrajectoryError if it is larger than 512 MiB."""
    size = stream.seek(0, io.SEEK_END)
    stream.seek(0)
    if size > MAX_BYTES:
        raise TrajectoryError(
            f"The log is {size / 2**20:.0f} MiB large.",
            hint=f"Cut it to the flight: at most {MAX_BYTES / 2**20:g} MiB are read.",
            problems=(Problem("file", f"is larger than {MAX_BYTES / 2**20:g} MiB"),),
        )
    if not size:
        return b""
    try:
        return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError):  # not a file, or one that cannot be mapped
        return stream.read()


def refused(reason: str, hint: str) -> TrajectoryError:
    """The error for a file that cannot be read as the expected kind of log."""
    return TrajectoryError("This file cannot be read as a flight.", hint=hint, problems=(Problem("file", reason),))
