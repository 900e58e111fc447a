"""The worker's handle of a process that holds a vehicle and flies it, and a pool of them for simulations.

The process itself is in `flight_loop`. The worker keeps the database.
"""

import math
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from app.core.clock import REAL_TIME, Clock
from app.flights.flight_loop import run_simulations
from app.flights.process_messages import (
    CancelFlight,
    CancelTakeOff,
    FlightFinished,
    FlightMessage,
    FlightRequest,
    FromVehicleProcess,
    TakeOffCommand,
    ToVehicleProcess,
)
from app.processes import ChildProcess, ProcessDiedError
from app.vehicles.base import VehicleError
from app.vehicles.flight_end import StopRequest


class FlightProcess:
    """The worker's handle of one such process. Everything but `fly` may be called from any thread."""

    _take_off_timeout_s = math.inf
    """A late start of a simulation is harmless."""

    def __init__(self, run: Callable[..., None], *args: object, name: str) -> None:
        """Start the process, which calls `run(pipe, *args)`."""
        self._child = ChildProcess(run, *args, name=name)
        self._sending = threading.Lock()
        self.trial_id: int | None = None
        """Trial of the running flight."""
        self.staging_lost = ""
        """Why its vehicle no longer holds the staged gains; empty while it does."""

    @property
    def alive(self) -> bool:
        return self._child.alive

    @property
    def pid(self) -> int | None:
        return self._child.pid

    def fly(self, request: FlightRequest) -> Iterator[FlightMessage]:
        """Send the request and yield the process's messages until it is free again.

        The caller answers GainsStaged by `take_off` or `cancel_take_off`. Raises VehicleError when the process dies.
        """
        self.trial_id, self.staging_lost = request.trial_id, ""
        try:
            self._post(request)
            while not isinstance(message := self._next(), FlightFinished):
                assert isinstance(message, FlightMessage), message
                yield message
        finally:
            self.trial_id = None

    def take_off(self) -> None:
        self._post(TakeOffCommand(by_s=time.monotonic() + self._take_off_timeout_s))

    def cancel_take_off(self) -> None:
        self._post(CancelTakeOff())

    def cancel_flight(self, trial_id: int, request: StopRequest) -> None:
        """End that flight now; a vehicle that has not taken off stays on the ground."""
        self._post(CancelFlight(trial_id, request))

    def close(self) -> None:
        """Let the process end; kill it if it does not."""
        self._child.pipe.close()
        self._child.join()
        self._child.kill()

    def _next(self) -> FromVehicleProcess:
        """Wait for the process's next message. Raises VehicleError when the process is dead."""
        try:
            message: FromVehicleProcess = self._child.receive()
        except ProcessDiedError as death:
            raise process_died_error(death.exit_code) from death
        return message

    def _post(self, message: ToVehicleProcess) -> bool:
        try:
            with self._sending:
                self._child.send(message)
        except OSError:  # the process is dead: `_next` says so
            return False
        return True


class FlightProcessPool:
    """Pool of idle processes for simulations, with everything imported. Thread-safe."""

    def __init__(self, data_dir: Path, clock: Clock = REAL_TIME, *, spare: int = 1) -> None:
        self._start = partial(FlightProcess, run_simulations, data_dir, clock, name="flight")
        self._spare = spare
        self._lock = threading.Lock()
        self._waiting = [self._start() for _ in range(spare)]

    def acquire(self) -> FlightProcess:
        with self._lock:
            return self._waiting.pop() if self._waiting else self._start()

    def release(self, process: FlightProcess) -> None:
        """Return a free process to the pool; it is closed when the pool is full."""
        with self._lock:
            if len(self._waiting) < self._spare:
                self._waiting.append(process)
                return
        process.close()

    def close(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for process in waiting:
            process.close()


def process_died_error(exit_code: int | None) -> VehicleError:
    return VehicleError(
        f"The flight process died (exit code {exit_code}).",
        hint="Inspect the vehicle and the worker's log, then fly again.",
    )
