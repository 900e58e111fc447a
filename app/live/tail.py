"""Reads the outbox in the web process and publishes every change, in order and once."""

import threading
from collections.abc import Callable, Iterator
from typing import Final

import structlog
from sqlalchemy.exc import DBAPIError

from app.common.errors import StorageError
from app.db.outbox import events_after, latest_event_id
from app.db.session import Database
from app.live.hub import Change
from app.live.watch import DatabaseWatch

BATCH: Final = 500
PAUSE_AFTER_TROUBLE_S: Final = 1.0
LOOK_ANYWAY_S: Final = 5.0

_log = structlog.get_logger(__name__)


def changes_after(database: Database, event_id: int) -> Iterator[Change]:
    """All changes after that event up to now, read in short transactions."""
    while True:
        with database.read() as session:
            batch = [
                Change(id=row.id, topic=row.topic, entity_id=row.entity_id, campaign_id=row.campaign_id)
                for row in events_after(session, event_id, limit=BATCH)
            ]
        yield from batch
        if len(batch) < BATCH:
            return
        event_id = batch[-1].id


class OutboxTail:
    """A thread that calls `publish(change)` for every event committed after `start`."""

    def __init__(self, database: Database, publish: Callable[[Change], None]) -> None:
        self._database = database
        self._publish = publish
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="outbox tail", daemon=True)

    def start(self) -> None:
        """Note the present end of the outbox, and start the thread."""
        with self._database.read() as session:
            self._last = latest_event_id(session)
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._follow()
            except (StorageError, DBAPIError) as error:
                _log.error("the outbox cannot be read", why=str(error))
                self._stop.wait(PAUSE_AFTER_TROUBLE_S)

    def _follow(self) -> None:
        with DatabaseWatch(self._database.file) as watch:
            while not self._stop.is_set():
                for change in changes_after(self._database, self._last):
                    self._publish(change)
                    self._last = change.id
                watch.wait(self._stop, LOOK_ANYWAY_S)
