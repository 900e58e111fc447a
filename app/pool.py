"""The processes that compute: pure functions go in, results come out, and a process that dies is replaced."""

import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, ProcessPoolExecutor
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Final, ParamSpec, Self, TypeVar

import structlog

from app.core.errors import GainlineError

P = ParamSpec("P")
T = TypeVar("T")

ATTEMPTS: Final = 2

_log = structlog.get_logger(__name__)


class CrashedError(GainlineError):
    """The computing process died each time it was tried."""


class Pool:
    """A `concurrent.futures` pool of spawned processes between enter and exit. Thread-safe.

    Its processes hold one end of a lifeline: they end at once, in the middle of a task, when this process closes the
    other end or dies. Tasks are pure, so nothing is lost by that.
    """

    def __init__(self, processes: int, *, prepare: Callable[[], object]) -> None:
        """`prepare()` runs in every new process before its first task, to load and compile what tasks need."""
        self._processes = processes
        self._prepare = prepare
        self._lock = threading.Lock()
        self._closed = False
        self._held, self._lifeline = get_context("spawn").Pipe(duplex=False)

    def __enter__(self) -> Self:
        self._executor = self._start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._closed = True
            self._lifeline.close()
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._held.close()

    def run(self, function: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Call a pure, picklable function in the pool and wait.

        Raises CrashedError when its process dies twice, CancelledError when the pool is closed meanwhile.
        """
        for _ in range(ATTEMPTS):
            with self._lock:
                if self._closed:
                    raise CancelledError
                executor = self._executor
            try:
                return executor.submit(function, *args, **kwargs).result()
            except BrokenExecutor:
                self._replace(executor, function.__qualname__)
        raise CrashedError(
            f"The process that computed {function.__qualname__} died {ATTEMPTS} times.",
            hint="It may have run out of memory. Free some and retry the job; the log says more.",
        )

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            self._processes,
            mp_context=get_context("spawn"),
            initializer=_settle_in,
            initargs=(self._held, self._prepare),
        )

    def _replace(self, broken: ProcessPoolExecutor, task: str) -> None:
        with self._lock:
            if self._closed:
                raise CancelledError
            if self._executor is broken:
                _log.warning("computing process died", task=task)
                broken.shutdown(wait=False, cancel_futures=True)
                self._executor = self._start()


def _settle_in(lifeline: Connection, prepare: Callable[[], object]) -> None:
    """In the new process: leave Ctrl-C to the parent, hold on to the lifeline, and get ready."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    prepare()


def _end_with(lifeline: Connection) -> None:
    lifeline.poll(None)
    os._exit(0)
