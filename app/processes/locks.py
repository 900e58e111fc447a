"""Exclusive locks, which the operating system releases when their process ends, however it ends."""

import fcntl
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Final

from app.common.errors import StorageError
from app.core.clock import REAL_TIME, Clock

_SIGNATURE_BYTES: Final = 4096
POLL_S: Final = 0.1


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
                raise LockedError(signature(path))
            clock.wait_s(POLL_S)
        _sign(descriptor, "")
        yield partial(_sign, descriptor)
    finally:
        os.close(descriptor)


def signature(path: Path) -> Holder | None:
    """The present or last holder of the lock file at `path`; None if it is unknown."""
    try:
        with path.open("rb") as file:
            return Holder(**json.loads(file.read(_SIGNATURE_BYTES)))
    except (OSError, ValueError, TypeError):
        return None


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
