"""Logs: one JSON object per line, with campaign and trial ids, to `<data_dir>/log/<role>.log`, and warnings and errors
to standard error; and the lines of one job, read from the worker's log files. `say` prints what is no log.
"""

import faulthandler
import json
import logging.handlers
import signal
import sys
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final, Literal

import structlog
from structlog.typing import Processor

from app.common.data_folder import prepare_data_dir

KEPT_LOGS: Final = 5

_SHARED: Final[tuple[Processor, ...]] = (
    structlog.contextvars.merge_contextvars,
    structlog.stdlib.add_log_level,
    structlog.stdlib.add_logger_name,
    structlog.processors.TimeStamper(fmt="iso", utc=True),
)


def configure_logs(data_dir: Path, role: Literal["web", "worker"], level: str) -> None:
    """Send this process's logs, including the libraries', to its file, and warnings and errors to standard error.

    On SIGUSR1 it writes the stack of every thread to standard error, to diagnose a hang.
    """
    faulthandler.register(signal.SIGUSR1)
    folder = data_dir / "log"
    prepare_data_dir(folder)
    to_file = logging.handlers.RotatingFileHandler(
        folder / f"{role}.log", maxBytes=5_000_000, backupCount=KEPT_LOGS, delay=True, encoding="utf-8"
    )
    to_file.setFormatter(_formatter(structlog.processors.JSONRenderer()))
    to_stderr = logging.StreamHandler()
    to_stderr.setFormatter(_formatter(structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty())))
    to_stderr.setLevel(logging.WARNING)
    logging.basicConfig(level=level.upper(), handlers=[to_file, to_stderr], force=True)
    logging.getLogger("alembic.runtime.plugins").setLevel(logging.WARNING)  # it names each of its plugins
    logging.raiseExceptions = False  # with a full disk, not every log line must become a traceback
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *_SHARED,
            structlog.processors.format_exc_info,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        cache_logger_on_first_use=True,
    )


def say(line: str) -> None:
    """Print one line for a person, who may have stopped reading."""
    with suppress(OSError):
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()


def _formatter(renderer: Processor) -> logging.Formatter:
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[*_SHARED, structlog.processors.format_exc_info],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, renderer],
    )


_KNOWN: Final = frozenset({"event", "level", "logger", "timestamp", "exception", "job_id"})


@dataclass(frozen=True, slots=True)
class LogLine:
    """One log line: `details` are its further fields as text, `exception` is a traceback, empty without one."""

    at: datetime
    level: str
    message: str
    details: Mapping[str, str]
    exception: str


def lines_of_job(data_dir: Path, job_id: int, *, since: datetime, limit: int) -> tuple[list[LogLine], int]:
    """The last `limit` lines about a job created at `since`, oldest first, and the total count.

    Older lines are ignored: job ids start again with a new database while the log files stay, so they belong to another
    job.
    """
    found: list[LogLine] = []
    for suffix in (*(f".{number}" for number in range(KEPT_LOGS, 0, -1)), ""):
        file = data_dir / "log" / f"worker.log{suffix}"
        found.extend(line for line in _of_file(file, job_id, since) if line.at >= since)
    return found[-limit:], len(found)


def _of_file(file: Path, job_id: int, since: datetime) -> Iterator[LogLine]:
    """Lines of one file about the job; most lines are about others and are skipped by their text, without being
    parsed."""
    mark = f'"job_id": {job_id}'
    try:
        if file.stat().st_mtime < since.timestamp():
            return
        with file.open(encoding="utf-8", errors="replace") as opened:
            for text in opened:
                if mark in text and (line := _parsed(text, job_id)) is not None:
                    yield line
    except OSError:  # missing, or rotated meanwhile
        return


def _parsed(text: str, job_id: int) -> LogLine | None:
    try:
        entry = json.loads(text)
        if entry.get("job_id") != job_id:
            return None
        return LogLine(
            at=datetime.fromisoformat(entry["timestamp"]),
            level=str(entry.get("level", "info")),
            message=str(entry["event"]),
            details={name: str(value) for name, value in entry.items() if name not in _KNOWN and value is not None},
            exception=str(entry.get("exception", "")),
        )
    except (ValueError, TypeError, KeyError, AttributeError):  # a line truncated by a crash
        return None
