"""What runs in a process of the pool. It imports next to nothing, so that such a process is soon there."""

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
    """By the task; the error's note says where."""

    error: Exception


def run_tasks(pipe: Connection, prepare: Callable[[], object], niceness: int) -> None:
    """In the new process: leave Ctrl-C to the parent, give way, get ready, and perform one task after the other."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(niceness)
    threading.Thread(target=_shut_down_with_parent, daemon=True).start()
    prepare()
    with suppress(EOFError, OSError):  # the parent is gone
        while True:
            pipe.send(_outcome(pipe.recv()))


def _outcome(task: Callable[[], T]) -> TaskResult[T] | TaskError:
    try:
        return TaskResult(task())
    except Exception as error:  # noqa: BLE001 - the edge of the process
        error.add_note(format_exc())
        return TaskError(error)


def _shut_down_with_parent() -> None:
    if (parent := parent_process()) is not None:
        parent.join()
        os._exit(0)
