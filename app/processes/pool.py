"""Pool of computing processes for pure functions; a process that dies is replaced. Imports very little, so that such a
process starts quickly.
"""

import os
import queue
import signal
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from traceback import format_exc
from types import TracebackType
from typing import Final, Generic, ParamSpec, Self, TypeVar

import structlog

from app.core.errors import GainlineError
from app.processes import process_context

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class TaskResult(Generic[T]):
    result: T


@dataclass(frozen=True, slots=True)
class TaskError:
    """An exception that the task raised; its note has the traceback."""

    error: Exception


def run_tasks(pipe: Connection, prepare: Callable[[], object], niceness: int) -> None:
    """Perform one task after another in the new process. Leaves Ctrl-C to the parent, and runs with the given
    niceness."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(niceness)
    threading.Thread(target=_shut_down_with_parent, daemon=True).start()
    prepare()
    with suppress(EOFError, OSError):  # the parent has closed the pipe or died
        while True:
            pipe.send(_outcome(pipe.recv()))


def _outcome(task: Callable[[], T]) -> TaskResult[T] | TaskError:
    try:
        return TaskResult(task())
    except Exception as error:  # noqa: BLE001 - outermost frame of the process
        error.add_note(format_exc())
        return TaskError(error)


def _shut_down_with_parent() -> None:
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(0)


P = ParamSpec("P")

ATTEMPTS: Final = 2

_log = structlog.get_logger(__name__)


class CrashedError(GainlineError):
    """The computing process died in every attempt."""


class ComputePool:
    """Processes between enter and exit, each started at its first use. Thread-safe.

    They end at once, even in the middle of a task, when the pool is closed or this process dies; nothing is lost,
    because tasks are pure. Each has its own pipe, so that the death of one in the middle of a result is noticed by the
    end of its pipe; `concurrent.futures.ProcessPoolExecutor` would wait for ever (docs/decisions/0014).
    """

    def __init__(self, processes: int, *, prepare: Callable[[], object], niceness: int = 0) -> None:
        """Create the pool; no process is started yet.

        `prepare()` runs in every new process before its first task, to import and compile what tasks need. `niceness`,
        0 to 19, lowers the processes' priority.
        """
        self._computers = [_ComputeProcess(prepare, niceness) for _ in range(processes)]
        self._free: queue.LifoQueue[_ComputeProcess] = queue.LifoQueue()
        for computer in self._computers:
            self._free.put(computer)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for computer in self._computers:
            computer.close()

    def run(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a pure, picklable function in the pool and wait for the result.

        Raises what it raises, CrashedError when its process dies twice, CancelledError when the pool is closed
        meanwhile.
        """
        task = partial(function, *args, **kwargs)
        for _ in range(ATTEMPTS):
            computer = self._free.get()
            try:
                return computer.perform(task)
            except _ProcessDiedError:
                _log.warning("computing process died", task=function.__qualname__)
            finally:
                self._free.put(computer)
        raise CrashedError(
            f"The process that computed {function.__qualname__} died {ATTEMPTS} times.",
            hint="It may have run out of memory. Free some memory and retry the job; see the log.",
        )


class _ProcessDiedError(Exception):
    """The process died without a result."""


class _ComputeProcess:
    """A process, started when it is needed, and the pipe to it. Performs tasks for one thread at a time; any thread may
    close it."""

    def __init__(self, prepare: Callable[[], object], niceness: int) -> None:
        self._prepare = prepare
        self._niceness = niceness
        self._lock = threading.Lock()
        self._closed = False
        self._running: tuple[BaseProcess, Connection] | None = None

    def perform(self, task: Callable[[], T]) -> T:
        """Perform a task. Raises what the task raises, _ProcessDiedError, and CancelledError once it is closed."""
        pipe = self._pipe()
        try:
            pipe.send(task)
            outcome: TaskResult[T] | TaskError = pipe.recv()
        except (EOFError, OSError) as error:
            self._discard()
            raise _ProcessDiedError from error
        if isinstance(outcome, TaskError):
            raise outcome.error
        return outcome.result

    def close(self) -> None:
        with self._lock:
            self._closed = True
            self._kill()

    def _pipe(self) -> Connection:
        with self._lock:
            if self._closed:
                raise CancelledError
            if self._running is None:
                self._running = self._start()
            return self._running[1]

    def _start(self) -> tuple[BaseProcess, Connection]:
        context = process_context()
        ours, theirs = context.Pipe()
        process = context.Process(
            target=run_tasks, args=(theirs, self._prepare, self._niceness), name="computing", daemon=True
        )
        process.start()
        theirs.close()
        return process, ours

    def _discard(self) -> None:
        with self._lock:
            if self._closed:
                raise CancelledError
            self._kill()
            self._running = None

    def _kill(self) -> None:
        if self._running is not None:
            process, _ = self._running
            process.kill()
            process.join()
