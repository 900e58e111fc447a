"""Change events, written in the transaction of the change itself, so that none is lost and none is false.

The web process reads them in order and publishes them to the browsers. They say that a thing changed, not its new
state. Commits of other processes are detected at the cost of one PRAGMA per poll.
"""

import sqlite3
import threading
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final, Self
from urllib.parse import quote

from sqlalchemy import delete, func, insert, select
from sqlalchemy.orm import Session, UOWTransaction

from app.db.base import Reported, utc_now
from app.db.models import EventRow

KEPT_EVENTS: Final = 10_000
"""A browser that missed more changes than this loads everything again."""
_PRUNE_EVERY: Final = 500


def record_changes(session: Session, _context: UOWTransaction) -> None:
    """After-flush hook: write one event row for each reported row that was added, changed or deleted."""
    changed = [row for row in (*session.new, *session.dirty, *session.deleted) if isinstance(row, Reported)]
    if not changed:
        return
    at, changes = utc_now(), [row.reported_as() for row in changed]
    session.connection().execute(
        insert(EventRow),
        [{"topic": topic, "entity_id": id_, "campaign_id": of, "at": at} for topic, id_, of in changes],
    )
    latest = latest_event_id(session)
    if latest % _PRUNE_EVERY < len(changed):
        session.connection().execute(delete(EventRow).where(EventRow.id <= latest - KEPT_EVENTS))


def latest_event_id(session: Session) -> int:
    """Id of the newest event; 0 before the first."""
    return session.scalar(select(func.max(EventRow.id))) or 0


def latest_event_before(session: Session, at: datetime) -> int:
    """Id of the newest event before that time; 0 if there is none."""
    newest = select(EventRow.id).where(EventRow.at < at).order_by(EventRow.id.desc()).limit(1)
    return session.scalar(newest) or 0


def holds_everything_after(session: Session, event_id: int) -> bool:
    """Whether every event after this one is still stored; False also for an id that does not exist yet."""
    oldest, latest = session.execute(select(func.min(EventRow.id), func.max(EventRow.id))).one()
    return bool((oldest or 1) - 1 <= event_id <= (latest or 0))


def events_after(session: Session, event_id: int, *, limit: int) -> Sequence[EventRow]:
    """The next events in order, at most `limit`."""
    return session.scalars(select(EventRow).where(EventRow.id > event_id).order_by(EventRow.id).limit(limit)).all()


POLL_INTERVAL_S: Final = 0.02


class DatabaseWatch:
    """Polls SQLite's `PRAGMA data_version`, which changes with every commit of any other connection.

    For the thread that enters it. The file must exist.
    """

    def __init__(self, database: Path) -> None:
        self._database = database

    def __enter__(self) -> Self:
        self._connection = sqlite3.connect(f"file:{quote(str(self._database))}?mode=ro", uri=True, isolation_level=None)
        self._seen = -1
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def changed(self) -> bool:
        """Whether anything was committed since the last call; True at the first call, and when the PRAGMA fails, so
        that the caller reads the database and gets the error itself."""
        try:
            (version,) = self._connection.execute("PRAGMA data_version").fetchone()
        except sqlite3.OperationalError:
            return True
        seen, self._seen = self._seen, int(version)
        return seen != self._seen

    def wait(self, stop: threading.Event, timeout_s: float) -> bool:
        """Wait until something is committed (True), or until `stop` is set or the timeout has passed (False)."""
        looks = max(1, round(timeout_s / POLL_INTERVAL_S))
        return any(self.changed() for _ in range(looks) if not stop.wait(POLL_INTERVAL_S))
