"""A low-priority process that computes one reproduction and reports its progress.

The process watches a pipe to its parent: when the parent closes the pipe or dies, it ends at once. A reproduction is
pure, so nothing is lost.
"""

import os
import signal
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from traceback import format_exc
from types import TracebackType
from typing import Final, Self

from app.core.errors import GainlineError, Problem
from app.processes import process_context
from app.reproductions.registry import get_reproduction
from app.reproductions.results import Result

NICENESS: Final = 10
SHUTDOWN_TIMEOUT_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class Progress:
    """Message of the process: the share done, 0 … 1, and the current activity."""

    share: float
    doing: str


@dataclass(frozen=True, slots=True)
class StudyError:
    """Message of the process: a GainlineError, to be shown to a person."""

    message: str
    hint: str
    problems: tuple[Problem, ...]


@dataclass(frozen=True, slots=True)
class InternalFailure:
    """Message of the process: an internal error, with its traceback."""

    what: str
    traceback: str


StudyMessage = Progress | Result | StudyError | InternalFailure


class ProcessDiedError(Exception):
    """The process ended without a result; `args` hold its exit code."""


class StudyProcess:
    """Runs one reproduction between enter and exit; on exit the process is killed, whatever its state."""

    def __init__(self, name: str, *, full: bool) -> None:
        context = process_context()
        self._pipe, self._theirs = context.Pipe()
        self._process = context.Process(
            target=_work, args=(self._theirs, name, full), name=f"reproduction {name}", daemon=True
        )

    def __enter__(self) -> Self:
        self._process.start()
        self._theirs.close()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pipe.close()
        self._process.kill()
        self._process.join(SHUTDOWN_TIMEOUT_S)

    def listen(self, within_s: float) -> StudyMessage | None:
        """Return the next message, or None if there is none within that time. Raises ProcessDiedError."""
        try:
            if not self._pipe.poll(within_s):
                return None
            received: StudyMessage = self._pipe.recv()
        except (EOFError, OSError) as error:
            self._process.join(SHUTDOWN_TIMEOUT_S)
            raise ProcessDiedError(self._process.exitcode) from error
        return received


def _work(pipe: Connection, name: str, full: bool) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    threading.Thread(target=_end_with, args=(pipe,), daemon=True).start()
    pipe.send(_outcome(lambda share, doing: pipe.send(Progress(share, doing)), name, full))


def _outcome(tell: Callable[[float, str], None], name: str, full: bool) -> Result | StudyError | InternalFailure:
    try:
        return get_reproduction(name).run(tell, full)
    except GainlineError as error:
        return StudyError(error.message, error.hint, error.problems)
    except Exception as error:  # noqa: BLE001 - the edge of the process
        return InternalFailure(f"{type(error).__name__}: {error}", format_exc())


def _end_with(pipe: Connection) -> None:
    """Exit when the parent ends: it never sends anything, so the pipe becomes readable only when it closes."""
    pipe.poll(None)
    os._exit(0)
