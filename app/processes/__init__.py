"""Start of the processes that fly and compute: each is forked from a server that has imported the numerics once.

A new interpreter needs seconds of processor time to import them, a fork a few milliseconds. The server has one thread
and only forks, so that a fork never copies a held lock. Where forking a process that has loaded system libraries is not
safe (macOS), each process is a new interpreter.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from multiprocessing import get_context, parent_process
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.forkserver import ensure_running
from traceback import format_exc
from typing import Any, Final, Self, TypeVar

DEATH_TIMEOUT_S: Final = 5.0
"""How long a process whose end of the pipe is closed may take to end."""

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
