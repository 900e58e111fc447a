"""Flights in the database, as the worker needs them."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.common.errors import NotFoundError
from app.common.states import FlightState
from app.db.models import FlightRow


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
