"""Calls of functions in processes of their own: a pool for pure functions, which replaces processes that die; and a new
process with limits of time and memory for each untrusted file, so that the worst result is an error. Imports very
little, so that such a process starts quickly.
"""

import os
import queue
import resource
import signal
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final, ParamSpec, Self, TypeVar

import structlog

from app.common.errors import GainlineError, InputError, Problem, UnavailableError
from app.processes import ChildProcess, ProcessDiedError, TaskError, follow_parent, perform, result_of

P = ParamSpec("P")
T = TypeVar("T")

ATTEMPTS: Final = 2
"""Tries of the pool, because its tasks are pure."""
MAX_CONCURRENT: Final = 2
WAITS_S: Final = 20.0
"""Maximum waiting time for one of the running processes to end."""

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
                child.pipe.send(task)
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


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one process: processor time, s; time until its result, s; memory besides that of the program, bytes."""

    processor_s: int = 60
    wall_s: float = 120.0
    memory_bytes: int = 2**30


FILE: Final = Limits()
"""Limits for a file of the size accepted over HTTP."""

_places = threading.BoundedSemaphore(MAX_CONCURRENT)


def run_limited(limits: Limits, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
    """Call a pure, picklable function in a new process, which imports its module, and wait for the result.

    Raises what it raises, InputError that names the file when it exceeds a limit, and UnavailableError when
    MAX_CONCURRENT others are running for too long.
    """
    if not _places.acquire(timeout=WAITS_S):
        raise UnavailableError(
            f"{MAX_CONCURRENT} files are already being read.",
            hint="Send this file again in a few seconds; nothing was stored.",
        )
    try:
        with ChildProcess(_perform, limits, partial(function, *args, **kwargs), name="reading") as child:
            if not child.pipe.poll(limits.wall_s):
                raise _too_much(limits)
            outcome: T | TaskError = child.receive()
        return result_of(outcome)
    except (ProcessDiedError, MemoryError) as error:  # its processor time was used up, or there was no more memory
        raise _too_much(limits) from error
    finally:
        _places.release()


def _perform(pipe: Connection, limits: Limits, task: Callable[[], object]) -> None:
    """Main function of the new process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CPU, (limits.processor_s, limits.processor_s + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with suppress(OSError, ValueError):  # where the system has no such limit, the time limit applies
        used_pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = used_pages * os.sysconf("SC_PAGE_SIZE") + limits.memory_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    outcome = perform(task)
    with suppress(OSError):  # the parent no longer waits
        pipe.send(outcome)


def _too_much(limits: Limits) -> InputError:
    return InputError(
        "This file cannot be read; nothing was stored.",
        problems=(
            Problem("file", f"needs more than {limits.processor_s} s or {limits.memory_bytes / 2**30:g} GiB to read"),
        ),
        hint="Check that it is the correct log. `gainline import` and `gainline analyze` read files without these "
        "limits of time and memory.",
    )
