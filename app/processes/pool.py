"""Pool of computing processes for pure functions; a process that dies is replaced. Imports very little, so that such a
process starts quickly.
"""

import queue
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from typing import Final, ParamSpec, Self, TypeVar

import structlog

from app.core.errors import GainlineError
from app.processes import ChildProcess, ProcessDiedError, TaskError, follow_parent, perform, result_of

P = ParamSpec("P")
T = TypeVar("T")

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

    def __exit__(self, *_: object) -> None:
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
            except ProcessDiedError:
                _log.warning("computing process died", task=function.__qualname__)
            finally:
                self._free.put(computer)
        raise CrashedError(
            f"The process that computed {function.__qualname__} died {ATTEMPTS} times.",
            hint="It may have run out of memory. Free some memory and retry the job; see the log.",
        )


class _ComputeProcess:
    """A process, started when it is needed. Performs tasks for one thread at a time; any thread may close it."""

    def __init__(self, prepare: Callable[[], object], niceness: int) -> None:
        self._prepare = prepare
        self._niceness = niceness
        self._lock = threading.Lock()
        self._closed = False
        self._running: ChildProcess | None = None

    def perform(self, task: Callable[[], T]) -> T:
        """Perform a task. Raises what the task raises, ProcessDiedError, and CancelledError once it is closed."""
        with self._lock:
            if self._closed:
                raise CancelledError
            if self._running is None:
                self._running = ChildProcess(run_tasks, self._prepare, self._niceness, name="computing")
            child = self._running
        try:
            with suppress(OSError):  # the process is dead: `receive` says so
                child.send(task)
            outcome: T | TaskError = child.receive()
        except ProcessDiedError:
            with self._lock:
                if self._closed:
                    raise CancelledError from None
                child.kill()
                self._running = None
            raise
        return result_of(outcome)

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._running is not None:
                self._running.kill()


def run_tasks(pipe: Connection, prepare: Callable[[], object], niceness: int) -> None:
    """Perform one task after another in the new process."""
    follow_parent(niceness)
    prepare()
    with suppress(EOFError, OSError):  # the parent has closed the pipe or died
        while True:
            pipe.send(perform(pipe.recv()))
