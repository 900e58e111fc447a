"""What the parts of a worker that carry out flights and acts have in common: its database, and the requests to abort a
flight, in memory so that nothing blocks.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from sqlalchemy.orm import Session

from app.common.errors import StorageError
from app.core.clock import REAL_TIME, Clock
from app.db.session import Database, retry_until_stored
from app.live.messages import PublishedMessage
from app.vehicles.flight_end import StopRequest

T = TypeVar("T")


class AbortFlag:
    """Request to end one flight. Set once, from any thread; the listener is notified at once."""

    def __init__(self) -> None:
        self.request: StopRequest | None = None
        self._tell: Callable[[StopRequest], None] = lambda _request: None

    def set(self, request: StopRequest) -> None:
        """Set the flag; only the first request counts."""
        if self.request is None:
            self.request = request
            self._tell(request)

    def add_listener(self, tell: Callable[[StopRequest], None]) -> None:
        """Set the listener; it is called at once if the flag is set already."""
        self._tell = tell
        if self.request is not None:
            tell(self.request)


class AbortRegistry:
    """Abort flags of the flights of this process, by trial. Lock-free: safe from any thread and from signal
    handlers."""

    def __init__(self) -> None:
        self._flags: dict[int, AbortFlag] = {}
        self._closed: StopRequest | None = None

    def register(self, trial_id: int) -> AbortFlag:
        """Return the trial's flag; in a closed registry it is set already."""
        flag = self._flags.setdefault(trial_id, AbortFlag())
        if self._closed is not None:
            flag.set(self._closed)
        return flag

    def unregister(self, trial_id: int) -> None:
        self._flags.pop(trial_id, None)

    def abort(self, trial_id: int, request: StopRequest) -> bool:
        """Abort the trial's flight. Returns whether that trial is being flown here."""
        if (flag := self._flags.get(trial_id)) is None:
            return False
        flag.set(request)
        return True

    def abort_all(self, request: StopRequest) -> None:
        """End every flight, and every flight registered later."""
        self._closed = request
        for flag in tuple(self._flags.values()):
            flag.set(request)

    def trial_ids(self) -> list[int]:
        return sorted(self._flags)


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerPart:
    """A worker's database and data folder, and what it shares with its other parts. `closing` ends the retries while
    the database accepts no writes; `worker` is its name in the database."""

    database: Database
    data_dir: Path
    abort_registry: AbortRegistry
    publish: Callable[[PublishedMessage], None]
    worker: str
    closing: threading.Event
    clock: Clock = REAL_TIME

    def store(self, work: Callable[[Session], T]) -> T:
        """Result of `work` in a transaction. Raises StorageError."""
        with self.database.write() as session:
            return work(session)

    def store_with_retry(self, work: Callable[[Session], T], refused: Callable[[StorageError], object]) -> T | None:
        """The same, retried until the database accepts it; None when the worker closes meanwhile."""
        return retry_until_stored(lambda: self.store(work), refused, closing=self.closing, clock=self.clock)
