"""Reads untrusted files in a process of its own with memory and time limits, so that the worst result is an error."""

import os
import resource
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final, ParamSpec, TypeVar

from app.common.errors import InputError, Problem, UnavailableError
from app.processes import ChildProcess, ProcessDiedError, TaskError, perform, result_of

P = ParamSpec("P")
T = TypeVar("T")

MAX_CONCURRENT: Final = 2
WAITS_S: Final = 20.0
"""Maximum waiting time for one of the running processes to end."""


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
        return _run(limits, partial(function, *args, **kwargs))
    finally:
        _places.release()


def _run(limits: Limits, task: Callable[[], T]) -> T:
    with ChildProcess(_perform, limits, task, name="reading") as child:
        if not child.pipe.poll(limits.wall_s):
            raise _too_much(limits)
        try:
            outcome: T | TaskError = child.receive()
        except ProcessDiedError as error:  # the processor time was used up, or the system ran out of memory
            raise _too_much(limits) from error
    try:
        return result_of(outcome)
    except MemoryError as error:
        raise _too_much(limits) from error


def _perform(pipe: Connection, limits: Limits, task: Callable[[], object]) -> None:
    """Main function of the new process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CPU, (limits.processor_s, limits.processor_s + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with suppress(OSError, ValueError):  # where the system has no such limit, the time limit applies
        most = _address_space() + limits.memory_bytes
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    outcome = perform(task)
    with suppress(OSError):  # the parent no longer waits
        pipe.send(outcome)


def _address_space() -> int:
    """Address space that the program uses already, bytes. Raises OSError where the system does not report it."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def _too_much(limits: Limits) -> InputError:
    return InputError(
        "This file cannot be read; nothing was stored.",
        problems=(
            Problem("file", f"needs more than {limits.processor_s} s or {limits.memory_bytes / 2**30:g} GiB to read"),
        ),
        hint="Check that it is the correct log. `gainline import` and `gainline controller check` read files "
        "without these limits of time and memory.",
    )
