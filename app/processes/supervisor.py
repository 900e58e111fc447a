"""Keeps one child process running: restarts it with back-off when it dies, and stops it with a long timeout."""

import os
import signal
import threading
import time
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from typing import Final, Generic, Self, TypeVar

import structlog

FIRST_PAUSE_S: Final = 0.2
LONGEST_PAUSE_S: Final = 10.0
HEALTHY_AFTER_S: Final = 20.0
"""A child that lived this long is restarted after the shortest pause."""
STOP_TIMEOUT_S: Final = 70.0
"""How long a stopping child may take to land its vehicles and record the flights: landing alone may take 40 s, and Land
is repeated for 60 s to a vehicle that may be in the air."""
STACK_DUMP_TIMEOUT_S: Final = 0.5

_log = structlog.get_logger(__name__)
T = TypeVar("T")


class Supervisor(Generic[T]):
    """Runs `target(argument)` in a spawned process between enter and exit."""

    def __init__(self, target: Callable[[T], None], argument: T, *, name: str) -> None:
        self._target = target
        self._argument = argument
        self._name = name
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._watch, name=f"{name} supervisor", daemon=True)

    def __enter__(self) -> Self:
        self._process = self._start()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        process = self._process
        if process.is_alive():
            process.terminate()
        try:
            process.join(STOP_TIMEOUT_S)
        finally:
            if process.is_alive():
                _log.error("child did not stop; killing it", child=self._name, pid=process.pid)
                _dump_stacks(process)
                process.kill()
                process.join()

    def _start(self) -> BaseProcess:
        process = get_context("spawn").Process(target=self._target, args=(self._argument,), name=self._name)
        process.start()
        _log.info("child started", child=self._name, pid=process.pid)
        return process

    def _watch(self) -> None:
        pause_s = FIRST_PAUSE_S
        started_s = time.monotonic()
        while not self._stopping.is_set():
            process = self._process
            process.join(0.1)
            if process.is_alive() or self._stopping.is_set():
                continue
            lived_s = time.monotonic() - started_s
            pause_s = FIRST_PAUSE_S if lived_s > HEALTHY_AFTER_S else min(2 * pause_s, LONGEST_PAUSE_S)
            _log.error(
                "child died; restarting it",
                child=self._name,
                pid=process.pid,
                code=process.exitcode,
                lived_s=round(lived_s, 1),
                pause_s=pause_s,
            )
            if not self._stopping.wait(pause_s):
                self._process = self._start()
                started_s = time.monotonic()


def _dump_stacks(process: BaseProcess) -> None:
    """Have the process write its threads' stacks to standard error (`app.common.logging`)."""
    if process.pid is not None:
        os.kill(process.pid, signal.SIGUSR1)
        time.sleep(STACK_DUMP_TIMEOUT_S)
