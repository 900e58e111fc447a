"""Main function of the pool's processes. Imports very little, so that such a process starts quickly."""

import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import parent_process
from multiprocessing.connection import Connection
from traceback import format_exc
from typing import Generic, TypeVar

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
