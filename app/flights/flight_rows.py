"""States of a flight in the database: its request, and what the worker that carries it out records.

    add_flight → claim_flight → record_staged → record_lift_off → record_outcome

A flight of mode `stage` waits between record_staged and record_lift_off, for what `clearance_of` says. `record_outcome`
and `give_up_flight` may be called at any stage: a flight whose takeoff was not commanded was not flown, nor one whose
vehicle has certainly never left the ground.

What is sent to the vehicle is stored in the flight row before it is sent; what the vehicle answers, as soon as it is
known. Each function is for a transaction of its own, and reads the flight's rows in one statement.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session, joinedload

from app.campaigns import proposals
from app.campaigns.history import set_flight_state, set_trial_state, trial_row
from app.campaigns.trials.records import capture
from app.common.errors import ConflictError, NotFoundError
from app.common.states import FlightMode, FlightState, TrialState, VehicleState
from app.core.tuning.stop_rules import battery_v
from app.db.base import added, utc_now
from app.db.models import FlightRow
from app.fleet import service as fleet
from app.flights.process_messages import FlightRequest
from app.vehicles.base import FlightRecord, find_mismatch
from app.vehicles.flight_end import (
    FlightEnd,
    GainsLeft,
    Landing,
    Requester,
    StopRequest,
    end_text,
    not_begun,
    withdrawn_by,
)

REQUEST_TIMEOUT: Final = timedelta(seconds=10)
"""Maximum age of a request when a worker claims it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOutcome:
    """Outcome of a flight, as far as the worker knows.

    With a `record` the flight took place. Without one, `lifted_off` says whether the vehicle may have left the ground,
    and `withdrawn` whether the flight was ended on request before that; `end` is how, or `problem` what went wrong.
    `concern`: the safe gains could not be verified afterwards. `unheard`: the flight's process ended without reporting
    whether they are restored. `restored`: they were read back.
    """

    record: FlightRecord | None = None
    lifted_off: bool = False
    withdrawn: bool = False
    end: FlightEnd | None = None
    problem: str = ""
    concern: str = ""
    unheard: bool = False
    restored: Mapping[str, float] | None = None

    @property
    def ended(self) -> FlightEnd:
        """How the flight ended, as its record, the request or the problem tells."""
        if self.record is not None:
            return self.record.end
        if self.lifted_off:
            return FlightEnd(remarks=(self.problem or "its process ended without a record",), landed=Landing.UNKNOWN)
        return self.end or not_begun(self.problem)

    def gains_left(self, end: FlightEnd, safe_gains: Mapping[str, float] | None) -> FlightEnd:
        """The end, with what was read back of the safe gains."""
        if self.restored is None:
            return end
        if self.restored != safe_gains:
            return replace(end, gains_left=GainsLeft.OTHER)
        return end if self.concern else replace(end, gains_left=GainsLeft.SAFE)


def outcome_of(record: FlightRecord) -> FlightOutcome:
    """Outcome of a flight with this record, which is dropped if nothing was flown."""
    if record.has_flown:
        return FlightOutcome(record=record, lifted_off=True)
    return FlightOutcome(withdrawn=record.end.request is not None, end=record.end)


def withdrawn_outcome(request: StopRequest) -> FlightOutcome:
    """Outcome of a flight that was aborted before its vehicle was commanded to take off."""
    return FlightOutcome(withdrawn=True, end=withdrawn_by(request))


_WITH_ALL: Final = (
    select(FlightRow)
    .options(*(joinedload(of, innerjoin=True) for of in (FlightRow.campaign, FlightRow.trial, FlightRow.vehicle)))
    .order_by(FlightRow.id)
)
"""Flights with their trials, vehicles and campaigns."""


def _read(session: Session, flight_id: int) -> FlightRow:
    if (flight := session.scalar(_WITH_ALL.where(FlightRow.id == flight_id))) is None:
        raise NotFoundError("flight", flight_id)
    return flight


def _read_running(session: Session, flight_id: int) -> FlightRow:
    flight = _read(session, flight_id)
    if flight.state != FlightState.RUNNING:
        raise ConflictError(
            f"Flight {flight_id} is {flight.state}, not running.", hint="It cannot continue. Reload the trial."
        )
    return flight


def _first_requested(session: Session) -> FlightRow | None:
    return session.scalar(_WITH_ALL.where(FlightRow.state == FlightState.REQUESTED).limit(1))


def add_flight(session: Session, trial_id: int, *, mode: FlightMode, speed: float | None) -> FlightRow:
    """Add the request that a vehicle flies a trial's gains, with the label of its battery. Raises NotFoundError."""
    trial, now = trial_row(session, trial_id), utc_now()
    return added(
        session,
        FlightRow(
            campaign_id=trial.campaign_id,
            trial_id=trial_id,
            vehicle_id=trial.campaign.vehicle_id,
            state=FlightState.REQUESTED,
            mode=mode,
            gains=trial.gains,
            speed=speed,
            battery=trial.campaign.vehicle.battery,
            requested_at=now,
            take_off_at=now if mode == "fly" else None,
        ),
    )


def claim_flight(session: Session, worker: str) -> FlightRequest | None:
    """Claim the oldest requested flight for this worker; None when there is none.

    A flight must begin when its operator expects it: a request older than REQUEST_TIMEOUT is withdrawn.
    """
    while (flight := _first_requested(session)) is not None:
        if utc_now() - flight.requested_at <= REQUEST_TIMEOUT:
            set_flight_state(flight, FlightState.RUNNING)
            flight.worker, flight.claimed_at = worker, utc_now()
            flight.safe_gains = dict(flight.vehicle.safe_gains)
            return FlightRequest(
                flight_id=flight.id,
                trial_id=flight.trial_id,
                campaign_id=flight.campaign_id,
                experiment=flight.campaign.experiment,
                experiment_options=flight.campaign.definition["experiment_options"],
                vehicle_id=flight.vehicle_id,
                vehicle_kind=flight.vehicle.kind,
                vehicle_options=fleet.options_of(flight.campaign),
                safe_gains=dict(flight.safe_gains),
                gains=dict(flight.gains),
                seed=flight.trial.seed,
                speed=flight.speed,
                mode=flight.mode,
            )
        _withdraw(flight, f"it could not be started within {REQUEST_TIMEOUT.total_seconds():g} s")
    return None


def withdraw_requested_flights(session: Session, reason: str) -> list[int]:
    """Withdraw all requested flights at a worker's start, because nothing may take off that was requested while no
    worker ran. Returns their ids."""
    withdrawn: list[int] = []
    while (flight := _first_requested(session)) is not None:
        _withdraw(flight, reason)
        withdrawn.append(flight.id)
    return withdrawn


def _withdraw(flight: FlightRow, reason: str) -> None:
    set_flight_state(
        flight,
        FlightState.CANCELLED,
        end=not_begun(f"The flight was not started: {reason}. Request it again if it is still needed."),
    )


def record_staged(session: Session, flight_id: int, read_back: dict[str, float]) -> None:
    """Record the gains that the vehicle read back. Raises ConflictError when the trial was cancelled."""
    flight = _read_running(session, flight_id)
    flight.read_back = flight.trial.read_back = read_back
    fleet.hold_gains(flight.vehicle, read_back)
    set_trial_state(flight.trial, TrialState.STAGED)
    fleet.set_vehicle_state(flight.vehicle, VehicleState.STAGED)


def clearance_of(session: Session, flight_id: int) -> tuple[bool, FlightOutcome | None]:
    """Whether a staged flight may take off now, and its outcome if it must not take place at all; (False, None) while
    it waits.

    It may once its operator has requested the takeoff, for REQUEST_TIMEOUT (10 s): nothing takes off later than its
    operator expects. It must not when it was unstaged, its trial was cancelled, or the takeoff could not begin in
    time; the worker then restores the safe gains and records the flight as withdrawn for this reason.
    """
    return _clearance(_read(session, flight_id))


def _clearance(flight: FlightRow) -> tuple[bool, FlightOutcome | None]:
    if flight.state != FlightState.RUNNING:
        why = f"the flight is {flight.state}"
    elif flight.stand_down:
        end = FlightEnd(request=StopRequest(by=Requester(flight.stand_down)), landed=Landing.STAYED)
        return False, FlightOutcome(withdrawn=True, end=end)
    elif flight.trial.state not in {TrialState.PLANNED, TrialState.STAGED}:
        why = f"the trial is {flight.trial.state}"
    elif flight.mode == "fly":
        return not fleet.needs_staging(flight.vehicle), None
    elif flight.take_off_at is None:
        return False, None
    elif utc_now() - flight.take_off_at <= REQUEST_TIMEOUT:
        return True, None
    else:
        why = f"the takeoff did not start within {REQUEST_TIMEOUT.total_seconds():g} s of the operator's request"
    return False, FlightOutcome(withdrawn=True, problem=why)


def record_lift_off(session: Session, flight_id: int) -> None:
    """Record that the takeoff command is about to be sent.

    After this the flight lands, is lost, or fails because the command was not sent after all. Raises ConflictError when
    the trial was cancelled or unstaged, when the gains read back are not the trial's, or when the operator of a staged
    flight has not requested the takeoff.
    """
    flight = _read_running(session, flight_id)
    trial = flight.trial
    may_take_off, stands_down = _clearance(flight)
    if not may_take_off:
        why = "its takeoff has not been requested" if stands_down is None else end_text(stands_down.ended)
        raise ConflictError(
            f"Flight {trial.number} cannot be flown: {why}.", hint="Stage it again if it is still needed."
        )
    if mismatch := find_mismatch(trial.read_back or {}, trial.gains):
        raise ConflictError(
            f"Flight {trial.number} cannot be flown: the vehicle does not hold its gains: {mismatch}.",
            hint="Stage it again. If this happens again, check the vehicle's link.",
        )
    set_trial_state(trial, TrialState.FLYING, reason="")
    trial.end, trial.flown_at = None, utc_now()
    fleet.set_vehicle_state(flight.vehicle, VehicleState.FLYING)
    proposals.start_flying(flight.campaign)


def record_outcome(session: Session, flight_id: int, outcome: FlightOutcome) -> None:
    """Record how a running flight ended; of one that is over, only what is known of the safe gains.

    A record is stored, a simulated flight is classified at once, and the next gains are computed. Without a record, the
    trial of a flight that lifted off is lost, and the operator decides about it; otherwise it is planned again. A
    vehicle whose safe gains could not be verified stays grounded until a person releases it. Raises TrajectoryError
    when the record cannot be stored.
    """
    flight = _read(session, flight_id)
    end = outcome.gains_left(outcome.ended if flight.end is None else flight.end, flight.safe_gains)
    if flight.state == FlightState.RUNNING:
        if outcome.record is not None:
            _capture(flight, replace(outcome.record, end=end))
            _end(flight, FlightState.ABORTED if outcome.record.ending == "aborted" else FlightState.LANDED, end)
            proposals.finish_flying(session, flight.campaign)
        elif outcome.lifted_off:
            _lose(session, flight, end)
        else:
            state = FlightState.CANCELLED if outcome.withdrawn else FlightState.FAILED
            _end_unflown(session, flight, state, end)
    flight.end = end
    if outcome.restored is not None:
        flight.restored, flight.restored_at = dict(outcome.restored), utc_now()
        fleet.hold_gains(flight.vehicle, outcome.restored)
    _record_doubts(flight, outcome)


def give_up_flight(session: Session, flight_id: int, outcome: FlightOutcome, problem: str) -> None:
    """End a flight whose outcome cannot be stored: lost if it had lifted off, else not flown."""
    flight = _read(session, flight_id)
    _give_up(session, flight, problem)
    _record_doubts(flight, outcome)


def lose_running_flights(session: Session) -> list[int]:
    """End the flights that were running when the previous worker ended; called at a worker's start.

    Those in the air are lost; the trials of those only staged are planned again. Returns the ids of the lost trials.
    """
    lost = []
    for flight in session.scalars(_WITH_ALL.where(FlightRow.state == FlightState.RUNNING)).all():
        when = "during the flight" if flight.trial.state == TrialState.FLYING else "before lift-off"
        if _give_up(session, flight, f"the worker stopped {when}"):
            lost.append(flight.trial_id)
    return lost


def recover_record(session: Session, flight_id: int, record: FlightRecord) -> None:
    """Store the record of a flight that had been given up as lost. Idempotent.

    Raises TrajectoryError when it cannot be stored.
    """
    flight = _read(session, flight_id)
    if flight.trial.state != TrialState.LOST:
        return
    _capture(flight, record)
    proposals.history_changed(session, flight.campaign)


def _lose(session: Session, flight: FlightRow, end: FlightEnd) -> None:
    """Record that it is unknown how the flight ended."""
    set_trial_state(flight.trial, TrialState.LOST, reason="")
    flight.trial.end = end
    _end(flight, FlightState.LOST, end)
    fleet.doubt_gains(flight.vehicle)
    proposals.finish_flying(session, flight.campaign)


def _end_unflown(session: Session, flight: FlightRow, state: FlightState, end: FlightEnd) -> None:
    was_flying = flight.trial.state == TrialState.FLYING
    if flight.trial.state in {TrialState.STAGED, TrialState.FLYING}:
        set_trial_state(flight.trial, TrialState.PLANNED, reason="")
        flight.trial.end, flight.trial.flown_at = end, None
    _end(flight, state, end)
    if was_flying:
        proposals.finish_flying(session, flight.campaign)


def _give_up(session: Session, flight: FlightRow, problem: str) -> bool:
    """End a flight that no more messages will come from. Returns whether it is lost."""
    lifted_off = flight.trial.state == TrialState.FLYING
    if flight.state == FlightState.RUNNING:
        if lifted_off:
            _lose(session, flight, FlightEnd(remarks=(problem,), landed=Landing.UNKNOWN))
        else:
            _end_unflown(session, flight, FlightState.FAILED, not_begun(problem))
    fleet.doubt_gains(flight.vehicle)
    return lifted_off


def _record_doubts(flight: FlightRow, outcome: FlightOutcome) -> None:
    if outcome.concern:
        fleet.set_state_after_flight(flight.vehicle, concern=outcome.concern)
    elif outcome.unheard:
        fleet.doubt_gains(flight.vehicle)


def _capture(flight: FlightRow, record: FlightRecord) -> None:
    capture(flight.trial, record.trajectory, ending=record.ending, end=record.end)
    flight.trial.settings = dict(record.settings)
    flight.battery_v_before = battery_v(record.trajectory, 0)
    flight.battery_v_after = battery_v(record.trajectory, -1)


def _end(flight: FlightRow, state: FlightState, end: FlightEnd) -> None:
    set_flight_state(flight, state, end=end)
    fleet.set_state_after_flight(flight.vehicle)
