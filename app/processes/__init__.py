"""The program's processes: the start of those that fly and compute, which are forked from a server that has imported
the numerics once; and exclusive locks, which the operating system releases when their process ends, however it ends.

A new interpreter needs seconds of processor time to import them, a fork a few milliseconds. The server has one thread
and only forks, so that a fork never copies a held lock. Where forking a process that has loaded system libraries is not
safe (macOS), each process is a new interpreter.
"""

import fcntl
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import cache, partial
from multiprocessing import get_context, parent_process
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.forkserver import ensure_running
from pathlib import Path
from traceback import format_exc
from typing import Any, Final, Self, TypeVar

from app.common.errors import StorageError
from app.core.clock import REAL_TIME, Clock

DEATH_TIMEOUT_S: Final = 5.0
"""How long a process whose end of the pipe is closed may take to end."""
LOCK_POLL_S: Final = 0.1

T = TypeVar("T")


@cache
def process_context() -> ForkServerContext | SpawnContext:
    """The multiprocessing context that starts these processes."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(["__main__", "app.runtime.preload"])
    return context


def start_loading() -> None:
    """Start the fork server, so that it imports while this process continues."""
    if process_context().get_start_method() == "forkserver":
        ensure_running()


class ProcessDiedError(Exception):
    """A child process ended without an answer."""

    def __init__(self, exit_code: int | None) -> None:
        super().__init__(f"exit code {exit_code}")
        self.exit_code = exit_code


class ChildProcess:
    """A process of its own that calls `target(pipe, *args)`, and this end of the pipe to it, which raises OSError on
    sending when the process is dead.

    As a context manager, it is killed at the end, whatever its state.
    """

    def __init__(self, target: Callable[..., None], *args: object, name: str) -> None:
        context = process_context()
        self.pipe, theirs = context.Pipe()
        self._process = context.Process(target=target, args=(theirs, *args), name=name, daemon=True)
        self._process.start()
        theirs.close()

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    @property
    def exit_code(self) -> int | None:
        """The exit code; None while the process runs, and the negative number of the signal that ended it."""
        return self._process.exitcode

    def receive(self) -> Any:
        """Wait for the next message. Raises ProcessDiedError."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError) as error:
            self.join()
            raise ProcessDiedError(self.exit_code) from error

    def join(self) -> None:
        """Wait until the process ends, for at most DEATH_TIMEOUT_S."""
        self._process.join(DEATH_TIMEOUT_S)

    def kill(self) -> None:
        """Kill the process. The pipe stays open, because another thread may be reading it."""
        self._process.kill()
        self._process.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()
        self.pipe.close()


@dataclass(frozen=True, slots=True)
class TaskError:
    """What a child process sends in place of a result: the exception that the task raised, with the traceback as its
    note."""

    error: Exception


def perform(task: Callable[[], T]) -> T | TaskError:
    """Call a task in the child process, and return what to send to the parent."""
    try:
        return task()
    except Exception as error:  # noqa: BLE001 - outermost frame of the process
        error.add_note(format_exc())
        return TaskError(error)


def result_of(outcome: T | TaskError) -> T:
    """The result that a child process has sent. Raises what the task raised."""
    if isinstance(outcome, TaskError):
        raise outcome.error
    return outcome


def follow_parent(niceness: int) -> None:
    """Set up a child process that computes: it runs with this niceness, leaves Ctrl-C to its parent, and ends at once
    when the parent ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(niceness)
    when_parent_ends(partial(os._exit, 0))


def when_parent_ends(act: Callable[[], None]) -> None:
    """Call `act` in this process, on a thread of its own, when the parent process has ended."""

    def wait() -> None:
        if (parent := parent_process()) is not None:
            parent.join()
            act()

    threading.Thread(target=wait, daemon=True).start()


def ignore_stop_signals() -> None:
    """Set up a child process that holds a vehicle: it ends when its pipe is closed, never in the middle of a flight."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Holder:
    """Holder of a lock: process id, and its web address, empty if it has none."""

    pid: int
    address: str = ""

    def __str__(self) -> str:
        return f"process {self.pid}" + (f" at {self.address}" if self.address else "")


class LockedError(Exception):
    """The lock is held; `holder` is None when it is unknown."""

    def __init__(self, holder: Holder | None) -> None:
        super().__init__(f"held by {holder or 'another process'}")
        self.holder = holder


@contextmanager
def exclusive(
    path: Path, *, keep_waiting: Callable[[], bool] = lambda: False, clock: Clock = REAL_TIME
) -> Iterator[Callable[[str], None]]:
    """Hold the lock file at `path`. Yields a function that writes the holder's address into it.

    Raises LockedError when another process holds it and `keep_waiting()` is false, StorageError when the file cannot be
    opened.
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise StorageError(
            f"The lock file {path} cannot be opened: {error.strerror}.",
            hint="Give this user read and write permission for it, or choose another folder with --data-dir.",
        ) from error
    try:
        while not _take(descriptor):
            if not keep_waiting():
                raise LockedError(_holder(descriptor))
            clock.wait_s(LOCK_POLL_S)
        _sign(descriptor, "")
        yield partial(_sign, descriptor)
    finally:
        os.close(descriptor)


def signature(path: Path) -> Holder | None:
    """The present or last holder of the lock file at `path`; None if it is unknown."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        return _holder(descriptor)
    finally:
        os.close(descriptor)


def _take(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _sign(descriptor: int, address: str) -> None:
    with suppress(OSError):  # a full disk costs only the signature, not the lock
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, json.dumps(asdict(Holder(pid=os.getpid(), address=address))).encode(), 0)


def _holder(descriptor: int) -> Holder | None:
    try:
        return Holder(**json.loads(os.pread(descriptor, 4096, 0)))
    except (ValueError, TypeError):
        return None
