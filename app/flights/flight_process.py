"""Flight process: opens one vehicle at a time and flies it for the worker, which keeps the database.

A flight has a process of its own because JSBSim holds the interpreter lock while it computes, cannot run in two threads
at once, and must not take the worker down when it crashes. The process never touches the database. When the worker
dies, the pipe between them breaks; the flight is then aborted and the vehicle left with its safe gains.
"""

import math
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from app.common.data_folder import vehicle_lock
from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.core.experiments import get_experiment
from app.flights.process_messages import (
    CancelFlight,
    CancelTakeOff,
    FlightFinished,
    FlightLanded,
    FlightMessage,
    FlightMonitor,
    FlightRequest,
    GainsStaged,
    TakeOffCommand,
    failure_from,
    hold_vehicle_lock,
    internal_error,
    mark_if_requested,
    process_died_error,
)
from app.processes import process_context
from app.vehicles.base import FlightRecord, ShouldStop, StopRequest, Vehicle
from app.vehicles.jsbsim import prepare
from app.vehicles.registry import open_vehicle

LOCK_TIMEOUT_S: Final = 10.0
"""How long a flight waits for another process that still holds the vehicle, such as one that is landing it after its
worker was killed."""
SHUTDOWN_TIMEOUT_S: Final = 5.0


class FlightProcess:
    """The worker's handle of one flight process. `cancel_flight` may be called from any thread and from signal
    handlers."""

    def __init__(self, data_dir: Path, clock: Clock = REAL_TIME) -> None:
        context = process_context()
        self._pipe, theirs = context.Pipe()
        self._sending = threading.Lock()
        self._process = context.Process(target=_work, args=(theirs, data_dir, clock), name="flight", daemon=True)
        self._process.start()
        theirs.close()

    def fly(self, request: FlightRequest) -> Iterator[FlightMessage]:
        """Send the request and yield the process's messages until it is free again.

        The caller answers GainsStaged by `take_off` or `cancel_take_off`. Raises VehicleError when the process dies.
        """
        try:
            self._send(request)
            while not isinstance(message := self._pipe.recv(), FlightFinished):
                yield message
        except (EOFError, OSError) as error:
            self._process.join(SHUTDOWN_TIMEOUT_S)
            raise process_died_error(self._process.exitcode) from error

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def take_off(self) -> None:
        self._tell(TakeOffCommand(by_s=math.inf))  # a late start of a simulation is harmless

    def cancel_take_off(self) -> None:
        self._tell(CancelTakeOff())

    def cancel_flight(self, trial_id: int, reason: str) -> None:
        self._tell(CancelFlight(trial_id, reason))

    def close(self) -> None:
        """Let the process end; kill it if it does not."""
        self._pipe.close()
        self._process.join(SHUTDOWN_TIMEOUT_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _tell(self, message: TakeOffCommand | CancelTakeOff | CancelFlight) -> None:
        with suppress(OSError):  # the process is dead: the caller of `fly` gets the error
            self._send(message)

    def _send(self, message: FlightRequest | TakeOffCommand | CancelTakeOff | CancelFlight) -> None:
        with self._sending:
            self._pipe.send(message)


class FlightProcessPool:
    """Pool of idle flight processes with everything imported. Thread-safe."""

    def __init__(self, data_dir: Path, clock: Clock = REAL_TIME, *, spare: int = 1) -> None:
        self._start = partial(FlightProcess, data_dir, clock)
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


def _work(pipe: Connection, data_dir: Path, clock: Clock) -> None:
    """Main loop of the process: one flight after another, until the worker closes the pipe or dies.

    Imports what the most common vehicle needs while it waits for the first request.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        if not pipe.poll():
            with suppress(GainlineError, ImportError):  # reported by the flight that needs it
                prepare()
        while True:
            if isinstance(request := pipe.recv(), FlightRequest):
                _fly(pipe, request, data_dir, clock)
                pipe.send(FlightFinished())
    except (EOFError, OSError):
        os._exit(0)


def _fly(pipe: Connection, request: FlightRequest, data_dir: Path, clock: Clock) -> None:
    try:
        with (
            hold_vehicle_lock(vehicle_lock(data_dir, request.vehicle_kind), within_s=LOCK_TIMEOUT_S, clock=clock),
            open_vehicle(request.vehicle_kind, request.vehicle_options, safe_gains=request.safe_gains) as vehicle,
        ):
            pipe.send(GainsStaged(vehicle.stage(request.gains)))
            standing_down: str | None = None
            while not isinstance(answer := pipe.recv(), TakeOffCommand | CancelTakeOff):
                if isinstance(answer, CancelFlight) and answer.trial_id == request.trial_id:
                    standing_down = answer.reason
            if isinstance(answer, TakeOffCommand):
                pipe.send(FlightLanded(_take_off(pipe, request, vehicle, standing_down, clock)))
    except GainlineError as error:
        pipe.send(failure_from(error))
    except (EOFError, OSError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever a vehicle raises, the trial must get a definite end
        pipe.send(internal_error(error))


def _take_off(
    pipe: Connection, request: FlightRequest, vehicle: Vehicle, standing_down: str | None, clock: Clock
) -> FlightRecord:
    experiment = get_experiment(request.experiment)
    monitor = FlightMonitor(request.campaign_id, request.trial_id, experiment, pipe.send, clock)
    monitor.phase("flying")
    asked: set[str] = set()
    listener = _listener(pipe, request.trial_id, standing_down, asked)
    record = vehicle.fly(request.options(clock), on_sample=monitor.sample, should_stop=listener)
    monitor.flush()
    monitor.phase("landed")
    return mark_if_requested(record, asked)


def _listener(pipe: Connection, trial_id: int, standing_down: str | None, asked: set[str]) -> ShouldStop:
    """Return a stop callback that polls the pipe, which takes microseconds, and adds the reason to stop to `asked`.

    With `standing_down` it stops the flight at once.
    """

    def should_stop() -> StopRequest | None:
        stop = received_stop()
        if stop is not None:
            asked.add(stop.reason)
        return stop

    def received_stop() -> StopRequest | None:
        if standing_down is not None:
            return StopRequest(standing_down)
        try:
            while pipe.poll():
                message = pipe.recv()
                if isinstance(message, CancelFlight) and message.trial_id == trial_id:
                    return StopRequest(message.reason)
        except (EOFError, OSError):
            return StopRequest("the worker has exited")
        return None

    return should_stop
