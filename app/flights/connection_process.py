"""Process of a vehicle connection: holds one vehicle's link and carries out the worker's requests.

It polls the pipe every few milliseconds in every operation during which the vehicle might move. Status and telemetry
are dropped when the worker does not read them, so that a flight never waits for the worker.
"""

import os
import time
from collections.abc import Generator, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from multiprocessing.connection import Connection
from typing import Final

from app.common.data_folder import telemetry_log, trial_parameters_folder, vehicle_lock
from app.common.states import ActKind
from app.flights.flight_loop import (
    FlightLoop,
    PipeClosedError,
    WorkerPipe,
    failure_from,
    hold_vehicle_lock,
)
from app.flights.flight_process import RECONNECT_INTERVAL_S, TAKE_OFF_TIMEOUT_S
from app.flights.process_messages import (
    CommandForwarded,
    ConnectionRequest,
    FlightMessage,
    FlightRequest,
    SafeGainsRestored,
    Staging,
    StagingLost,
    ToVehicleProcess,
    VehicleCommand,
    VehicleRequest,
    VehicleResponse,
    is_silent,
    status_of,
)
from app.live.messages import SILENT_AFTER_S, VehicleStatus
from app.processes import ignore_stop_signals
from app.vehicles.base import (
    ConnectedVehicle,
    ConnectionOpened,
    InterruptedByOrderError,
    SafeGainsError,
    Vehicle,
    VehicleError,
)
from app.vehicles.flight_end import REQUESTED_BY_OPERATOR, StopRequest
from app.vehicles.registry import get_kind, restore_safe_gains

_NOT_READY: Final[Mapping[Staging, str]] = {
    "silent": f"nothing was received from the vehicle for {SILENT_AFTER_S:g} s",
    "lost": "the staged gains are no longer on the vehicle",
}

POLL_INTERVAL_S: Final = 0.005
STATUS_INTERVAL_S: Final = 0.2
LOCK_TIMEOUT_S: Final = 120.0
"""How long the process waits for that of a killed worker, which may be landing or waiting for a lost link."""
STANDING_ORDER_TIMEOUT_S: Final = 60.0
"""How long the process repeats a command after its worker's end; shorter than the next connection's wait for the
lock."""
_EXPIRED: Final = "The command reached the vehicle's process too late and was not sent; the caller was notified."


def run_connection_process(pipe: Connection, call: ConnectionRequest) -> None:
    """Main function of the process, from connecting until the worker closes the pipe or dies, or the link fails."""
    ignore_stop_signals()
    line = WorkerPipe(pipe)
    try:
        lock = vehicle_lock(call.data_dir, call.vehicle.vehicle_id)
        with (
            hold_vehicle_lock(lock, within_s=LOCK_TIMEOUT_S, wanted=line.is_open, clock=call.clock),
            closing(VehicleProcess(line, call)) as process,
        ):
            process.run()
    except PipeClosedError:
        pass
    except Exception as error:  # noqa: BLE001 - outermost frame of the process; the worker's log has the error
        line.send(failure_from(error))
    finally:
        pipe.close()
        os._exit(0)


class VehicleProcess(FlightLoop):
    """One connected vehicle, and the requests that it carries out."""

    def __init__(self, line: WorkerPipe, call: ConnectionRequest) -> None:
        """Connect to the vehicle. Raises VehicleError when it does not answer."""
        super().__init__(line, call.clock, line.send_if_ready)
        self._call = call
        self._speed = float(call.vehicle.options.get("clock_speed", 1.0))
        self._is_open = self._may_interrupt = False
        self._staging: Staging = "none"
        self._take_off_by_s: float | None = None
        self._stops: list[CommandForwarded] = []
        self._vehicle = self._open_vehicle()
        self._is_open = True
        self._show_due_s = 0.0
        line.send(ConnectionOpened(identity=self._vehicle.identity, concern=self._vehicle.concern, held=self._held()))

    def run(self) -> None:
        """Carry out requests one after another.

        Raises PipeClosedError when the worker closes the pipe or dies, VehicleError when the link fails. After the
        worker's end a land or motors off command is repeated until telemetry confirms it, for at most
        STANDING_ORDER_TIMEOUT_S; not at all if it was already repeated that long without a packet from the vehicle.
        """
        try:
            super().run()
        except PipeClosedError:
            until_s = self._clock.now_s() + STANDING_ORDER_TIMEOUT_S
            while self._vehicle.has_standing_order and self._clock.now_s() < until_s:
                self._vehicle.attend(POLL_INTERVAL_S * self._speed)
            raise

    def _carry_out(self, asked: ToVehicleProcess) -> None:
        if isinstance(asked, VehicleRequest):
            self._line.send(self._act(asked))
        else:
            super()._carry_out(asked)

    def close(self) -> None:
        self._vehicle.close()

    # ---- between flights

    def _open_vehicle(self) -> ConnectedVehicle:
        it, folder = self._call.vehicle, trial_parameters_folder(self._call.data_dir)
        connect = get_kind(it.kind).connect
        assert connect is not None, it.kind
        while True:
            try:
                return connect(it.options, it.safe_gains, folder, it.identity, self._while_waiting, it.was_flying)
            except VehicleError as error:
                if not self._call.keep_retrying or isinstance(error, SafeGainsError):
                    raise
            for _ in range(round(RECONNECT_INTERVAL_S / POLL_INTERVAL_S)):
                self._line.receive()
                self._clock.wait_s(POLL_INTERVAL_S)

    def _next(self) -> ToVehicleProcess:
        """Return the worker's next message that is not a command; forward commands at once, and attend to the vehicle
        meanwhile."""
        while (message := self._line.receive()) is None or isinstance(message, VehicleCommand):
            if message is not None:
                self._forward_command(message)
            self._vehicle.attend(POLL_INTERVAL_S * self._speed)
            if (status := self._publish_status()) is not None and self._staging in {"staged", "silent"}:
                self._watch_staged(status)
        return message

    def _await_takeoff_clearance(self) -> float | None:
        """Wait for the worker's decision while the staged vehicle is watched. Raises VehicleError if it is to take off
        without its staged gains."""
        self._staging = "staged"
        try:
            by_s = super()._await_takeoff_clearance()
            is_in_time = by_s is not None and time.monotonic() <= by_s
            if is_in_time and (problem := _NOT_READY.get(self._staging)):
                raise _not_flown(f"The flight was not started: {problem}.", "Stage it again.")
        finally:
            self._staging = "none"
        return by_s

    def _watch_staged(self, status: VehicleStatus) -> None:
        """After a silence, a restart or a gap in its positions, read the staged gains again; tell the worker if they
        are lost."""
        if is_silent(status):
            self._staging = "silent"
        elif self._staging == "silent" or not status.held or not status.position_hz:
            try:
                with self._interruptible():
                    self._vehicle.confirm_staged()
                self._staging = "staged"
            except VehicleError as error:
                self._staging = "lost"
                self._line.send(StagingLost(str(error)))

    def _while_waiting(self) -> None:
        """Callback of slow operations on the ground: forwards a command at once, which interrupts the operation.

        Raises InterruptedByOrderError for a forwarded command, VehicleError when the takeoff is late.
        """
        if not self._is_open:
            return
        self._publish_status()
        self._require_in_time()
        ordered = self._line.receive_command()
        if ordered is not None and self._forward_command(ordered) and self._may_interrupt:
            self._end_interruptions()
            raise InterruptedByOrderError(
                f"It was interrupted: {ordered.order} was commanded ({ordered.words or REQUESTED_BY_OPERATOR}).",
                hint="Check what the vehicle is doing, then request it again.",
            )

    @contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Context that the first command interrupts."""
        self._may_interrupt = True
        try:
            yield
        finally:
            self._end_interruptions()

    def _end_interruptions(self) -> None:
        """Make what follows uninterruptible: the flight, which polls commands itself, or restoring the safe gains."""
        self._may_interrupt, self._take_off_by_s = False, None

    def _forward_command(self, ordered: VehicleCommand) -> bool:
        """Forward a command to the vehicle and report it to the worker. Returns whether it was sent."""
        problem = _EXPIRED if _has_expired(ordered) else ""
        if not problem:
            try:
                act = self._vehicle.motors_off if ordered.order == "motors off" else self._vehicle.land
                act(ordered.words)
            except VehicleError as error:
                problem = str(error)
        self._report(ordered, problem)
        return not problem

    def _report(self, ordered: VehicleCommand, problem: str = "") -> None:
        """Report a command that was forwarded to the vehicle, which must confirm that its motors have stopped."""
        is_awaited = ordered.order == "motors off" and not problem
        forwarded = CommandForwarded(ordered, problem, is_awaited)
        self._line.send(forwarded)
        self._stops += [forwarded] * is_awaited

    def _report_stops(self) -> None:
        if self._stops and (has_stopped := self._vehicle.has_stopped) is not None:
            problem = "" if has_stopped else "The vehicle has not confirmed that its motors stopped."
            for each in self._stops:
                self._line.send(replace(each, problem=problem, is_awaited=False))
            self._stops.clear()

    def _publish_status(self) -> VehicleStatus | None:
        """Publish the status if it is due; return what was published."""
        now_s = self._clock.now_s()
        if now_s < self._show_due_s:
            return None
        self._show_due_s = max(self._show_due_s + STATUS_INTERVAL_S, now_s)
        self._report_stops()
        status = status_of(self._call.vehicle.vehicle_id, self._vehicle, self._staging, speed=self._speed)
        self._line.send_if_ready(status)
        return status

    def _held(self) -> dict[str, float]:
        return dict(self._vehicle.condition().held)

    # ---- acts

    def _act(self, asked: VehicleRequest) -> VehicleResponse:
        checks, parameters, identity, problem = None, None, None, ""
        try:
            if self._vehicle.condition().armed:  # a slow operation would delay Land
                raise VehicleError(
                    "The vehicle is armed.", hint="Land it, and request it again once its motors have stopped."
                )
            self._require_safe_gains(asked.safe_gains)
            with self._interruptible():
                match asked.kind:
                    case ActKind.CHECK:
                        checks = self._vehicle.check()
                    case ActKind.PARAMETERS:
                        parameters = self._vehicle.parameters()
                    case ActKind.RESTORE:
                        self._vehicle.restore()
                    case ActKind.RELEASE:
                        self._vehicle.release()
                    case kind:
                        raise VehicleError(
                            f"A vehicle connection cannot execute “{kind}”.", hint="Report this with the worker's log."
                        )
            identity = self._vehicle.identity
        except VehicleError as error:
            problem = str(error)
        return VehicleResponse(
            problem=problem,
            concern=self._vehicle.concern,
            held=self._held(),
            checks=checks,
            parameters=parameters,
            identity=identity,
        )

    def _require_safe_gains(self, safe_gains: Mapping[str, float]) -> None:
        """Give the vehicle its safe gains if a person has changed them. The link stays open for commands."""
        if dict(self._vehicle.safe_gains) != dict(safe_gains):
            self._vehicle.change_safe_gains(safe_gains)

    # ---- flights

    @contextmanager
    def _vehicle_for(self, request: FlightRequest) -> Iterator[ConnectedVehicle]:
        self._require_safe_gains(request.safe_gains)
        self._vehicle.log_to(telemetry_log(self._call.data_dir, request.flight_id))
        try:
            try:
                yield self._vehicle
            finally:
                self._line.send(SafeGainsRestored(restore_safe_gains(self._vehicle)))
        finally:
            self._vehicle.log_to(None)

    def _require_in_time(self) -> None:
        """Check the takeoff deadline until the vehicle arms. Every wait on the ground extends it, so that only a
        process that was suspended misses it. Raises VehicleError then."""
        by_s, now_s = self._take_off_by_s, time.monotonic()
        if by_s is None:
            return
        self._take_off_by_s = now_s + TAKE_OFF_TIMEOUT_S if now_s <= by_s else None
        if now_s > by_s:
            raise _not_flown(
                "The flight was not started: the takeoff was too late, because the vehicle's process had stalled.",
                "Check that this computer is not overloaded, then request the flight again.",
            )

    def _take_off(self, vehicle: Vehicle, request: FlightRequest, by_s: float) -> Generator[FlightMessage]:
        with self._interruptible():
            self._take_off_by_s = by_s
            self._require_in_time()
            yield from super()._take_off(vehicle, request, by_s)

    def _should_stop(self) -> StopRequest | None:
        self._require_in_time()
        self._end_interruptions()
        self._publish_status()
        return super()._should_stop()

    def _note(self, message: ToVehicleProcess) -> None:
        """Note a reason to end the flight: the first one counts, but motors off overrides it."""
        match message:
            case VehicleCommand() if _has_expired(message):
                self._report(message, _EXPIRED)
            case VehicleCommand(order=order, words=words):
                if order == "motors off":
                    self._stop = StopRequest(words, motors_off=True)
                self._stop = self._stop or StopRequest(words)
                self._report(message)
            case _:
                super()._note(message)


def _has_expired(ordered: VehicleCommand) -> bool:
    return time.monotonic() > ordered.by_s


def _not_flown(what: str, hint: str) -> VehicleError:
    error = VehicleError(what, hint=hint)
    error.not_flown = True
    return error
