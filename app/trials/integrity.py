"""Integrity of stored flight records: every record is verified against its checksum."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from app.common.errors import StorageError
from app.core.errors import Problem
from app.db.models import TrajectoryRow, TrialRow
from app.db.session import Database
from app.trials import history, repository

_NAMED: Final = 5
_AT_ONCE: Final = 20


def is_intact(row: TrajectoryRow) -> bool:
    """Whether the record's samples match its checksum."""
    try:
        history.unpacked(row)
    except StorageError:
        return False
    return True


def damaged_trials(session: Session, campaign_id: int | None = None) -> list[TrialRow]:
    """Trials of one campaign, or of all, whose record is damaged; by campaign and number."""
    return [row for row, record in _recorded(session, campaign_id) if not is_intact(record)]


def require_intact(database_file: Path) -> None:
    """Verify all records of a database. Raises StorageError that names every trial whose record is damaged."""
    with closing(Database(database_file)) as database, database.read() as session:
        damaged = damaged_trials(session)
        if damaged:
            raise refused_for(damaged, "The backup was not made")


def refused_for(damaged: Sequence[TrialRow], what: str) -> StorageError:
    """Error that says what was not done because these trials' records are damaged."""
    names = [f"trial {row.number} of campaign {row.campaign_id}" for row in damaged]
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    records = "the record of" if len(names) == 1 else f"{len(names)} records are damaged, those of"
    ending = " is damaged: its checksum does not fit." if len(names) == 1 else "."
    return StorageError(
        f"{what}: {records} {', '.join(names[:_NAMED])}{more}{ending}",
        hint="Everything else is intact. Take the damaged records from an earlier backup or bundle; to keep the "
        "database as it is, stop Gainline and copy gainline.sqlite3.",
        problems=tuple(Problem(name, "its record does not fit its checksum") for name in names),
    )


def _recorded(session: Session, campaign_id: int | None) -> Iterator[tuple[TrialRow, TrajectoryRow]]:
    """Trials with their records, loaded in batches because all of them may not fit into memory."""
    rows = repository.recorded(session, campaign_id)
    for first in range(0, len(rows), _AT_ONCE):
        some = rows[first : first + _AT_ONCE]
        records = repository.samples_of(session, [row.trajectory_id for row in some if row.trajectory_id is not None])
        for row in some:
            if row.trajectory_id is not None:
                yield row, records[row.trajectory_id]
        for record in records.values():
            session.expire(record, ["data"])
