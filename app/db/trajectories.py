"""Trajectories in the database: single-precision columns, byte-shuffled and compressed, with a version number and a
checksum.

Version 1: the columns (time first) as little-endian float32, shape (columns, samples). The four bytes of each column's
numbers are gathered plane by plane, because neighbouring samples share their high bytes; then zstd level 3 over all.
The checksum is the SHA-256 of the column names, a NUL, and the plain float32 bytes.
"""

import hashlib
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import Final

import numpy as np
import zstandard
from numpy.typing import NDArray
from sqlalchemy import select
from sqlalchemy.orm import Session, defer, undefer

from app.common.errors import StorageError
from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Trajectory
from app.db.models import TrajectoryRow, TrialRow
from app.db.session import Database

VERSION: Final = 1
_TIME: Final = "time_s"
_WIDTH: Final = 4


def pack(trajectory: Trajectory) -> TrajectoryRow:
    """Pack a trajectory as a row to be stored; the database refuses any later change of it.

    Raises TrajectoryError when single precision cannot hold it: a number is too large, or time stamps collapse.
    """
    columns = [_TIME, *trajectory.channels]
    with np.errstate(over="ignore"):
        table = np.vstack([trajectory.time_s, *trajectory.channels.values()]).astype("<f4")
    _require_storable(columns, table)
    plain = table.tobytes()
    planes = table.view(np.uint8).reshape(len(columns), -1, _WIDTH).transpose(0, 2, 1)
    return TrajectoryRow(
        codec=VERSION,
        columns=columns,
        samples=table.shape[1],
        duration_s=float(table[0, -1] - table[0, 0]),
        source=trajectory.source,
        clock=trajectory.clock,
        checksum=_checksum(columns, plain),
        data=zstandard.ZstdCompressor(level=3).compress(planes.tobytes()),
    )


def unpack(packed: TrajectoryRow) -> Trajectory:
    """Unpack a record, verified against its checksum, in single precision. Raises StorageError when it is damaged."""
    if packed.codec != VERSION:
        raise StorageError(
            f"A flight record has the unknown version {packed.codec}.",
            hint="It was written by a newer Gainline; open it with that version.",
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


def _require_storable(columns: list[str], table: NDArray[np.float32]) -> None:
    if table.shape[1] == 0:
        raise TrajectoryError(
            "This record is empty.",
            hint="Choose a record with at least two samples.",
            problems=(Problem(_TIME, "has no samples"),),
        )
    finite = np.isfinite(table)
    if not finite.all():
        column, sample = (int(index) for index in np.argwhere(~finite)[0])
        raise TrajectoryError(
            "This record contains a number that cannot be stored.",
            hint="Correct the record, then upload it again.",
            problems=(Problem(columns[column], f"is not finite, or larger than 3.4e38, at sample {sample}"),),
        )
    if (np.diff(table[0]) <= 0).any():
        sample = int(np.argmax(np.diff(table[0]) <= 0)) + 1
        raise TrajectoryError(
            "The time stamps of this record do not increase once stored (single precision).",
            hint="Count time from the command, and sample no faster than 100 kHz.",
            problems=(Problem(_TIME, f"does not increase at sample {sample}"),),
        )


def _checksum(columns: list[str], plain: bytes) -> str:
    return hashlib.sha256(b"\n".join(name.encode() for name in columns) + b"\0" + plain).hexdigest()


def _damaged() -> StorageError:
    return StorageError(
        "A stored flight record is damaged: its checksum does not match.",
        hint="Restore it from a backup; the trial's other data is intact.",
    )


def samples_of(session: Session, trajectory_ids: Collection[int]) -> Mapping[int, TrajectoryRow]:
    """Records with their samples, by id."""
    rows = session.scalars(
        select(TrajectoryRow).where(TrajectoryRow.id.in_(trajectory_ids)).options(undefer(TrajectoryRow.data))
    )
    return {row.id: row for row in rows}


def trajectory_of(session: Session, trajectory_id: int) -> Trajectory:
    """A stored trajectory, verified against its checksum."""
    return unpack(samples_of(session, [trajectory_id])[trajectory_id])


def readable_of(session: Session, trajectory_ids: Collection[int]) -> dict[int, Trajectory]:
    """Several stored trajectories, by id, without the damaged ones."""
    found: dict[int, Trajectory] = {}
    for identity, row in samples_of(session, trajectory_ids).items():
        with suppress(StorageError):
            found[identity] = unpack(row)
    return found


_NAMED: Final = 5
_AT_ONCE: Final = 20


def is_intact(row: TrajectoryRow) -> bool:
    """Whether the record's samples match its checksum."""
    try:
        unpack(row)
    except StorageError:
        return False
    return True


def damaged_trials(session: Session, campaign_id: int | None = None) -> list[TrialRow]:
    """Trials of one campaign, or of all, whose record is damaged; by campaign and number.

    The records are loaded in batches because all of them may not fit into memory.
    """
    damaged: list[TrialRow] = []
    recorded = select(TrialRow).where(TrialRow.trajectory_id.is_not(None))
    wanted = recorded if campaign_id is None else recorded.where(TrialRow.campaign_id == campaign_id)
    lean = wanted.options(defer(TrialRow.gate), defer(TrialRow.curve), defer(TrialRow.settings))
    rows = session.scalars(lean.order_by(TrialRow.campaign_id, TrialRow.number)).all()
    for first in range(0, len(rows), _AT_ONCE):
        some = {row.trajectory_id: row for row in rows[first : first + _AT_ONCE] if row.trajectory_id is not None}
        readable = readable_of(session, some)
        damaged += [row for identity, row in some.items() if identity not in readable]
    return damaged


def require_intact(database_file: Path) -> None:
    """Verify all records of a database. Raises StorageError that names every trial whose record is damaged."""
    with closing(Database(database_file)) as database, database.read() as session:
        damaged = damaged_trials(session)
        if damaged:
            raise refused_for(damaged, "The backup was not created")


def refused_for(damaged: Sequence[TrialRow], what: str) -> StorageError:
    """Error that says what was not done because these trials' records are damaged."""
    names = [f"trial {row.number} of campaign {row.campaign_id}" for row in damaged]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    records = "the record of" if len(names) == 1 else f"{len(names)} records are damaged, those of"
    ending = " is damaged: its checksum does not match." if len(names) == 1 else "."
    return StorageError(
        f"{what}: {records} {', '.join(names[:_NAMED])}{more}{ending}",
        hint="Everything else is intact. Restore the damaged records from an earlier backup or bundle. To keep "
        "the database unchanged, stop Gainline and copy gainline.sqlite3.",
        problems=tuple(Problem(name, "its record does not match its checksum") for name in names),
    )
