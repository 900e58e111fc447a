"""Connections to vehicles: carries out acts, and keeps the wanted links open.

Land and motors off go from the socket's thread straight into a connection's pipe; their outcome is recorded afterwards.
"""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Final, TypeVar

import structlog
from sqlalchemy.orm import Session as Transaction

from app.common.errors import ConflictError, GainlineError
from app.common.logging import say
from app.common.states import GIVES_GAINS, ActKind
from app.fleet import commands
from app.fleet.commands import ActTask
from app.flights.connection_process import run_connection_process
from app.flights.flight_process import RECONNECT_INTERVAL_S, VehicleConnection
from app.flights.process_messages import (
    CommandForwarded,
    ConnectionRequest,
    VehicleResponse,
    status_time,
)
from app.flights.service import record_abort
from app.flights.worker_part import WorkerPart
from app.live.messages import NO_LINK, VehicleCommandKind, VehicleLinkState, VehicleStatus
from app.vehicles.base import ConnectionOpened, LinkedVehicle, SafeGainsError, VehicleError
from app.vehicles.flight_end import REQUESTED_BY_OPERATOR, StopRequest

T = TypeVar("T")

YIELD_POLL_S: Final = 0.1
MAX_CONCURRENT: Final = 16

_log = structlog.get_logger(__name__)


@dataclass(slots=True)
class VehicleSlot:
    """Connection of one vehicle. `busy` is held while a connection is opened or closed."""

    busy: threading.Lock = field(default_factory=threading.Lock)
    session: VehicleConnection | None = None
    reconnecting: VehicleConnection | None = None
    """A connection that is waiting for its vehicle to answer."""
    concern: str = ""
    restarts: int | None = None
    """Restarts of the vehicle that its connection has reported; None before its first status."""


class VehicleConnectionManager:
    """Claims and carries out acts, and owns the connections.

    `order` and `session` may be called from any thread. Without `links`, no vehicle is reconnected automatically.
    """

    def __init__(self, part: WorkerPart, *, links: bool = True) -> None:
        self._part = part
        self._links = links
        self._slots: dict[int, VehicleSlot] = {}
        self._look_due_s = 0.0
        self._reconnect_executor = ThreadPoolExecutor(MAX_CONCURRENT, thread_name_prefix="link")
        self._record_executor = ThreadPoolExecutor(1, thread_name_prefix="books")

    def recover(self) -> None:
        """Reset the vehicles' states at a worker's start, when no link is open; call it after the recovery of flights.

        Raises StorageError.
        """
        with self._part.database.write() as transaction:
            commands.recover(transaction)
            wanted = commands.request_reconnections(transaction) if self._links else []
        if wanted:
            say(f"Vehicles to connect to again: {len(wanted)}")

    def close(self) -> None:
        """Close all connections once nothing is being carried out; every vehicle is left with its safe gains. The
        process of a vehicle that may be in the air first repeats its command, which the worker's end then waits for."""
        slots = tuple(self._slots.values())
        for session in [each for slot in slots for each in (slot.session, slot.reconnecting) if each is not None]:
            session.request_close()
        self._reconnect_executor.shutdown()
        for session in [slot.session for slot in slots if slot.session is not None]:
            session.close()
            if session.is_running:
                _log.warning(
                    "still commanding a vehicle that may be in the air", vehicle_id=session.call.vehicle.vehicle_id
                )
        self._record_executor.shutdown()

    # ---- from any thread

    def order(self, vehicle_id: int, order: VehicleCommandKind, words: str, by_s: float) -> Future[str]:
        """Send a command; the future holds why it was not forwarded to the vehicle, or "" once it was.

        A flight that waits for its takeoff stands down as well.
        """
        if (session := self._live(vehicle_id)) is None:
            refused: Future[str] = Future()
            refused.set_result(NO_LINK)
            return refused
        answer = session.send_command(order, words, by_s)
        if (trial_id := session.trial_id) is not None:
            self._part.abort_registry.abort(trial_id, StopRequest(words))
        return answer

    def abort(self, trial_id: int, words: str) -> bool:
        """Abort the trial's flight, then record that. Returns whether that trial is being flown here."""
        request = StopRequest(words)
        accepted = self._part.abort_registry.abort(trial_id, request)
        if accepted:
            self._record_in_background(lambda t: record_abort(t, trial_id, request))
        return accepted

    def session(self, vehicle_id: int) -> VehicleConnection:
        """The vehicle's connection, for a flight. Raises VehicleError when there is none."""
        if (session := self._live(vehicle_id)) is None:
            raise _no_link_error()
        return session

    # ---- acts

    def claim(self) -> ActTask | None:
        """Claim the oldest requested act for this worker; None when there is none. Raises StorageError."""
        return self._part.store(lambda t: commands.claim_act(t, self._part.worker))

    def carry_out(self, task: ActTask) -> None:
        """Carry out an act and store its outcome. Raises nothing."""
        with structlog.contextvars.bound_contextvars(vehicle_id=task.vehicle.vehicle_id, act_id=task.act_id):
            try:
                {ActKind.CONNECT: self._connect, ActKind.DISCONNECT: self._disconnect}.get(task.kind, self._ask)(task)
            except Exception as error:  # noqa: BLE001 - outermost frame; the vehicle must not stay busy for ever
                _log.exception("act failed with an internal error")
                self._fail(task, f"Internal error ({type(error).__name__}); see the worker's log.")

    def _connect(self, task: ActTask) -> None:
        try:
            with self._held_slot(task.vehicle.vehicle_id) as slot:
                opened = self._open_connection(slot, task.vehicle)
        except GainlineError as error:
            concern = str(error) if isinstance(error, SafeGainsError) else ""
            self._fail(
                task,
                str(error),
                also=lambda t: commands.record_disconnected(t, task.vehicle.vehicle_id, concern=concern),
            )
            return
        self._store_with_retry(lambda t: commands.finish_connect(t, task, opened))

    def _disconnect(self, task: ActTask) -> None:
        self._close(task.vehicle.vehicle_id)

        def store(transaction: Transaction) -> None:
            commands.record_disconnected(transaction, task.vehicle.vehicle_id)
            commands.finish_act(transaction, task.act_id)

        self._store_with_retry(store)

    def _close(self, vehicle_id: int, *, only: VehicleConnection | None = None) -> None:
        """Close the vehicle's connection; with `only`, close it only if it is that one."""
        with self._held_slot(vehicle_id) as slot:
            if only is not None and slot.session is not only:
                return
            session, slot.session = slot.session, None
            if session is not None:
                session.close()
        self._publish_state(vehicle_id, "gone")

    @contextmanager
    def _held_slot(self, vehicle_id: int) -> Iterator[VehicleSlot]:
        """Hold the vehicle's slot for an act; closes a connection attempt that is holding it."""
        slot = self._slot(vehicle_id)
        while not slot.busy.acquire(timeout=self._part.clock.wall_s(YIELD_POLL_S)):
            if (seeking := slot.reconnecting) is not None:
                seeking.request_close()
        try:
            yield slot
        finally:
            slot.busy.release()

    def _ask(self, task: ActTask) -> None:
        try:
            answered = self.session(task.vehicle.vehicle_id).ask(task.kind, task.vehicle.safe_gains)
        except VehicleError as error:
            self._fail(task, str(error))
            return
        self._slot(task.vehicle.vehicle_id).concern = answered.concern
        self._store_with_retry(partial(_answered, task=task, answered=answered))

    def _fail(self, task: ActTask, problem: str, *, also: Callable[[Transaction], None] = lambda _: None) -> None:
        _log.warning("act failed", act=task.kind, why=problem)

        def store(transaction: Transaction) -> None:
            commands.finish_act(transaction, task.act_id, problem=problem)
            also(transaction)

        self._store_with_retry(store)

    # ---- links

    def maintain(self) -> None:
        """Release ended connections, and reconnect vehicles that are wanted connected. Call it about every second.

        Raises StorageError.
        """
        for vehicle_id, slot in tuple(self._slots.items()):
            if (session := slot.session) is not None and not session.alive:
                self._release_ended(vehicle_id, slot, session)
        if not self._links or self._part.clock.now_s() < self._look_due_s:
            return
        self._look_due_s = self._part.clock.now_s() + RECONNECT_INTERVAL_S
        with self._part.database.read() as transaction:
            wanted = commands.list_vehicles_to_reconnect(transaction)
        for vehicle in wanted:
            slot = self._slot(vehicle.vehicle_id)
            seeking = slot.reconnecting
            if seeking is not None and seeking.call.vehicle.options != vehicle.options:
                seeking.request_close()
            if slot.session is None and seeking is None and slot.busy.acquire(blocking=False):
                self._reconnect_executor.submit(self._reconnect, slot, vehicle)

    def _release_ended(self, vehicle_id: int, slot: VehicleSlot, gone: VehicleConnection) -> None:
        try:
            self._part.store(lambda t: commands.record_disconnected(t, vehicle_id))
        except ConflictError:
            return  # the database still has its flight: try again later
        _log.warning("vehicle connection ended unexpectedly", vehicle_id=vehicle_id)
        if slot.session is gone:  # not one that was opened meanwhile
            slot.session = None
        self._publish_state(vehicle_id, "gone")

    def _reconnect(self, slot: VehicleSlot, vehicle: LinkedVehicle) -> None:
        """Connect a wanted vehicle, with `busy` held. Errors are logged only, because the next attempt follows
        anyway."""
        try:
            opened = self._open_connection(slot, vehicle, patient=True)
            found = slot.session
        except GainlineError as error:
            _log.info("not connected", vehicle_id=vehicle.vehicle_id, why=str(error))
            return
        finally:
            slot.busy.release()
        kept = self._store_with_retry(lambda t: commands.record_reconnected(t, vehicle.vehicle_id, opened))
        if kept is False:
            self._close(vehicle.vehicle_id, only=found)

    def _open_connection(self, slot: VehicleSlot, vehicle: LinkedVehicle, *, patient: bool = False) -> ConnectionOpened:
        """Open a connection, with `busy` held. Raises VehicleError when no link is established."""
        vehicle_id = vehicle.vehicle_id
        if slot.session is not None:
            slot.session.close()
        slot.restarts = None
        self._publish_state(vehicle_id, "connecting")
        call = ConnectionRequest(
            vehicle=vehicle, data_dir=self._part.data_dir, keep_retrying=patient, clock=self._part.clock
        )
        session = slot.reconnecting = VehicleConnection(
            call, run_connection_process, hear=partial(self._on_message, slot, vehicle_id)
        )
        try:
            if self._part.closing.is_set():
                raise _no_link_error()
            opened = session.wait_until_open()
        except BaseException:
            session.close()
            self._publish_state(vehicle_id, "gone")
            raise
        finally:
            slot.reconnecting = None
        slot.concern, slot.session = opened.concern, session
        _log.info("vehicle connected", vehicle_id=vehicle_id, identity=str(opened.identity), concern=opened.concern)
        return opened

    def _live(self, vehicle_id: int) -> VehicleConnection | None:
        slot = self._slots.get(vehicle_id)
        session = None if slot is None else slot.session
        return session if session is not None and session.alive else None

    def _slot(self, vehicle_id: int) -> VehicleSlot:
        return self._slots.setdefault(vehicle_id, VehicleSlot())

    # ---- unsolicited messages of connections

    def _on_message(self, slot: VehicleSlot, vehicle_id: int, news: VehicleStatus | CommandForwarded) -> None:
        """Handle a message, on the connection's own thread."""
        match news:
            case VehicleStatus(concern=concern, restarts=restarts):
                self._part.publish(news)
                if slot.restarts is not None and restarts > slot.restarts:
                    self._record_in_background(lambda t: commands.record_checks(t, vehicle_id, None))
                slot.restarts = restarts
                if concern and concern != slot.concern:
                    self._record_in_background(lambda t: commands.quarantine_vehicle(t, vehicle_id, concern))
                slot.concern = concern
            case CommandForwarded(command, problem):
                kind = ActKind.MOTORS_OFF if command.order == "motors off" else ActKind.LAND
                reason = command.words or REQUESTED_BY_OPERATOR
                self._record_in_background(
                    lambda t: commands.record_command(t, vehicle_id, kind, reason, problem=problem)
                )

    def _publish_state(self, vehicle_id: int, state: VehicleLinkState) -> None:
        self._part.publish(VehicleStatus(vehicle_id=vehicle_id, state=state, at=status_time(), step=""))

    # ---- database

    def _record_in_background(self, work: Callable[[Transaction], None]) -> None:
        """Record in the background, in order, so that the caller does not wait for the database."""
        with suppress(RuntimeError):  # the worker has ended
            self._record_executor.submit(self._store_with_retry, work)

    def _store_with_retry(self, work: Callable[[Transaction], T]) -> T | None:
        """Result of `work`, retried until the database accepts it; None if the database refuses it or the worker
        closes."""

        try:
            return self._part.store_with_retry(
                work, lambda error: _log.error("vehicle state not stored yet", why=str(error))
            )
        except GainlineError as error:
            _log.error("vehicle state conflicts with the database", why=str(error))
            return None


def _answered(transaction: Transaction, task: ActTask, answered: VehicleResponse) -> None:
    vehicle_id = task.vehicle.vehicle_id
    result: dict[str, object] | None = None
    if answered.checks is not None:
        commands.record_checks(transaction, vehicle_id, answered.checks)
        result = {"checks": [{"name": item.name, "passed": item.passed} for item in answered.checks]}
    if answered.parameters is not None:
        result = {"parameters": answered.parameters}
    if task.kind == ActKind.RELEASE and not answered.problem:
        commands.record_released(transaction, vehicle_id, identity=answered.identity)
    elif answered.concern:
        commands.quarantine_vehicle(transaction, vehicle_id, answered.concern)
    elif answered.identity is not None:
        commands.pin_identity(transaction, vehicle_id, answered.identity)
    read_back = answered.held if task.kind in GIVES_GAINS and answered.held else None
    commands.finish_act(transaction, task.act_id, read_back=read_back, result=result, problem=answered.problem)


def _no_link_error() -> VehicleError:
    return VehicleError(
        "There is no link to the vehicle.", hint="Gainline is reconnecting; wait until it is connected, then try again."
    )
