"""A flight's way through the database, for the worker that carries it out.

    claim_flight → record_staged → record_lift_off → record_landing
                       │                  └→ record_loss
                       ├→ record_failure      (not flown: the vehicle refused, or took other gains)
                       └→ record_withdrawal   (not flown: somebody ended it before lift-off)

What the vehicle is asked stands in the flight row before it is sent; what it answers, as soon as it is known.
"""

from dataclasses import dataclass

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
    """The flight that has waited longest, now this worker's; None when none waits."""
    if (flight := repository.first_requested(session)) is None:
        return None
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
    concern = "its last flight was lost, so nobody knows which gains it holds" if flight.vehicle.is_real else ""
    _end(flight, FlightState.LOST, problem=problem, concern=concern)
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


def lose_running_flights(session: Session) -> list[int]:
    """At a worker's start: what flew is lost, what was only staged is planned again. Gives the lost trials' ids."""
    lost: list[int] = []
    for flight in repository.running(session):
        if flight.trial.state == TrialState.FLYING:
            record_loss(session, flight.id, "the worker ended while it flew")
            lost.append(flight.trial_id)
        else:
            record_failure(session, flight.id, "the worker ended before lift-off")
    return lost


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


def _end(flight: FlightRow, state: FlightState, *, problem: str = "", concern: str = "") -> None:
    move_flight(flight, state, problem=problem)
    fleet.settle_vehicle(flight.vehicle, concern=concern)
