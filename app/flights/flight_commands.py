"""Entries in a registered vehicle's log of commands for what was asked of its flights."""

from sqlalchemy.orm import Session

from app.campaigns import history
from app.common.states import ActKind
from app.db.models import FlightRow
from app.fleet.control import record_act
from app.vehicles.flight_end import StopRequest, request_text


def record_flight_command(session: Session, flight: FlightRow, kind: ActKind, *, by: str, reason: str = "") -> None:
    """Record a command to the vehicle of a flight, which has its outcome; `by` is the operator in control, empty if the
    request came from elsewhere. Shared simulations have no log."""
    if flight.vehicle.registered:
        named = f"flight {flight.trial.number} of {flight.campaign.name}"
        record_act(
            session,
            flight.vehicle,
            kind,
            by=by,
            reason=f"{named}: {reason}" if reason else named,
            result={"flight_id": flight.id},
        )


def record_abort(session: Session, trial_id: int, request: StopRequest) -> None:
    """Record an abort, which everyone may request. Raises NotFoundError."""
    history.trial_row(session, trial_id)
    if (flight := history.latest_flights(session, [trial_id]).get(trial_id)) is not None:
        record_flight_command(session, flight, ActKind.ABORT, by="", reason=request_text(request))
