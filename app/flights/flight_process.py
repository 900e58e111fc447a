"""The worker's handles of the processes that hold a vehicle and fly it: of a simulation, with a pool of these, and of
a connection, which keeps the link open between flights.

The processes themselves are in `flight_loop` and `connection_process`, and never touch the database. When the worker
dies, the pipe between them breaks. A flight over a connection is then aborted: the vehicle lands and is left with its
safe gains. A land or motors off command outside a flight is repeated until the vehicle obeys, for at most 60 s, but not
if it was already repeated for 60 s without a packet from the vehicle. Then the process ends; the next worker's
connection waits for that.
"""

import itertools
import math
import os
import queue
import socket
import threading
import time
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from app.common.states import ActKind
from app.core.clock import REAL_TIME, Clock
from app.flights.flight_loop import run_simulations
from app.flights.process_messages import (
    CancelFlight,
    CommandForwarded,
    ConnectionRequest,
    FlightFailure,
    FlightFinished,
    FlightMessage,
    FlightRequest,
    FromVehicleProcess,
    StagingLost,
    TakeOffDecision,
    ToVehicleProcess,
    VehicleCommand,
    VehicleRequest,
    VehicleResponse,
    status_time,
)
from app.live.messages import NO_LINK, SILENT_AFTER_S, VehicleCommandKind, VehicleStatus
from app.processes import ChildProcess, ProcessDiedError
from app.vehicles.base import ConnectionOpened, SafeGainsError, VehicleError
from app.vehicles.flight_end import StopRequest

NOT_ANSWERING: Final = (
    "Gainline's connection to the vehicle is not responding: commands do not reach the vehicle. If it is flying, use "
    "its own remote control now."
)
MAX_UNANSWERED_ORDERS: Final = 50
"""Far fewer than fill the pipe of a process that does not read, so that sending a command never blocks."""
RECONNECT_INTERVAL_S: Final = 2.0
"""How often a vehicle that is wanted connected is looked for."""
TAKE_OFF_TIMEOUT_S: Final = 2.0
"""A takeoff later than this after the operator's request would surprise the operator."""


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

    def fly(self, request: FlightRequest) -> Generator[FlightMessage]:
        """Send the request, and yield the messages until the process is free again.

        The caller answers GainsStaged by `decide`. Raises VehicleError when the process dies.
        """
        self.trial_id, self.staging_lost = request.trial_id, ""
        try:
            self._post(request)
            while not isinstance(message := self._next(), FlightFinished):
                assert isinstance(message, FlightMessage), message
                yield message
        finally:
            self.trial_id = None

    def decide(self, takes_off: bool) -> None:
        self._post(TakeOffDecision(time.monotonic() + self._take_off_timeout_s if takes_off else None))

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
                self._child.pipe.send(message)
        except OSError:  # the process is dead: `_next` says so
            return False
        return True


class FlightProcessPool:
    """Pool of processes for simulations, of which one idle is kept, with everything imported. Thread-safe."""

    def __init__(self, data_dir: Path, clock: Clock = REAL_TIME) -> None:
        self._start = partial(FlightProcess, run_simulations, data_dir, clock, name="flight")
        self._lock = threading.Lock()
        self._waiting = [self._start()]

    def acquire(self) -> FlightProcess:
        with self._lock:
            return self._waiting.pop() if self._waiting else self._start()

    def release(self, process: FlightProcess) -> None:
        """Return a free process to the pool; it is closed when another one is idle."""
        with self._lock:
            if not self._waiting:
                self._waiting.append(process)
                return
        process.close()

    def close(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for process in waiting:
            process.close()


class VehicleConnection(FlightProcess):
    """The worker's handle of such a process: a FlightProcess with a link to the vehicle between flights.

    `hear` is called on a thread of the connection with the vehicle's status and the outcome of commands, that of motors
    off once the vehicle has confirmed it or has not in time; while the process does not answer, every two seconds with
    a status that says so. One flight or act at a time; commands may be sent at any moment, from any thread.
    """

    _take_off_timeout_s = TAKE_OFF_TIMEOUT_S

    def __init__(
        self,
        call: ConnectionRequest,
        run: Callable[[Connection, ConnectionRequest], None],
        *,
        hear: Callable[[VehicleStatus | CommandForwarded], None],
    ) -> None:
        super().__init__(run, call, name=f"session {call.vehicle.name}")
        self.call: Final = call
        self._hear_of = hear
        self._messages: queue.SimpleQueue[FromVehicleProcess | None] = queue.SimpleQueue()
        self._numbers = itertools.count(1)
        self._orders: dict[int, Future[str]] = {}
        """Commands that the process has not answered, by their numbers."""
        self._awaited: dict[int, CommandForwarded] = {}
        """Commands that the vehicle has not confirmed."""
        self._ended = threading.Event()
        self._open = False
        threading.Thread(target=self._listen, name=f"session {call.vehicle.name}", daemon=True).start()

    @property
    def alive(self) -> bool:
        return not self._ended.is_set()

    @property
    def is_running(self) -> bool:
        """Whether the process has not ended, which after a close means that it still commands its vehicle."""
        return self._child.alive

    def wait_until_open(self) -> ConnectionOpened:
        """Wait until the link is open.

        Raises VehicleError when it cannot be opened, SafeGainsError when the vehicle's gains are in doubt; the process
        has then ended.
        """
        match self._next():
            case ConnectionOpened() as opened:
                self._open = True
                return opened
            case FlightFailure(what, unsafe):
                raise (SafeGainsError if unsafe else VehicleError)(what, hint="Then connect it again.")
            case other:
                raise AssertionError(f"The connection started with {other!r}.")

    def ask(self, kind: ActKind, safe_gains: Mapping[str, float]) -> VehicleResponse:
        """Carry out an act and wait for its outcome. Raises VehicleError when the process dies."""
        self._post(VehicleRequest(kind=kind, safe_gains=dict(safe_gains)))
        response = self._next()
        assert isinstance(response, VehicleResponse), response
        return response

    def send_command(self, order: VehicleCommandKind, words: str, by_s: float) -> Future[str]:
        """Send a command; the future holds why it was not forwarded to the vehicle, or "" once it was."""
        answer: Future[str] = Future()
        if len(self._orders) >= MAX_UNANSWERED_ORDERS:
            answer.set_result(NOT_ANSWERING)
            return answer
        number = next(self._numbers)
        self._orders[number] = answer
        command = VehicleCommand(number, order, words, by_s)
        if not (self._open and self.alive and self._post(command)):
            self._answer_order(number, NO_LINK)
        return answer

    def _answer_order(self, number: int, problem: str) -> None:
        if (answer := self._orders.pop(number, None)) is not None:
            answer.set_result(problem)

    def _note_forwarded(self, forwarded: CommandForwarded) -> None:
        number = forwarded.command.number
        self._answer_order(number, forwarded.problem)
        self._awaited[number] = forwarded
        if not forwarded.is_awaited:
            self._hear_of(self._awaited.pop(number))

    def _end_orders(self) -> None:
        for number in tuple(self._orders):
            self._answer_order(
                number,
                "The process that had the vehicle's link ended; it is unknown whether the command was sent. Use the "
                "vehicle's own remote control now.",
            )
        unconfirmed = "The process that had the vehicle's link ended before the vehicle confirmed it."
        for forwarded in self._awaited.values():
            self._hear_of(replace(forwarded, problem=unconfirmed, is_awaited=False))

    def request_close(self) -> None:
        """Let the process end. It is never killed: a vehicle in the air is landed first, however long that takes."""
        with suppress(OSError), socket.socket(fileno=os.dup(self._child.pipe.fileno())) as end:
            end.shutdown(socket.SHUT_RDWR)  # unlike closing the pipe, this wakes the listening thread

    def close(self) -> None:
        """Request the close and wait a few seconds for the process to end."""
        self.request_close()
        self._child.join()

    def _next(self) -> FromVehicleProcess:
        """Wait for the process's next flight or act message. Raises VehicleError when the process is dead."""
        if (received := self._messages.get()) is None:
            self._messages.put(None)
            raise process_died_error(self._child.exit_code)
        return received

    def _listen(self) -> None:
        status = VehicleStatus(vehicle_id=self.call.vehicle.vehicle_id, state="connecting", at=status_time(), step="")
        patience_s: float | None = None
        try:
            while True:
                while not self._child.pipe.poll(patience_s):
                    self._hear_of(replace(status, state="not answering", at=status_time(), trouble=NOT_ANSWERING))
                match self._child.pipe.recv():
                    case VehicleStatus() as status:
                        self._hear_of(status)
                    case CommandForwarded() as forwarded:
                        self._note_forwarded(forwarded)
                    case StagingLost(why):
                        self.staging_lost = why
                    case ConnectionOpened(concern=concern) as opened:
                        status, patience_s = replace(status, concern=concern), self.call.clock.wall_s(SILENT_AFTER_S)
                        self._messages.put(opened)
                    case message:
                        self._messages.put(message)
        except (EOFError, OSError):
            self._child.join()
        finally:
            self._ended.set()
            self._messages.put(None)
            self._end_orders()
            with self._sending:
                self._child.pipe.close()


def process_died_error(exit_code: int | None) -> VehicleError:
    return VehicleError(
        f"The flight process died (exit code {exit_code}).",
        hint="Inspect the vehicle and the worker's log, then fly again.",
    )
