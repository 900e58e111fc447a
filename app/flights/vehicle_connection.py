"""Connection to a vehicle: a process of its own that keeps the link open between flights.

This is the worker's side; the process itself is in `connection_process`. It never touches the database. When the worker
dies, the pipe between them breaks. A flight is then aborted: the vehicle lands and is left with its safe gains. A land
or motors off command outside a flight is repeated until the vehicle obeys, for at most 60 s, but not if it was already
repeated for 60 s without a packet from the vehicle. Then the process ends; the next worker's connection waits for that.
"""

import itertools
import os
import queue
import socket
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Final

from app.common.states import ActKind
from app.flights.flight_process import FlightProcess, process_died_error
from app.flights.process_messages import (
    CommandForwarded,
    ConnectionOpened,
    ConnectionRequest,
    FlightFailure,
    FromVehicleProcess,
    StagingLost,
    VehicleCommand,
    VehicleRequest,
    VehicleResponse,
)
from app.flights.vehicle_status import status_time
from app.live.messages import NO_LINK, SILENT_AFTER_S, VehicleCommandKind, VehicleStatus
from app.vehicles.base import SafeGainsError, VehicleError

_ENDED: Final = (
    "The process that had the vehicle's link ended; it is unknown whether the command was sent. Use the vehicle's "
    "own remote control now."
)
_UNCONFIRMED: Final = "The process that had the vehicle's link ended before the vehicle confirmed it."
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


MessageHandler = Callable[[VehicleStatus | CommandForwarded], None]


class VehicleConnection(FlightProcess):
    """The worker's handle of such a process: a FlightProcess with a link to the vehicle between flights.

    `hear` is called on a thread of the connection with the vehicle's status and the outcome of commands, that of motors
    off once the vehicle has confirmed it or has not in time; while the process does not answer, every two seconds with
    a status that says so. One flight or act at a time; commands may be sent at any moment, from any thread.
    """

    _take_off_timeout_s = TAKE_OFF_TIMEOUT_S

    def __init__(
        self, call: ConnectionRequest, run: Callable[[Connection, ConnectionRequest], None], *, hear: MessageHandler
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
        self._answer_order(forwarded.number, forwarded.problem)
        self._awaited[forwarded.number] = forwarded
        if not forwarded.is_awaited:
            self._hear_of(self._awaited.pop(forwarded.number))

    def _end_orders(self) -> None:
        for number in tuple(self._orders):
            self._answer_order(number, _ENDED)
        for forwarded in self._awaited.values():
            self._hear_of(replace(forwarded, problem=_UNCONFIRMED, is_awaited=False))

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
