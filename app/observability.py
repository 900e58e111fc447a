"""Logs: one JSON object per line, with campaign and trial ids, to `<data_dir>/log/<role>.log` and to standard error."""

import faulthandler
import logging
import logging.handlers
import signal
import sys
from pathlib import Path
from typing import Final, Literal

import structlog
from structlog.typing import Processor

from app.data_dir import prepare_data_dir

MAX_LOG_BYTES: Final = 5_000_000
KEPT_LOGS: Final = 5

_SHARED: Final[tuple[Processor, ...]] = (
    structlog.contextvars.merge_contextvars,
    structlog.stdlib.add_log_level,
    structlog.stdlib.add_logger_name,
    structlog.processors.TimeStamper(fmt="iso", utc=True),
)


def configure_logs(data_dir: Path, role: Literal["web", "worker"], level: str) -> None:
    """Send this process's logs, including the libraries', to its file and to standard error (readable on a terminal).

    On SIGUSR1 it writes the stack of every thread to standard error, to diagnose a hang.
    """
    faulthandler.register(signal.SIGUSR1)
    folder = data_dir / "log"
    prepare_data_dir(folder)
    to_file = logging.handlers.RotatingFileHandler(
        folder / f"{role}.log", maxBytes=MAX_LOG_BYTES, backupCount=KEPT_LOGS, delay=True, encoding="utf-8"
    )
    to_file.setFormatter(_formatter(structlog.processors.JSONRenderer()))
    to_stderr = logging.StreamHandler()
    to_stderr.setFormatter(
        _formatter(structlog.dev.ConsoleRenderer() if sys.stderr.isatty() else structlog.processors.JSONRenderer())
    )
    if sys.stderr.isatty():
        to_stderr.setLevel(logging.WARNING)
    logging.basicConfig(level=level.upper(), handlers=[to_file, to_stderr], force=True)
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


def _formatter(renderer: Processor) -> logging.Formatter:
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[*_SHARED, structlog.processors.format_exc_info],
        processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, renderer],
    )
