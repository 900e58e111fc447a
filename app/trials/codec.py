"""Storage format of a trajectory: single-precision columns, byte-shuffled and compressed, with a version number.

Version 1: the columns (time first) as little-endian float32, shape (columns, samples). The four bytes of each column's
numbers are gathered plane by plane, because neighbouring samples share their high bytes; then zstd level 3 over all.
The checksum is the SHA-256 of the column names, a NUL, and the plain float32 bytes.
"""

import hashlib
from dataclasses import dataclass
from typing import Final

import numpy as np
import zstandard
from numpy.typing import NDArray

from app.common.errors import StorageError
from app.core.errors import Problem, TrajectoryError
from app.core.trajectory import Trajectory

VERSION: Final = 1
_LEVEL: Final = 3
_TIME: Final = "time_s"
_WIDTH: Final = 4

Table = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Packed:
    """A trajectory as stored in the database."""

    codec: int
    columns: list[str]
    samples: int
    duration_s: float
    source: str
    clock: str
    checksum: str
    data: bytes


def pack(trajectory: Trajectory) -> Packed:
    """Pack a trajectory for storage.

    Raises TrajectoryError when single precision cannot hold it: a number is too large, or time stamps collapse.
    """
    columns = [_TIME, *trajectory.channels]
    with np.errstate(over="ignore"):
        table = np.vstack([trajectory.time_s, *trajectory.channels.values()]).astype("<f4")
    _require_storable(columns, table)
    plain = table.tobytes()
    planes = table.view(np.uint8).reshape(len(columns), -1, _WIDTH).transpose(0, 2, 1)
    return Packed(
        codec=VERSION,
        columns=columns,
        samples=table.shape[1],
        duration_s=float(table[0, -1] - table[0, 0]),
        source=trajectory.source,
        clock=trajectory.clock,
        checksum=_checksum(columns, plain),
        data=zstandard.ZstdCompressor(level=_LEVEL).compress(planes.tobytes()),
    )


def unpack(packed: Packed) -> Trajectory:
    """Unpack a stored trajectory in single precision. Raises StorageError when the record is damaged."""
    if packed.codec != VERSION:
        raise StorageError(
            f"A flight record has the unknown version {packed.codec}.",
            hint="It was written by a newer Gainline; open it with that one.",
        )
    size = len(packed.columns) * packed.samples * _WIDTH
    try:
        planes = zstandard.ZstdDecompressor().decompress(packed.data, max_output_size=size)
        shuffled = np.frombuffer(planes, np.uint8).reshape(len(packed.columns), _WIDTH, packed.samples)
    except (zstandard.ZstdError, ValueError) as error:
        raise _damaged() from error
    table = np.ascontiguousarray(shuffled.transpose(0, 2, 1)).view("<f4")[..., 0]
    if _checksum(packed.columns, table.tobytes()) != packed.checksum:
        raise _damaged()
    numbers = table.astype(np.float64)
    return Trajectory(numbers[0], dict(zip(packed.columns[1:], numbers[1:], strict=True)), packed.source, packed.clock)


def _require_storable(columns: list[str], table: Table) -> None:
    if table.shape[1] == 0:
        raise TrajectoryError(
            "This record is empty.",
            hint="Send a record with at least two samples.",
            problems=(Problem(_TIME, "has no samples"),),
        )
    finite = np.isfinite(table)
    if not finite.all():
        column, sample = (int(index) for index in np.argwhere(~finite)[0])
        raise TrajectoryError(
            "This record holds a number that cannot be stored.",
            hint="Correct the record and send it again.",
            problems=(Problem(columns[column], f"is not finite, or larger than 3.4e38, at sample {sample}"),),
        )
    if (np.diff(table[0]) <= 0).any():
        sample = int(np.argmax(np.diff(table[0]) <= 0)) + 1
        raise TrajectoryError(
            "The time stamps of this record do not rise once they are stored (single precision).",
            hint="Let time start near zero at the command, and sample no faster than 100 kHz.",
            problems=(Problem(_TIME, f"does not rise at sample {sample}"),),
        )


def _checksum(columns: list[str], plain: bytes) -> str:
    return hashlib.sha256(b"\n".join(name.encode() for name in columns) + b"\0" + plain).hexdigest()


def _damaged() -> StorageError:
    return StorageError(
        "A stored flight record is damaged: its checksum does not fit.",
        hint="Restore it from a backup; the trial's other figures are intact.",
    )
