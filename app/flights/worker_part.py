"""What the parts of a worker that carry out flights and acts have in common."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from sqlalchemy.orm import Session

from app.common.errors import StorageError
from app.core.clock import REAL_TIME, Clock
from app.db.session import Database, retry_until_stored
from app.flights.abort import AbortRegistry
from app.flights.process_messages import Publish

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerPart:
    """A worker's database and data folder, and what it shares with its other parts. `closing` ends the retries while
    the database accepts no writes; `worker` is its name in the database."""

    database: Database
    data_dir: Path
    abort_registry: AbortRegistry
    publish: Publish
    worker: str
    closing: threading.Event
    clock: Clock = REAL_TIME

    def store(self, work: Callable[[Session], T]) -> T:
        """Result of `work` in a transaction. Raises StorageError."""
        with self.database.write() as session:
            return work(session)

    def store_with_retry(self, work: Callable[[Session], T], refused: Callable[[StorageError], None]) -> T | None:
        """The same, retried until the database accepts it; None when the worker closes meanwhile."""
        return retry_until_stored(lambda: self.store(work), refused, closing=self.closing, clock=self.clock)
