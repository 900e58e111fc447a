"""A flight's way through the database, for the worker that carries it out.

    claim_flight → record_staged → record_lift_off → record_landing
                       │                  └→ record_loss
                       ├→ record_failure      (not flown: the vehicle refused, or took other gains)
                       └→ record_withdrawal   (not flown: somebody ended it before lift-off)

give_up_flight serves wherever the flight stands: before lift-off it was not flown, afterwards it is lost.

What the vehicle is asked stands in the flight row before it is sent; what it answers, as soon as it is known.
"""

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import service as campaigns
from app.db.models import FlightRow
from app.db.types import utc_now
from app.errors import ConflictError
from app.fleet import service as fleet
from app.fleet.states import VehicleState
from app.trials import repository
from app.trials.capture import capture
from app.trials.lifecycle import move_flight, move_trial
from app.trials.states import FlightState, TrialState
from app.vehicles.base import FlightRecord, OptionValue

BEGINS_WITHIN: Final = timedelta(seconds=10)
"""How old a request may be when a worker takes it."""

_WORKER_ENDED: Final = {True: "the worker ended while it flew", False: "the worker ended before lift-off"}
_NOT_VERIFIED: Final = "whoever had it ended before its safe gains were read back, so nobody knows which gains it holds"


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightTask:
    """Everything that a worker needs for one flight, apart from the database."""

    flight_id: int
    trial_id: int
    campaign_id: int
    experiment: str
    vehicle_kind: str
    vehicle_options: dict[str, OptionValue]
    safe_gains: dict[str, float]
    gains: dict[str, float]
    seed: int
    speed: float | None


def claim_flight(session: Session, worker: str) -> FlightTask | None:
    """The flight that has waited longest, now this worker's; None when none waits.

    A flight begins when its operator expects it or not at all: one that could not be begun at once is withdrawn.
    """
    while (flight := repository.first_requested(session)) is not None:
        if utc_now() - flight.requested_at <= BEGINS_WITHIN:
            return _claimed(session, flight, worker)
        _withdraw(flight, f"it could not be begun within {BEGINS_WITHIN.total_seconds():g} s")
    return None


def withdraw_requested_flights(session: Session, reason: str) -> list[int]:
    """At a worker's start: nothing takes off that was asked for while there was nobody to fly it. Gives their ids."""
    withdrawn: list[int] = []
    while (flight := repository.first_requested(session)) is not None:
        _withdraw(flight, reason)
        withdrawn.append(flight.id)
    return withdrawn


def _withdraw(flight: FlightRow, reason: str) -> None:
    move_flight(flight, FlightState.CANCELLED, problem=f"It was not flown: {reason}. Ask again if it is still wanted.")


def _claimed(session: Session, flight: FlightRow, worker: str) -> FlightTask:
    move_flight(flight, FlightState.RUNNING)
    flight.worker, flight.claimed_at = worker, utc_now()
    trial, campaign = flight.trial, campaigns.get_row(session, flight.campaign_id)
    return FlightTask(
        flight_id=flight.id,
        trial_id=trial.id,
        campaign_id=campaign.id,
        experiment=campaign.experiment,
        vehicle_kind=flight.vehicle.kind,
        vehicle_options=dict(campaign.vehicle_options),
        safe_gains=dict(flight.vehicle.safe_gains),
        gains=dict(flight.gains),
        seed=trial.seed,
        speed=flight.speed,
    )


def record_staged(session: Session, flight_id: int, read_back: dict[str, float]) -> None:
    """The vehicle has answered with the gains that it holds. Raises ConflictError when the trial was cancelled."""
    flight = _running(session, flight_id)
    flight.read_back = flight.trial.read_back = read_back
    move_trial(flight.trial, TrialState.STAGED)
    fleet.move_vehicle(flight.vehicle, VehicleState.STAGED)


def record_lift_off(session: Session, flight_id: int) -> None:
    """The vehicle is about to be told to take off; from here on only a landing or a loss can follow.

    Raises ConflictError when the trial was cancelled, or when the gains read back are not the trial's.
    """
    flight = _running(session, flight_id)
    trial = flight.trial
    if trial.read_back != trial.gains:
        raise ConflictError(
            f"Trial {trial.number} must not fly: the vehicle holds {trial.read_back}.",
            hint="Stage it again; if it happens again, look at the vehicle's link.",
        )
    move_trial(trial, TrialState.FLYING, reason="")
    trial.flown_at = utc_now()
    fleet.move_vehicle(flight.vehicle, VehicleState.FLYING)
    campaigns.begin_flying(campaigns.get_row(session, trial.campaign_id))


def record_landing(session: Session, flight_id: int, record: FlightRecord) -> None:
    """Store the record, class the flight (a simulated one at once), and have the next gains computed.

    Doing it twice is harmless. Raises TrajectoryError when the record cannot be stored.
    """
    flight = repository.get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    aborted = record.ending == "aborted"
    campaign = campaigns.get_row(session, flight.campaign_id)
    capture(session, campaign, flight.trial, record.trajectory, aborted=record.reason or "aborted" if aborted else None)
    flight.trial.settings = dict(record.settings)
    _end(flight, FlightState.ABORTED if aborted else FlightState.LANDED, problem=record.reason)
    campaigns.end_flying(session, campaign)


def record_loss(session: Session, flight_id: int, problem: str) -> None:
    """Nobody knows how the flight ended. A real vehicle is quarantined; the operator decides what becomes of it."""
    flight = repository.get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    move_trial(flight.trial, TrialState.LOST, reason=problem)
    _end(flight, FlightState.LOST, problem=problem)
    doubt_vehicle(session, flight_id)
    campaigns.end_flying(session, campaigns.get_row(session, flight.campaign_id))


def record_failure(session: Session, flight_id: int, problem: str) -> None:
    """It was not flown: the vehicle could not be opened, refused, or took other gains. The trial is as planned."""
    _not_flown(session, flight_id, FlightState.FAILED, problem)


def record_withdrawal(session: Session, flight_id: int, reason: str) -> None:
    """It was not flown: somebody ended it before lift-off. The trial is as planned."""
    _not_flown(session, flight_id, FlightState.CANCELLED, reason)


def quarantine_vehicle(session: Session, flight_id: int, concern: str) -> None:
    """After a flight whose safe gains could not be verified. The vehicle flies nothing until a person releases it."""
    fleet.settle_vehicle(repository.get_flight(session, flight_id).vehicle, concern=concern)


def doubt_vehicle(session: Session, flight_id: int) -> None:
    """After a flight at whose end nobody said that the safe gains are restored. A real vehicle is quarantined; a
    simulated one starts afresh with every flight."""
    if repository.get_flight(session, flight_id).vehicle.is_real:
        quarantine_vehicle(session, flight_id, _NOT_VERIFIED)


def give_up_flight(session: Session, flight_id: int, problem: str) -> bool:
    """Nothing more is heard of a flight: it is lost, or was not flown if it had not lifted off. Whether it is lost."""
    lifted_off = repository.get_flight(session, flight_id).trial.state == TrialState.FLYING
    if lifted_off:
        record_loss(session, flight_id, problem)
    else:
        record_failure(session, flight_id, problem)
    doubt_vehicle(session, flight_id)
    return lifted_off


def lose_running_flights(session: Session) -> list[int]:
    """At a worker's start: what flew is lost, what was only staged is planned again. Gives the lost trials' ids."""
    return [
        flight.trial_id
        for flight in repository.running(session)
        if give_up_flight(session, flight.id, _WORKER_ENDED[flight.trial.state == TrialState.FLYING])
    ]


def recover_record(session: Session, flight_id: int, record: FlightRecord) -> None:
    """The record of a flight that was given up for lost has been found. Harmless when it is stored already.

    Raises TrajectoryError when it cannot be stored.
    """
    flight = repository.get_flight(session, flight_id)
    if flight.trial.state != TrialState.LOST:
        return
    campaign = campaigns.get_row(session, flight.campaign_id)
    aborted = record.reason or "aborted" if record.ending == "aborted" else None
    capture(session, campaign, flight.trial, record.trajectory, aborted=aborted)
    flight.trial.settings = dict(record.settings)
    campaigns.history_changed(session, campaign)


def _running(session: Session, flight_id: int) -> FlightRow:
    flight = repository.get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        raise ConflictError(f"Flight {flight_id} is {flight.state}, not running.", hint="It must not go on.")
    return flight


def _not_flown(session: Session, flight_id: int, state: FlightState, problem: str) -> None:
    flight = repository.get_flight(session, flight_id)
    if flight.state != FlightState.RUNNING:
        return
    if flight.trial.state == TrialState.STAGED:
        move_trial(flight.trial, TrialState.PLANNED, reason=problem)
    _end(flight, state, problem=problem)


def _end(flight: FlightRow, state: FlightState, *, problem: str = "") -> None:
    move_flight(flight, state, problem=problem)
    fleet.settle_vehicle(flight.vehicle)
