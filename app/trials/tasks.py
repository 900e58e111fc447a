"""Carrying out flights: the only way from a flight row to a vehicle, and back to the database.

What a flight was asked is stored before it is sent, what came of it when it is known. Between lift-off and landing
nothing waits for the database; a record goes to the spool first, and from there into the database.
"""

import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import structlog
from sqlalchemy.orm import Session

from app.db.session import Database
from app.errors import GainlineError, StorageError
from app.live.messages import FlightPhase, Phase, Telemetry
from app.trials import flights
from app.trials.cockpit import Cockpit, Hangar, Landed, Orders, Staged, Trouble
from app.trials.flights import FlightTask
from app.trials.flying import AbortFlag, Airspace, Publish
from app.trials.spool import Spool
from app.vehicles.base import FlightOrder, FlightRecord

RETRY_S: Final = 1.0

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """How a flight ended, so far as this process knows.

    With a `record` it took place. Without one, `lifted_off` says whether the vehicle had been told to take off, and
    `withdrawn` that somebody ended it before that. `concern`: the safe gains could not be verified afterwards;
    `unheard`: whoever had the vehicle ended without saying whether they are restored.
    """

    record: FlightRecord | None = None
    lifted_off: bool = False
    withdrawn: bool = False
    problem: str = ""
    concern: str = ""
    unheard: bool = False


class FlightDeck:
    """Claims flights and carries them out. `closing` ends the waiting for a database that takes nothing."""

    def __init__(
        self,
        database: Database,
        data_dir: Path,
        airspace: Airspace,
        publish: Publish,
        *,
        worker: str,
        closing: threading.Event,
    ) -> None:
        self._database = database
        self._data_dir = data_dir
        self._spool = Spool(data_dir / "spool")
        self._airspace = airspace
        self._publish = publish
        self._worker = worker
        self._closing = closing
        self._hangar = Hangar()

    def close(self) -> None:
        """When nothing flies any more."""
        self._hangar.close()

    def recover(self) -> None:
        """After a start: what was flying is lost, unless its record is in the spool; what was asked for while nobody
        could fly it is not flown. Raises StorageError."""
        with self._database.write() as session:
            for flight_id in flights.withdraw_requested_flights(session, "the worker was away when it was asked for"):
                _log.warning("flight withdrawn: it was asked for before this worker began", flight_id=flight_id)
            for trial_id in flights.lose_running_flights(session):
                _log.warning("flight lost: the worker ended while it was under way", trial_id=trial_id)
        for flight_id in self._spool.kept():
            self._recover_record(flight_id)
        self._spool.sweep()

    def claim(self) -> FlightTask | None:
        """The flight that has waited longest, now this worker's; None when none waits. Raises StorageError."""
        with ExitStack() as undo:
            with self._database.write() as session:
                if (task := flights.claim_flight(session, self._worker)) is not None:
                    self._airspace.enter(task.trial_id)  # before anybody can see that it runs, and abort it
                    undo.callback(self._airspace.leave, task.trial_id)
            undo.pop_all()
        return task

    def carry_out(self, task: FlightTask) -> None:
        """The whole flight, from opening the vehicle to the stored outcome. Raises nothing."""
        with structlog.contextvars.bound_contextvars(
            campaign_id=task.campaign_id, trial_id=task.trial_id, flight_id=task.flight_id
        ):
            try:
                self._report(task, self._fly(task, self._airspace.enter(task.trial_id)))
            except Exception:  # noqa: BLE001 - the edge of the thread
                _log.exception("the end of a flight cannot be stored; the trial is lost at the next start")
            finally:
                self._airspace.leave(task.trial_id)

    def _fly(self, task: FlightTask, flag: AbortFlag) -> Ended:
        if flag.reason is not None:
            return Ended(withdrawn=True, problem=flag.reason)
        try:
            self._spool.claim(task.flight_id)
            cockpit = self._hangar.take()
        except (GainlineError, OSError) as error:
            return Ended(problem=f"It was not begun: {error}")
        try:
            return self._fly_in(cockpit, task, flag)
        finally:
            flag.tell(lambda _reason: None)

    def _fly_in(self, cockpit: Cockpit, task: FlightTask, flag: AbortFlag) -> Ended:
        """The part that the vehicle takes part in; whatever happens, its process is let go, and there is an end."""
        ended = Ended()
        try:
            self._phase(task, "staging")
            flag.tell(lambda reason: cockpit.stand_down(task.trial_id, reason))
            for said in cockpit.fly(self._orders(task)):
                match said:
                    case Telemetry() | FlightPhase():
                        self._publish(said)
                    case Staged(read_back):
                        ended = self._staged(task, flag, cockpit, read_back)
                    case Landed(record):
                        ended = Ended(record=record, lifted_off=True)
                    case Trouble(what, unsafe):
                        ended = replace(ended, problem=ended.problem or what, concern=what if unsafe else "")
        except Exception as error:  # noqa: BLE001 - a mistake of the program must not leave the trial without an end
            cockpit.close()
            return replace(ended, problem=_spoken(error), unheard=True)
        self._hangar.give_back(cockpit)
        return ended

    def _staged(self, task: FlightTask, flag: AbortFlag, cockpit: Cockpit, read_back: dict[str, float]) -> Ended:
        """Take off if the vehicle holds what it was given and the database has taken note; else stand down."""
        ended = Ended(lifted_off=True)
        try:
            self._store(lambda session: flights.record_staged(session, task.flight_id, read_back))
            if (problem := mismatch(task.gains, read_back)) is not None:
                ended = Ended(problem=problem)
            elif flag.reason is not None:
                ended = Ended(withdrawn=True, problem=flag.reason)
            else:
                self._store(lambda session: flights.record_lift_off(session, task.flight_id))
        except GainlineError as error:
            ended = Ended(problem=f"It was not flown, because that could not be recorded: {error}")
        if ended.lifted_off:
            cockpit.take_off()
        else:
            cockpit.decline()
        return ended

    def _orders(self, task: FlightTask) -> Orders:
        return Orders(
            campaign_id=task.campaign_id,
            trial_id=task.trial_id,
            experiment=task.experiment,
            vehicle_kind=task.vehicle_kind,
            vehicle_options=task.vehicle_options,
            safe_gains=task.safe_gains,
            gains=task.gains,
            flight=FlightOrder(seed=task.seed, speed=task.speed),
            lock=self._data_dir / f"vehicle-{task.vehicle_kind}.lock",
        )

    def _phase(self, task: FlightTask, phase: Phase, note: str = "") -> None:
        self._publish(FlightPhase(campaign_id=task.campaign_id, trial_id=task.trial_id, phase=phase, note=note))

    def _report(self, task: FlightTask, ended: Ended) -> None:
        """Store the outcome. What the database refuses is put aside, and the flight is given up in its place: nothing
        but a worker's end leaves a flight running."""
        _log.info("flight over", recorded=ended.record is not None, problem=ended.problem, concern=ended.concern)
        if ended.record is not None:
            self._keep(task, ended.record)
        try:
            stored = self._store_patiently(task, lambda session: _record(session, task, ended))
        except Exception as error:  # noqa: BLE001 - whatever is wrong with the outcome, the vehicle is not blocked by it
            problem = self._refused(task, ended, error)
            stored = self._store_patiently(task, lambda session: _give_up(session, task, ended, problem))
        if stored:
            self._spool.drop(task.flight_id)
            self._phase(task, "ended")

    def _refused(self, task: FlightTask, ended: Ended, error: Exception) -> str:
        why = f"Its outcome cannot be stored: {_spoken(error)}"
        if ended.record is None:
            return why
        kept_as = self._spool.set_aside(task.flight_id)
        return f"{why} The record is kept as {kept_as}." if kept_as else f"{why} The record could not be kept either."

    def _store_patiently(self, task: FlightTask, work: Callable[[Session], None]) -> bool:
        """Try until the database takes it; false when the worker closes meanwhile (the spool keeps the record)."""
        while True:
            try:
                self._store(work)
            except StorageError as error:
                _log.error("outcome not stored yet", why=str(error))
                self._phase(task, "landed", f"The outcome is kept, but not stored yet: {error}")
                if self._closing.wait(RETRY_S):
                    return False
            else:
                return True

    def _keep(self, task: FlightTask, record: FlightRecord) -> None:
        try:
            self._spool.keep(task.flight_id, record)
        except StorageError as error:  # it is still in memory, and goes into the database from there
            _log.error("record not spooled", why=str(error))

    def _store(self, work: Callable[[Session], None]) -> None:
        with self._database.write() as session:
            work(session)

    def _recover_record(self, flight_id: int) -> None:
        """Into the database with it; one that is damaged or refused is put aside. Raises StorageError."""
        try:
            record = self._spool.read(flight_id).record
        except StorageError as error:
            self._put_aside(flight_id, error)
            return
        try:
            self._store(lambda session: flights.recover_record(session, flight_id, record))
        except StorageError:
            raise
        except GainlineError as error:
            self._put_aside(flight_id, error)
            return
        self._spool.drop(flight_id)
        _log.info("record of a lost flight recovered", flight_id=flight_id)

    def _put_aside(self, flight_id: int, error: GainlineError) -> None:
        kept_as = self._spool.set_aside(flight_id)
        _log.error("a flight's record cannot be recovered", flight_id=flight_id, kept_as=kept_as, why=str(error))


def mismatch(asked: dict[str, float], read_back: dict[str, float]) -> str | None:
    """What differs between the gains sent and those read back, or None."""
    wrong = [
        f"{name} is {read_back.get(name, 'missing')} instead of {value:g}"
        for name, value in asked.items()
        if read_back.get(name) != value
    ]
    return f"The vehicle did not take the gains: {'; '.join(wrong)}. It was not flown." if wrong else None


def _spoken(error: Exception) -> str:
    """What went wrong, in words for the operator; what the program did wrong goes to the log in full."""
    if isinstance(error, GainlineError):
        return str(error)
    _log.error("a mistake of the program", exc_info=error)
    return f"The program made a mistake ({type(error).__name__}); see the worker's log."


def _record(session: Session, task: FlightTask, ended: Ended) -> None:
    if ended.record is not None:
        flights.record_landing(session, task.flight_id, ended.record)
    elif ended.lifted_off:
        flights.record_loss(session, task.flight_id, ended.problem or "its process ended without a record")
    elif ended.withdrawn:
        flights.record_withdrawal(session, task.flight_id, ended.problem)
    else:
        flights.record_failure(session, task.flight_id, ended.problem)
    _record_doubts(session, task, ended)


def _give_up(session: Session, task: FlightTask, ended: Ended, problem: str) -> None:
    flights.give_up_flight(session, task.flight_id, problem)
    _record_doubts(session, task, ended)


def _record_doubts(session: Session, task: FlightTask, ended: Ended) -> None:
    if ended.concern:
        flights.quarantine_vehicle(session, task.flight_id, ended.concern)
    elif ended.unheard:
        flights.doubt_vehicle(session, task.flight_id)
