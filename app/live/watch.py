"""Detects commits of other connections to the database, at the cost of one PRAGMA per poll."""

import sqlite3
import threading
from pathlib import Path
from types import TracebackType
from typing import Final, Self
from urllib.parse import quote

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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
