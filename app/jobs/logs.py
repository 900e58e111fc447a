"""What the worker wrote down about one job, found in its log files."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from app.observability import KEPT_LOGS

_KNOWN: Final = frozenset({"event", "level", "logger", "timestamp", "exception", "job_id"})
_LARGEST_LINE: Final = 200_000


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line: `details` are its further fields in words, `exception` a traceback, empty without one."""

    at: datetime
    level: str
    message: str
    details: Mapping[str, str]
    exception: str


def lines_of_job(data_dir: Path, job_id: int, *, since: datetime, limit: int) -> tuple[list[LogLine], int]:
    """The last `limit` lines about a job that was asked for at `since`, the oldest first, and the number of all.

    Ids of jobs begin anew with a new database, and the log files stay: older lines are somebody else's.
    """
    found: list[LogLine] = []
    for file in reversed([data_dir / "log" / f"worker.log{suffix}" for suffix in _suffixes()]):
        found.extend(line for line in _of_file(file, job_id, since) if line.at >= since)
    return found[-limit:], len(found)


def _suffixes() -> Iterator[str]:
    """Of the newest file first."""
    yield ""
    yield from (f".{number}" for number in range(1, KEPT_LOGS + 1))


def _of_file(file: Path, job_id: int, since: datetime) -> Iterator[LogLine]:
    """Most lines are somebody else's, which their text tells before it is parsed."""
    mark = f'"job_id": {job_id}'
    try:
        if file.stat().st_mtime < since.timestamp():
            return
        with file.open(encoding="utf-8", errors="replace") as opened:
            for text in opened:
                if mark in text and len(text) < _LARGEST_LINE and (line := _parsed(text, job_id)) is not None:
                    yield line
    except OSError:  # not there, or turned over meanwhile
        return


def _parsed(text: str, job_id: int) -> LogLine | None:
    try:
        said = json.loads(text)
        if said.get("job_id") != job_id:
            return None
        return LogLine(
            at=datetime.fromisoformat(said["timestamp"]),
            level=str(said.get("level", "info")),
            message=str(said["event"]),
            details={name: str(value) for name, value in said.items() if name not in _KNOWN and value is not None},
            exception=str(said.get("exception", "")),
        )
    except (ValueError, TypeError, KeyError, AttributeError):  # a line that was cut by a crash
        return None
