"""Telemetry logs: every frame of both directions with its time, as ground stations write and read them.

A record is the time in µs since 1970 as 8 bytes, most significant first, whose two lowest bits are zero, and the frame.
"""

import queue
import struct
import threading
from pathlib import Path
from typing import Final

from app.vehicles.mavlink.transports import LinkError

FLUSH_EVERY_S: Final = 0.1
STORED_WITHIN_S: Final = 5.0


class TlogWriter:
    """Appends frames to a file in a thread of its own: whoever hands one over never waits for the disk."""

    def __init__(self, path: Path) -> None:
        """Raises LinkError when the file cannot be opened."""
        self._path = path
        try:
            self._file = path.open("ab", buffering=0)
        except OSError as error:
            raise LinkError(
                f"The telemetry log {path} cannot be written: {error.strerror or error}.",
                hint="See that the folder exists and may be written to.",
            ) from error
        self._frames: queue.SimpleQueue[tuple[int, bytes] | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._problem: str | None = None
        self._thread = threading.Thread(target=self._run, name=f"tlog {path.name}", daemon=True)
        self._thread.start()

    @property
    def problem(self) -> str | None:
        """Why the file is not complete, None while it is."""
        return self._problem

    def write(self, time_us: int, frame: bytes) -> None:
        """Have `frame` stored within a fraction of a second; `time_us` since 1970."""
        self._frames.put((time_us, frame))

    def close(self) -> None:
        """Return once everything is stored, or after 5 s; `problem` tells the difference."""
        self._closing.set()
        self._frames.put(None)
        self._thread.join(STORED_WITHIN_S)
        if self._thread.is_alive():
            self._problem = f"{self._path} was not stored within {STORED_WITHIN_S:g} s"

    def _run(self) -> None:
        more, unstored = True, b""
        with self._file:
            while more:
                waiting = [self._frames.get()]
                self._closing.wait(FLUSH_EVERY_S)
                while not self._frames.empty():
                    waiting.append(self._frames.get())
                more = waiting[-1] is not None
                frames = sorted(each for each in waiting if each is not None)  # of several threads
                unstored = self._store(unstored + b"".join(record(*each) for each in frames))

    def _store(self, data: bytes) -> bytes:
        """Write `data`; what the disk did not take, to be tried again before all that follows."""
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self._problem = f"{self._path} is not complete: {error.strerror or error}"
        else:
            self._problem = None
        return data


def record(time_us: int, frame: bytes) -> bytes:
    """One frame as it stands in the file."""
    return struct.pack(">Q", time_us & ~3) + frame
