"""Execution of flights: the only path from a flight row to a vehicle and back to the database.

A request is stored before it is sent, its outcome when it is known. Nothing waits for the database between lift-off and
landing; a record goes to the spool first, and from there into the database.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final

import structlog
from sqlalchemy.orm import Session

from app.common.data_folder import telemetry_log
from app.common.errors import GainlineError, StorageError
from app.core.clock import REAL_TIME
from app.db.session import RETRY_S
from app.flights import flight_rows
from app.flights.flight_loop import FlightExecution
from app.flights.flight_process import FlightProcess, FlightProcessPool
from app.flights.flight_rows import FlightOutcome
from app.flights.process_messages import (
    CancelFlight,
    FlightFailure,
    FlightLanded,
    FlightRequest,
    GainsStaged,
    SafeGainsRestored,
    TakeOffDecision,
    ToVehicleProcess,
)
from app.flights.record_spool import Spool
from app.flights.worker_part import AbortFlag, WorkerPart
from app.live.messages import FlightPhase, Phase, Telemetry
from app.vehicles.base import SafeGainsError, Vehicle, find_mismatch
from app.vehicles.flight_end import StopRequest, end_text
from app.vehicles.registry import get_kind, open_vehicle

STAGED_FOR_S: Final = 600.0
"""How long a vehicle with a trial's gains on it waits for its operator's takeoff request."""
POLL_INTERVAL_S: Final = 0.05

_log = structlog.get_logger(__name__)


class DirectFlight(FlightExecution):
    """What a runner without processes flies with, on its own thread: that of `gainline run`.

    `show` gets the telemetry; `hold` hears the gains on the vehicle, None while they are unknown. `trial_parameters` is
    as in `open_vehicle`. `error` is what ended the last flight, if anything did.
    """

    alive = True
    staging_lost = ""

    def __init__(
        self,
        show: Callable[[Telemetry], None],
        hold: Callable[[Mapping[str, float] | None], None],
        trial_parameters: Path | None,
    ) -> None:
        super().__init__(REAL_TIME, show)
        self._hold = hold
        self._trial_parameters = trial_parameters
        self._answer = TakeOffDecision(None)
        self.error: Exception | None = None

    def decide(self, takes_off: bool) -> None:
        self._answer = TakeOffDecision(math.inf if takes_off else None)

    def cancel_flight(self, trial_id: int, request: StopRequest) -> None:
        self._note(CancelFlight(trial_id, request))

    def close(self) -> None:
        """Nothing is kept open between flights."""

    def _next(self) -> ToVehicleProcess:
        return self._answer

    @contextmanager
    def _vehicle_for(self, request: FlightRequest) -> Iterator[Vehicle]:
        self.error, is_held = None, False
        try:
            with open_vehicle(
                request.vehicle_kind,
                request.vehicle_options,
                safe_gains=request.safe_gains,
                trial_parameters=self._trial_parameters,
            ) as vehicle:
                self._hold(None)
                is_held = True
                yield vehicle
        except Exception as error:
            self.error, is_held = error, is_held and not isinstance(error, SafeGainsError)
            raise
        finally:
            if is_held:
                self._hold(request.safe_gains)


FlightBackend = FlightProcess | DirectFlight


class FlightRunner:
    """Claims flights and carries them out.

    `session(vehicle_id)` returns what flies a vehicle that keeps its connection between flights; other vehicles are
    opened for each flight in a process of the pool. Without a pool `session` flies every vehicle.
    """

    def __init__(
        self, part: WorkerPart, *, session: Callable[[int], FlightBackend], pool: FlightProcessPool | None
    ) -> None:
        self._part = part
        self._session = session
        self._spool = Spool(part.data_dir / "spool")
        self._pool = pool

    def close(self) -> None:
        """Close the process pool. Call it only when nothing flies."""
        if self._pool is not None:
            self._pool.close()

    def recover(self) -> None:
        """Clean up after a start of the worker.

        Flights that were running are lost unless their record is in the spool; requests from the time without a worker
        are withdrawn. Raises StorageError.
        """
        with self._part.database.write() as session:
            for flight_id in flight_rows.withdraw_requested_flights(
                session, "no worker was running when it was requested"
            ):
                _log.warning("flight withdrawn: it was requested before this worker started", flight_id=flight_id)
            for trial_id in flight_rows.lose_running_flights(session):
                _log.warning("flight lost: the worker stopped during it", trial_id=trial_id)
        for flight_id in self._spool.flight_ids():
            self._recover_record(flight_id)
        self._spool.delete_unfinished()

    def claim(self) -> FlightRequest | None:
        """Claim the oldest requested flight for this worker; None when there is none. Raises StorageError."""
        with ExitStack() as undo:
            with self._part.database.write() as session:
                if (request := flight_rows.claim_flight(session, self._part.worker)) is not None:
                    self._part.abort_registry.register(
                        request.trial_id
                    )  # before a client can see that it runs, and abort it
                    undo.callback(self._part.abort_registry.unregister, request.trial_id)
            undo.pop_all()
        return request

    def carry_out(self, request: FlightRequest) -> None:
        """Carry out the whole flight, from opening the vehicle to the stored outcome. Raises nothing."""
        with structlog.contextvars.bound_contextvars(
            campaign_id=request.campaign_id, trial_id=request.trial_id, flight_id=request.flight_id
        ):
            try:
                self._store_outcome(request, self._fly(request, self._part.abort_registry.register(request.trial_id)))
            except Exception:  # noqa: BLE001 - outermost frame of the thread
                _log.exception("the end of a flight cannot be stored; the trial is lost at the next start")
            finally:
                self._part.abort_registry.unregister(request.trial_id)

    def _fly(self, request: FlightRequest, flag: AbortFlag) -> FlightOutcome:
        if flag.request is not None:
            return flight_rows.withdrawn_outcome(flag.request)
        try:
            self._spool.reserve(request.flight_id)
            telemetry_log(self._part.data_dir, request.flight_id).parent.mkdir(exist_ok=True)
            if self._pool is None or get_kind(request.vehicle_kind).connect is not None:
                backend = self._session(request.vehicle_id)
            else:
                backend = self._pool.acquire()
        except (GainlineError, OSError) as error:
            return FlightOutcome(problem=f"The flight was not started: {error}")
        try:
            return self._fly_on_backend(backend, request, flag)
        finally:
            flag.add_listener(lambda _request: None)

    def _fly_on_backend(self, backend: FlightBackend, request: FlightRequest, flag: AbortFlag) -> FlightOutcome:
        """Fly the vehicle; whatever happens, release its process and return an outcome."""
        ended = FlightOutcome()
        try:
            self._phase(request, "staging")
            flag.add_listener(lambda stop: backend.cancel_flight(request.trial_id, stop))
            with closing(backend.fly(request)) as messages:
                for message in messages:
                    match message:
                        case Telemetry() | FlightPhase():
                            self._part.publish(message)
                        case GainsStaged(read_back):
                            ended = self._staged(request, flag, backend, read_back)
                        case FlightLanded(record):
                            ended = flight_rows.outcome_of(record)
                        case SafeGainsRestored(held):
                            ended = replace(ended, restored=held)
                        case FlightFailure(what, unsafe, not_flown):
                            ended = replace(
                                ended,
                                problem=ended.problem or what,
                                concern=what if unsafe else "",
                                lifted_off=ended.lifted_off and not not_flown,
                            )
        except Exception as error:  # noqa: BLE001 - an internal error must not leave the trial without an end
            backend.close()
            return replace(ended, problem=_describe_error(error), unheard=True)
        if self._pool is not None and type(backend) is FlightProcess:  # a connection is kept open
            self._pool.release(backend)
        return ended

    def _staged(
        self, request: FlightRequest, flag: AbortFlag, backend: FlightBackend, read_back: dict[str, float]
    ) -> FlightOutcome:
        """Command the takeoff if the vehicle holds the trial's gains and the lift-off is recorded; else cancel it."""
        ended = FlightOutcome(lifted_off=True)
        try:
            self._part.store(lambda session: flight_rows.record_staged(session, request.flight_id, read_back))
            if mismatch := find_mismatch(read_back, request.gains):
                ended = FlightOutcome(problem=f"The vehicle did not accept the gains: {mismatch}. It was not flown.")
            elif (withdrawn := self._await_takeoff_clearance(request, flag, backend)) is not None:
                ended = withdrawn
            else:
                self._part.store(lambda session: flight_rows.record_lift_off(session, request.flight_id))
        except GainlineError as error:
            ended = FlightOutcome(
                problem=f"The flight was not started, because its start could not be recorded: {error}"
            )
        backend.decide(ended.lifted_off)
        return ended

    def _await_takeoff_clearance(
        self, request: FlightRequest, flag: AbortFlag, backend: FlightBackend
    ) -> FlightOutcome | None:
        """Wait until the vehicle may take off: at once, or on its operator's request. Returns None, or the outcome of
        the flight that must not take place."""
        if request.mode == "fly":
            return None if flag.request is None else flight_rows.withdrawn_outcome(flag.request)
        self._phase(request, "staged")
        until_s = self._part.clock.now_s() + STAGED_FOR_S
        while self._part.clock.now_s() < until_s:
            if flag.request is not None:
                return flight_rows.withdrawn_outcome(flag.request)
            if why := backend.staging_lost if backend.alive else "the vehicle's process ended":
                return FlightOutcome(withdrawn=True, problem=why)
            try:
                with self._part.database.read() as session:
                    may_take_off, stands_down = flight_rows.clearance_of(session, request.flight_id)
                if may_take_off or stands_down is not None:
                    return stands_down
            except StorageError as error:
                _log.error("the takeoff request cannot be read", why=str(error))
                self._part.clock.wait_s(RETRY_S)
            self._part.clock.wait_s(POLL_INTERVAL_S)
        why = f"its takeoff was not requested within {STAGED_FOR_S / 60:g} minutes"
        return FlightOutcome(withdrawn=True, problem=why)

    def _phase(self, request: FlightRequest, phase: Phase, note: str = "") -> None:
        self._part.publish(
            FlightPhase(campaign_id=request.campaign_id, trial_id=request.trial_id, phase=phase, note=note)
        )

    def _store_outcome(self, request: FlightRequest, ended: FlightOutcome) -> None:
        """Store the outcome; if the database refuses it, set the record aside and give the flight up instead.

        Only the end of the worker leaves a flight in state running.
        """
        _log.info("flight over", recorded=ended.record is not None, end=end_text(ended.ended), concern=ended.concern)
        flight_id = request.flight_id
        if ended.record is not None:
            try:
                self._spool.write(flight_id, ended.record)
            except StorageError as error:  # the record is still in memory and is stored from there
                _log.error("record not spooled", why=str(error))
        try:
            stored = self._store_with_retry(
                request, lambda session: flight_rows.record_outcome(session, flight_id, ended)
            )
        except Exception as error:  # noqa: BLE001 - whatever is wrong with the outcome, it must not block the vehicle
            problem = self._refused(request, ended, error)
            stored = self._store_with_retry(
                request, lambda session: flight_rows.give_up_flight(session, flight_id, ended, problem)
            )
        if stored:
            self._spool.delete(flight_id)
            self._phase(request, "ended")

    def _refused(self, request: FlightRequest, ended: FlightOutcome, error: Exception) -> str:
        why = f"Its outcome cannot be stored: {_describe_error(error)}"
        if ended.record is None:
            return why
        kept_as = self._spool.set_aside(request.flight_id)
        return f"{why} The record is saved as {kept_as}." if kept_as else f"{why} The record could not be saved either."

    def _store_with_retry(self, request: FlightRequest, work: Callable[[Session], None]) -> bool:
        """Retry until the database accepts it; False when the worker closes meanwhile (the spool keeps the record)."""

        def store(session: Session) -> bool:
            work(session)
            return True

        def refused(error: StorageError) -> None:
            _log.error("outcome not stored yet", why=str(error))
            self._phase(request, "landed", f"The outcome could not be stored yet; Gainline keeps trying: {error}")

        return self._part.store_with_retry(store, refused) is not None

    def _recover_record(self, flight_id: int) -> None:
        """Move a record from the spool into the database; set a damaged or refused one aside. Raises StorageError."""
        try:
            record = self._spool.read(flight_id)
            self._part.store(lambda session: flight_rows.recover_record(session, flight_id, record))
        except StorageError:
            raise
        except GainlineError as error:
            kept_as = self._spool.set_aside(flight_id)
            _log.error("a flight's record cannot be recovered", flight_id=flight_id, kept_as=kept_as, why=str(error))
            return
        self._spool.delete(flight_id)
        _log.info("record of a lost flight recovered", flight_id=flight_id)


def _describe_error(error: Exception) -> str:
    """Describe an error for the operator; an internal error is logged in full."""
    if isinstance(error, GainlineError):
        return str(error)
    _log.error("internal error", exc_info=error)
    return f"Internal error ({type(error).__name__}); see the worker's log."
