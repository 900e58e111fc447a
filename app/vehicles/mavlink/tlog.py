"""Telemetry logs in the format of ground stations: all frames of both directions with their times.

A record is the time in µs since 1970, big-endian in 8 bytes with the two lowest bits zero, and the frame.
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
    """Appends frames to a file in its own thread, so that callers never wait for the disk."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises LinkError if it cannot be opened."""
        self._path = path
        try:
            self._file = path.open("ab", buffering=0)
        except OSError as error:
            raise LinkError(
                f"The telemetry log {path} cannot be written: {error.strerror or error}.",
                hint="Check that the folder exists and is writable.",
            ) from error
        self._frames: queue.SimpleQueue[tuple[int, bytes] | None] = queue.SimpleQueue()
        self._closing = threading.Event()
        self.problem: str | None = None
        """Reason why the file is incomplete, None if it is complete."""
        self._thread = threading.Thread(target=self._run, name=f"tlog {path.name}", daemon=True)
        self._thread.start()

    def write(self, time_us: int, frame: bytes) -> None:
        """Queue `frame`, which is stored within a fraction of a second; `time_us` is since 1970."""
        self._frames.put((time_us, frame))

    def close(self) -> None:
        """Return once all frames are stored, or after 5 s, in which case `problem` is set."""
        self._closing.set()
        self._frames.put(None)
        self._thread.join(STORED_WITHIN_S)
        if self._thread.is_alive():
            self.problem = f"{self._path} was not stored within {STORED_WITHIN_S:g} s"

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
        """Write `data`; return the unwritten rest, to be written before the next frames."""
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError as error:
            self.problem = f"{self._path} is not complete: {error.strerror or error}"
        else:
            self.problem = None
        return data


def record(time_us: int, frame: bytes) -> bytes:
    """Return one frame's record in the file."""
    return struct.pack(">Q", time_us & ~3) + frame
