"""Queries on vehicles."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.db.models import FlightRow, VehicleRow
from app.errors import NotFoundError


def get_one(session: Session, vehicle_id: int) -> VehicleRow:
    """Raises NotFoundError."""
    if (row := session.get(VehicleRow, vehicle_id)) is None:
        raise NotFoundError("vehicle", vehicle_id)
    return row


def of_kind_or_none(session: Session, kind: str) -> VehicleRow | None:
    return session.scalar(select(VehicleRow).where(VehicleRow.kind == kind))


def page(session: Session, *, after_id: int, limit: int) -> tuple[Sequence[VehicleRow], int]:
    """The vehicles after that id, one more than `limit`, and the number of all."""
    total = session.scalar(select(func.count(VehicleRow.id))) or 0
    wanted = select(VehicleRow).where(VehicleRow.id > after_id).order_by(VehicleRow.id).limit(limit + 1)
    return session.scalars(wanted).all(), total


def flights(session: Session, vehicle_id: int, *, before_id: int | None, limit: int) -> tuple[Sequence[FlightRow], int]:
    """The newest flights before that id, one more than `limit`, and the number of all."""
    wanted = select(FlightRow).where(FlightRow.vehicle_id == vehicle_id)
    total = session.scalar(select(func.count()).select_from(wanted.subquery())) or 0
    if before_id is not None:
        wanted = wanted.where(FlightRow.id < before_id)
    return session.scalars(wanted.order_by(FlightRow.id.desc()).limit(limit + 1)).all(), total
