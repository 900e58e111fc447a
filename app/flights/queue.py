"""States of a flight in the database, as the worker that carries it out records them.

    claim_flight → record_staged → record_lift_off → record_landing
                       │                  ├→ record_loss
                       │                  └→ record_failure   (no take-off command was sent: it would not arm)
                       ├→ record_failure      (not flown: the vehicle refused, or read back other gains)
                       └→ record_withdrawal   (not flown: it was ended before lift-off)

A flight of mode `stage` waits between record_staged and record_lift_off, for `take_off_wanted` or `stand_down_wanted`.
`record_restored` records that the safe gains were read back, whatever came before. `give_up_flight` may be called at
any stage: before lift-off the flight was not flown, after it the flight is lost.

What is sent to the vehicle is stored in the flight row before it is sent; what the vehicle answers, as soon as it is
known.
"""

from collections.abc import Mapping, Sequence
from datetime import timedelta
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.campaigns import proposals
from app.campaigns import service as campaigns
from app.campaigns.history import set_flight_state, set_trial_state
from app.campaigns.trials.records import capture
from app.common.errors import ConflictError, NotFoundError
from app.common.states import FlightState, TrialState, VehicleState
from app.core.tuning.stop_rules import landing_battery_v, starting_battery_v
from app.db.models import CampaignRow, FlightRow
from app.db.types import utc_now
from app.fleet import service as fleet
from app.flights.process_messages import FlightRequest
from app.vehicles.base import FlightRecord


def get_flight(session: Session, flight_id: int) -> FlightRow:
    """Raises NotFoundError."""
    if (row := session.get(FlightRow, flight_id)) is None:
        raise NotFoundError("flight", flight_id)
    return row


def first_requested(session: Session) -> FlightRow | None:
    """The oldest requested flight."""
    return session.scalar(
        select(FlightRow).where(FlightRow.state == FlightState.REQUESTED).order_by(FlightRow.id).limit(1)
    )


def running(session: Session) -> Sequence[FlightRow]:
    return session.scalars(select(FlightRow).where(FlightRow.state == FlightState.RUNNING).order_by(FlightRow.id)).all()


REQUEST_TIMEOUT: Final = timedelta(seconds=10)
"""Maximum age of a request when a worker claims it."""

_WORKER_ENDED: Final = {True: "the worker stopped during the flight", False: "the worker stopped before lift-off"}
_NOT_VERIFIED: Final = "its process ended before the safe gains were read back; the gains on the vehicle are unknown"


def claim_flight(session: Session, worker: str) -> FlightRequest | None:
    """Claim the oldest requested flight for this worker; None when there is none.

    A flight must begin when its operator expects it: a request older than REQUEST_TIMEOUT is withdrawn.
    """
    while (flight := first_requested(session)) is not None:
        if utc_now() - flight.requested_at <= REQUEST_TIMEOUT:
            return _claimed(session, flight, worker)
        _withdraw(flight, f"it could not be started within {REQUEST_TIMEOUT.total_seconds():g} s")
    return None


def withdraw_requested_flights(session: Session, reason: str) -> list[int]:
    """Withdraw all requested flights at a worker's start, because nothing may take off that was requested while no
    worker ran. Returns their ids."""
    withdrawn: list[int] = []
    while (flight := first_requested(session)) is not None:
        _withdraw(flight, reason)
        withdrawn.append(flight.id)
    return withdrawn


def _withdraw(flight: FlightRow, reason: str) -> None:
    set_flight_state(
        flight, FlightState.CANCELLED, problem=f"It was not flown: {reason}. Request it again if it is still needed."
    )


def _claimed(session: Session, flight: FlightRow, worker: str) -> FlightRequest:
    set_flight_state(flight, FlightState.RUNNING)
    flight.worker, flight.claimed_at = worker, utc_now()
    trial, campaign = flight.trial, campaigns.get_row(session, flight.campaign_id)
    flight.safe_gains = dict(flight.vehicle.safe_gains)
    return FlightRequest(
        flight_id=flight.id,
        trial_id=trial.id,
        campaign_id=campaign.id,
        experiment=campaign.experiment,
        vehicle_id=flight.vehicle_id,
        vehicle_kind=flight.vehicle.kind,
        vehicle_options=fleet.options_of(campaign),
        safe_gains=dict(flight.safe_gains),
        gains=dict(flight.gains),
        seed=trial.seed,
        speed=flight.speed,
        mode=flight.mode,
    )


def record_staged(session: Session, flight_id: int, read_back: dict[str, float]) -> None:
    """Record the gains that the vehicle read back. Raises ConflictError when the trial was cancelled."""
    flight = _running(session, flight_id)
    flight.read_back = flight.trial.read_back = read_back
    fleet.hold_gains(flight.vehicle, read_back)
    set_trial_state(flight.trial, TrialState.STAGED)
    fleet.set_vehicle_state(flight.vehicle, VehicleState.STAGED)


def take_off_wanted(session: Session, flight_id: int) -> bool:
    """Whether the operator of a staged flight has requested its take-off within REQUEST_TIMEOUT (10 s).

    Nothing takes off later than its operator expects. False also for a flight that is to stand down or is not running.
    """
    flight = get_flight(session, flight_id)
    return _may_take_off(flight) and stand_down_wanted(session, flight_id) is None


def stand_down_wanted(session: Session, flight_id: int) -> str | None:
    """Why a staged flight must not take place; None while it may.

    Reasons: it was unstaged, its trial was cancelled, or its take-off was requested and could not begin in time. The
    worker then restores the safe gains and calls `record_withdrawal` with this reason.
    """
    flight = get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return f"the flight is {flight.state}"
    if flight.stand_down:
        return flight.stand_down
    if flight.trial.state not in {TrialState.PLANNED, TrialState.STAGED}:
        return f"the trial is {flight.trial.state}"
    if flight.mode == "stage" and flight.take_off_at is not None and not _may_take_off(flight):
        return f"the take-off did not start within {REQUEST_TIMEOUT.total_seconds():g} s of the operator's request"
    return None


def _may_take_off(flight: FlightRow) -> bool:
    if flight.mode == "fly":
        return not fleet.needs_staging(flight.vehicle)
    return flight.take_off_at is not None and utc_now() - flight.take_off_at <= REQUEST_TIMEOUT


def record_lift_off(session: Session, flight_id: int) -> None:
    """Record that the take-off command is about to be sent.

    After this the flight lands, is lost, or fails because the command was not sent after all. Raises ConflictError when
    the trial was cancelled or unstaged, when the gains read back are not the trial's, or when the operator of a staged
    flight has not requested the take-off.
    """
    flight = _running(session, flight_id)
    trial = flight.trial
    if not take_off_wanted(session, flight_id):
        why = stand_down_wanted(session, flight_id) or "its take-off has not been requested"
        raise ConflictError(f"Trial {trial.number} must not fly: {why}.", hint="Stage it again if it is still needed.")
    if trial.read_back != trial.gains:
        raise ConflictError(
            f"Trial {trial.number} must not fly: the vehicle has the gains {trial.read_back}.",
            hint="Stage it again. If this happens again, check the vehicle's link.",
        )
    set_trial_state(trial, TrialState.FLYING, reason="")
    trial.flown_at = utc_now()
    fleet.set_vehicle_state(flight.vehicle, VehicleState.FLYING)
    proposals.start_flying(campaigns.get_row(session, trial.campaign_id))


def record_landing(session: Session, flight_id: int, record: FlightRecord) -> None:
    """Store the record, classify the flight (a simulated one at once), and have the next gains computed.

    Idempotent. Raises TrajectoryError when the record cannot be stored.
    """
    flight = get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    campaign = campaigns.get_row(session, flight.campaign_id)
    _capture(session, campaign, flight, record)
    aborted = record.ending == "aborted"
    _end(flight, FlightState.ABORTED if aborted else FlightState.LANDED, problem=record.reason)
    proposals.finish_flying(session, campaign)


def record_loss(session: Session, flight_id: int, problem: str) -> None:
    """Record that it is unknown how the flight ended. A real vehicle is quarantined; the operator decides about it."""
    flight = get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    set_trial_state(flight.trial, TrialState.LOST, reason=problem)
    _end(flight, FlightState.LOST, problem=problem)
    doubt_vehicle(session, flight_id)
    proposals.finish_flying(session, campaigns.get_row(session, flight.campaign_id))


def record_failure(session: Session, flight_id: int, problem: str) -> None:
    """Record that the flight did not take place; its trial is planned again.

    The vehicle could not be opened, refused, read back other gains, or was sent no take-off command.
    """
    _not_flown(session, flight_id, FlightState.FAILED, problem)


def record_withdrawal(session: Session, flight_id: int, reason: str) -> None:
    """Record that the flight was ended before lift-off; its trial is planned again."""
    _not_flown(session, flight_id, FlightState.CANCELLED, reason)


def quarantine_vehicle(session: Session, flight_id: int, concern: str) -> None:
    """Quarantine the vehicle after a flight whose safe gains could not be verified; it stays grounded until a person
    releases it."""
    fleet.set_state_after_flight(get_flight(session, flight_id).vehicle, concern=concern)


def doubt_vehicle(session: Session, flight_id: int) -> None:
    """Quarantine a real vehicle after a flight that ended without a report that the safe gains are restored.

    A simulated vehicle starts afresh with every flight.
    """
    if get_flight(session, flight_id).vehicle.is_real:
        quarantine_vehicle(session, flight_id, _NOT_VERIFIED)


def record_restored(session: Session, flight_id: int, held: Mapping[str, float]) -> None:
    """Record the safe gains that the vehicle read back after a flight, however the flight ended."""
    flight = get_flight(session, flight_id)
    flight.restored, flight.restored_at = dict(held), utc_now()
    fleet.hold_gains(flight.vehicle, held)


def give_up_flight(session: Session, flight_id: int, problem: str) -> bool:
    """End a flight that no more messages will come from: lost if it had lifted off, else not flown.

    Returns whether it is lost.
    """
    lifted_off = get_flight(session, flight_id).trial.state == TrialState.FLYING
    if lifted_off:
        record_loss(session, flight_id, problem)
    else:
        record_failure(session, flight_id, problem)
    doubt_vehicle(session, flight_id)
    return lifted_off


def lose_running_flights(session: Session) -> list[int]:
    """End the flights that were running when the previous worker ended; called at a worker's start.

    Those in the air are lost; the trials of those only staged are planned again. Returns the ids of the lost trials.
    """
    return [
        flight.trial_id
        for flight in running(session)
        if give_up_flight(session, flight.id, _WORKER_ENDED[flight.trial.state == TrialState.FLYING])
    ]


def recover_record(session: Session, flight_id: int, record: FlightRecord) -> None:
    """Store the record of a flight that had been given up as lost. Idempotent.

    Raises TrajectoryError when it cannot be stored.
    """
    flight = get_flight(session, flight_id)
    if flight.trial.state != TrialState.LOST:
        return
    campaign = campaigns.get_row(session, flight.campaign_id)
    _capture(session, campaign, flight, record)
    proposals.history_changed(session, campaign)


def _capture(session: Session, campaign: CampaignRow, flight: FlightRow, record: FlightRecord) -> None:
    capture(
        session,
        campaign,
        flight.trial,
        record.trajectory,
        ending=record.ending,
        reason=record.reason,
        on_request=record.on_request,
    )
    flight.trial.settings = dict(record.settings)
    flight.battery_v_before = starting_battery_v(record.trajectory)
    flight.battery_v_after = landing_battery_v(record.trajectory)


def _running(session: Session, flight_id: int) -> FlightRow:
    flight = get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        raise ConflictError(f"Flight {flight_id} is {flight.state}, not running.", hint="It must not continue.")
    return flight


def _not_flown(session: Session, flight_id: int, state: FlightState, problem: str) -> None:
    flight = get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    was_flying = flight.trial.state == TrialState.FLYING
    if flight.trial.state in {TrialState.STAGED, TrialState.FLYING}:
        set_trial_state(flight.trial, TrialState.PLANNED, reason=problem)
        flight.trial.flown_at = None
    _end(flight, state, problem=problem)
    if was_flying:
        proposals.finish_flying(session, campaigns.get_row(session, flight.campaign_id))


def _end(flight: FlightRow, state: FlightState, *, problem: str = "") -> None:
    set_flight_state(flight, state, problem=problem)
    fleet.set_state_after_flight(flight.vehicle)
