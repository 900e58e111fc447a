"""The vehicle process's end of the pipe to the worker."""

import select
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection

from app.flights.process_messages import FromVehicleProcess, ToVehicleProcess, VehicleCommand


class PipeClosedError(Exception):
    """The pipe is broken: the worker has closed it or died."""


class WorkerPipe:
    """The process's end of the pipe. Once it is broken, `receive` raises; `send` and `send_if_ready` drop the
    message."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._received: deque[ToVehicleProcess] = deque()

    def receive(self) -> ToVehicleProcess | None:
        """Return the next message; None when there is none. Raises PipeClosedError."""
        return self._received.popleft() if self._received else self._read()

    def receive_command(self) -> VehicleCommand | None:
        """Return the next command ahead of other messages; None when there is none, or the pipe is broken."""
        with suppress(PipeClosedError):
            while (message := self._read()) is not None:
                self._received.append(message)
        found = next((each for each in self._received if isinstance(each, VehicleCommand)), None)
        if found is not None:
            self._received.remove(found)
        return found

    def _read(self) -> ToVehicleProcess | None:
        try:
            return self._pipe.recv() if self._pipe.poll() else None
        except (EOFError, OSError) as error:
            raise PipeClosedError from error

    def is_open(self) -> bool:
        """Return True while the pipe is open; discards a waiting message. Raises PipeClosedError instead of returning
        False."""
        self.receive()
        return True

    def send(self, message: FromVehicleProcess) -> None:
        with suppress(OSError):
            self._pipe.send(message)

    def send_if_ready(self, message: FromVehicleProcess) -> None:
        """Send the message unless that would block."""
        with suppress(OSError, ValueError):
            if select.select([], [self._pipe], [], 0.0)[1]:
                self._pipe.send(message)
