"""Queries on vehicles, their acts and their flights."""

from collections.abc import Iterable, Sequence
from datetime import datetime
from typing import Any, Final, TypeVar

from sqlalchemy import Select, String, and_, delete, func, literal, null, or_, select, union_all
from sqlalchemy.orm import Bundle, Session

from app.common.states import (
    ACTIVE_ACT_STATES,
    ACTIVE_FLIGHT_STATES,
    FLOWN_FLIGHT_STATES,
    GIVES_GAINS,
    ActState,
    VehicleState,
)
from app.db.base import existing
from app.db.models import CampaignRow, FlightRow, TrialRow, VehicleActRow, VehicleRow
from app.db.pages import Order

RESTORE_AFTER_FLIGHT: Final = "restore after flight"

T = TypeVar("T", FlightRow, VehicleActRow)


def get_one(session: Session, vehicle_id: int) -> VehicleRow:
    """The vehicle with that id. Raises NotFoundError."""
    return existing(session, VehicleRow, vehicle_id, "vehicle")


def shared_of_kind_or_none(session: Session, kind: str) -> VehicleRow | None:
    """The vehicle that campaigns share; placeholders for vehicles elsewhere are distinguished by their options."""
    rows = session.scalars(select(VehicleRow).where(VehicleRow.kind == kind, VehicleRow.registered.is_(False)))
    return next((row for row in rows if not row.options), None)


def of_name_or_none(session: Session, name: str) -> VehicleRow | None:
    """The vehicle of that name, ignoring case."""
    return session.scalar(select(VehicleRow).where(func.lower(VehicleRow.name) == name.lower()).limit(1))


def registered_in(session: Session, *states: VehicleState) -> Sequence[VehicleRow]:
    """Registered vehicles in those states."""
    wanted = select(VehicleRow).where(VehicleRow.registered.is_(True), VehicleRow.state.in_(states))
    return session.scalars(wanted.order_by(VehicleRow.id)).all()


def flight_under_way(session: Session, vehicle_id: int) -> FlightRow | None:
    return session.scalar(
        select(FlightRow).where(FlightRow.vehicle_id == vehicle_id, FlightRow.state.in_(ACTIVE_FLIGHT_STATES))
    )


def get_act(session: Session, act_id: int) -> VehicleActRow:
    """The act with that id. Raises NotFoundError."""
    return existing(session, VehicleActRow, act_id, "act")


def act_under_way(session: Session, vehicle_id: int) -> VehicleActRow | None:
    return session.scalar(acts_of(vehicle_id).where(VehicleActRow.state.in_(ACTIVE_ACT_STATES)))


def acts_under_way(session: Session) -> Sequence[VehicleActRow]:
    return session.scalars(select(VehicleActRow).where(VehicleActRow.state.in_(ACTIVE_ACT_STATES))).all()


def first_requested_act(session: Session) -> VehicleActRow | None:
    """The oldest requested act."""
    wanted = select(VehicleActRow).where(VehicleActRow.state == ActState.REQUESTED)
    return session.scalar(wanted.order_by(VehicleActRow.id).limit(1))


def acts_of(vehicle_id: int) -> Select[VehicleActRow]:
    return select(VehicleActRow).where(VehicleActRow.vehicle_id == vehicle_id)


def ledger(vehicle_id: int) -> tuple[Select[Any], Order]:
    """The lines of the ledger, each with its `kind` and an `id`, half of which is that of its flight or act; and
    their order, newest first.

    A flight is a line from its request on, and another one once the safe gains were restored after it, or it ended
    without that although its gains were on the vehicle. A connection that wrote nothing is a line if it read gains.
    """
    flight = FlightRow.vehicle_id == vehicle_id
    is_left_with_its_gains = and_(
        FlightRow.finished_at.is_not(null()),
        FlightRow.read_back.is_not(null()),
        FlightRow.safe_gains.is_not(null()),
        FlightRow.vehicle.has(VehicleRow.registered),
    )
    lines = union_all(
        select(
            FlightRow.requested_at.label("at"), (2 * FlightRow.id).label("id"), literal("flight", String).label("kind")
        ).where(flight),
        select(
            func.coalesce(FlightRow.restored_at, FlightRow.finished_at),
            2 * FlightRow.id + 1,
            literal(RESTORE_AFTER_FLIGHT, String),
        ).where(flight, or_(FlightRow.restored_at.is_not(null()), is_left_with_its_gains)),
        select(VehicleActRow.requested_at, 2 * VehicleActRow.id, VehicleActRow.kind.cast(String)).where(
            VehicleActRow.vehicle_id == vehicle_id,
            VehicleActRow.kind.in_(GIVES_GAINS),
            VehicleActRow.claimed_at.is_not(null()),
            or_(VehicleActRow.asked.is_not(null()), VehicleActRow.read_back.is_not(null())),
        ),
    ).subquery()
    return select(Bundle("line", lines.c.id, lines.c.kind)), Order("-at", lines.c.at, descending=True)


def rows_by_id(session: Session, kind: type[T], ids: Iterable[int]) -> dict[int, T]:
    return {row.id: row for row in session.scalars(select(kind).where(kind.id.in_(ids)))}


def campaign_names(session: Session, vehicle_id: int) -> Sequence[str]:
    """Names of the campaigns that use the vehicle, oldest first."""
    wanted = select(CampaignRow.name).where(CampaignRow.vehicle_id == vehicle_id)
    return session.scalars(wanted.order_by(CampaignRow.id)).all()


def delete_acts(session: Session, vehicle_id: int) -> None:
    session.execute(delete(VehicleActRow).where(VehicleActRow.vehicle_id == vehicle_id))


def flights_of(session: Session, vehicle_id: int) -> Sequence[FlightRow]:
    """Flights that lifted off and have ended, oldest first."""
    wanted = select(FlightRow).where(FlightRow.vehicle_id == vehicle_id, FlightRow.state.in_(FLOWN_FLIGHT_STATES))
    return session.scalars(wanted.order_by(FlightRow.id)).all()


def has_taken_off(session: Session, vehicle_id: int, *, since: datetime) -> bool:
    """Whether a flight of the vehicle took off after that time, and was not found unflown."""
    flown = select(FlightRow.id).join(TrialRow).where(FlightRow.vehicle_id == vehicle_id, TrialRow.flown_at > since)
    return session.scalar(flown.limit(1)) is not None
