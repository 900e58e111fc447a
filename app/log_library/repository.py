"""Queries on analysed logs, and on the vehicles that they are kept for."""

from collections.abc import Sequence
from datetime import datetime
from typing import Final

from sqlalchemy import Select, delete, func, or_, select, tuple_
from sqlalchemy.orm import Session, joinedload, undefer

from app.db.base import existing
from app.db.models import AnalysedLogRow, LogFileRow, LoggedVehicleRow
from app.db.pages import Order

NEWEST_FIRST: Final = Order("flown", AnalysedLogRow.ordered_at.expression, descending=True)


def get_log(session: Session, log_id: int) -> AnalysedLogRow:
    """The log with that id. Raises NotFoundError."""
    return existing(session, AnalysedLogRow, log_id, "log")


def log_with_answer(session: Session, log_id: int) -> AnalysedLogRow:
    """The same with its answer and its flight loaded."""
    get_log(session, log_id)
    wanted = select(AnalysedLogRow).where(AnalysedLogRow.id == log_id)
    wanted = wanted.options(undefer(AnalysedLogRow.answer), undefer(AnalysedLogRow.flight))
    return session.scalars(wanted.execution_options(populate_existing=True)).one()


def of_digest_or_none(session: Session, digest: str) -> AnalysedLogRow | None:
    return session.scalar(select(AnalysedLogRow).where(AnalysedLogRow.digest == digest))


def logs(vehicle_id: int | None, *, kept: bool) -> Select[AnalysedLogRow]:
    """Logs that are kept, of one vehicle or all; or those that are not."""
    wanted = select(AnalysedLogRow).options(joinedload(AnalysedLogRow.vehicle))
    wanted = wanted.where(AnalysedLogRow.vehicle_id.is_not(None) if kept else AnalysedLogRow.vehicle_id.is_(None))
    return wanted if vehicle_id is None else wanted.where(AnalysedLogRow.vehicle_id == vehicle_id)


def logs_of(session: Session, vehicle_id: int) -> Sequence[AnalysedLogRow]:
    """The logs of a vehicle, oldest first."""
    order = AnalysedLogRow.ordered_at, AnalysedLogRow.id
    return session.scalars(logs(vehicle_id, kept=True).order_by(*order)).all()


def log_before(session: Session, row: AnalysedLogRow) -> int | None:
    """Id of the log before it of the same vehicle; None if there is none, or it is not kept."""
    here = tuple_(AnalysedLogRow.ordered_at, AnalysedLogRow.id) < tuple_(row.ordered_at, row.id)
    kept = AnalysedLogRow.vehicle_id.is_not(None)  # where the vehicle of the row is NULL, so are those of the others
    wanted = select(AnalysedLogRow.id).where(AnalysedLogRow.vehicle_id == row.vehicle_id, kept, here)
    return session.scalar(wanted.order_by(AnalysedLogRow.ordered_at.desc(), AnalysedLogRow.id.desc()).limit(1))


def delete_analysed_before(session: Session, time: datetime) -> None:
    """Delete the logs that were analysed before that and are not kept."""
    unkept = AnalysedLogRow.vehicle_id.is_(None), AnalysedLogRow.analysed_at < time
    session.execute(delete(AnalysedLogRow).where(*unkept))


def get_vehicle(session: Session, vehicle_id: int) -> LoggedVehicleRow:
    """The vehicle with that id. Raises NotFoundError."""
    return existing(session, LoggedVehicleRow, vehicle_id, "vehicle of logs")


def vehicle_of_hardware_or_none(session: Session, hardware_id: str) -> LoggedVehicleRow | None:
    return session.scalar(select(LoggedVehicleRow).where(LoggedVehicleRow.hardware_id == hardware_id))


def vehicle_of_name_or_none(session: Session, name: str) -> LoggedVehicleRow | None:
    """The vehicle of that name, ignoring the case of ASCII letters, as SQLite does."""
    is_named = or_(LoggedVehicleRow.name == name, func.lower(LoggedVehicleRow.name) == name.lower())
    return session.scalar(select(LoggedVehicleRow).where(is_named).limit(1))


def vehicles(session: Session) -> Sequence[tuple[LoggedVehicleRow, int, AnalysedLogRow]]:
    """Every vehicle with the number of its logs and the newest of them, by that."""
    place = func.row_number().over(
        partition_by=AnalysedLogRow.vehicle_id, order_by=(AnalysedLogRow.ordered_at.desc(), AnalysedLogRow.id.desc())
    )
    number = func.count().over(partition_by=AnalysedLogRow.vehicle_id)
    ranked = select(AnalysedLogRow.id, place.label("place"), number.label("number")).subquery()
    wanted = (
        select(LoggedVehicleRow, ranked.c.number, AnalysedLogRow)
        .join(AnalysedLogRow, AnalysedLogRow.vehicle_id == LoggedVehicleRow.id)
        .join(ranked, (ranked.c.id == AnalysedLogRow.id) & (ranked.c.place == 1))
        .order_by(AnalysedLogRow.ordered_at.desc(), LoggedVehicleRow.id)
    )
    return [(vehicle, count, newest) for vehicle, count, newest in session.execute(wanted).all()]


def get_file(session: Session, log_id: int) -> LogFileRow:
    """The stored file of a log with its companion. Raises NotFoundError."""
    return existing(session, LogFileRow, log_id, "file of log")


def stored_bytes(session: Session) -> int:
    """Size of all stored files."""
    return session.scalar(select(func.sum(AnalysedLogRow.file_bytes))) or 0
