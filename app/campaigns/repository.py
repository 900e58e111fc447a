"""Queries on campaigns and proposals."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

from sqlalchemy import ColumnElement, func, literal, or_, select, tuple_
from sqlalchemy.orm import Session

from app.campaigns.schemas import Sort
from app.common.errors import NotFoundError
from app.common.schemas import Position, instant
from app.common.states import CampaignState
from app.db.models import CampaignRow, ProposalRow, RehearsalRow, VehicleRow
from app.db.types import UtcDateTime
from app.trials import history

_NO_ERROR: Final = 1e300
"""Sort key of campaigns without an error: they come last."""


@dataclass(frozen=True, slots=True)
class _Order:
    """Sort order of a list; `kind` is the type of the value in a cursor."""

    value: ColumnElement[datetime] | ColumnElement[str] | ColumnElement[float] | ColumnElement[int]
    descending: bool
    kind: type[str] | type[float]
    is_time: bool = False


_ORDERS: Final[Mapping[Sort, _Order]] = {
    Sort.NEWEST: _Order(CampaignRow.id.expression, True, float),
    Sort.OLDEST: _Order(CampaignRow.id.expression, False, float),
    Sort.LATELY_CHANGED: _Order(CampaignRow.updated_at.expression, True, str, is_time=True),
    Sort.NAME: _Order(func.lower(CampaignRow.name), False, str),
    Sort.BEST_ERROR: _Order(func.coalesce(history.BEST_ERROR, _NO_ERROR), False, float),
}


def cursor_kind(sort: Sort) -> type[str] | type[float]:
    return _ORDERS[sort].kind


def get_one(session: Session, campaign_id: int) -> CampaignRow:
    """The campaign with that id. Raises NotFoundError."""
    if (row := session.get(CampaignRow, campaign_id)) is None:
        raise NotFoundError("campaign", campaign_id)
    return row


def ids_of_name(session: Session, name: str) -> list[int]:
    """Ids of all campaigns of that name, ignoring case, oldest first."""
    same = or_(CampaignRow.name == name, func.lower(CampaignRow.name) == name.lower())
    return list(session.scalars(select(CampaignRow.id).where(same).order_by(CampaignRow.id).limit(20)))


def page(
    session: Session,
    *,
    search: str,
    states: Collection[CampaignState],
    vehicles: Collection[str],
    sort: Sort,
    after: Position | None,
    limit: int,
) -> tuple[list[tuple[CampaignRow, Position]], int]:
    """The next `limit` + 1 campaigns after that position, each with its own position; and the total count."""
    wanted = _filters(search, states, vehicles)
    total = session.scalar(select(func.count(CampaignRow.id)).join(CampaignRow.vehicle).where(*wanted)) or 0
    order = _ORDERS[sort]
    if after is not None:
        value = literal(instant(after[0]), UtcDateTime()) if order.is_time else literal(after[0])
        here, there = tuple_(order.value, CampaignRow.id), tuple_(value, literal(after[1]))
        wanted.append(here < there if order.descending else here > there)
    directed = (order.value.desc(), CampaignRow.id.desc()) if order.descending else (order.value, CampaignRow.id)
    found = session.execute(
        select(CampaignRow, order.value).join(CampaignRow.vehicle).where(*wanted).order_by(*directed).limit(limit + 1)
    ).all()
    return [(row, (_in_cursor(value), row.id)) for row, value in found], total


def _in_cursor(value: object) -> str | float:
    if isinstance(value, datetime):
        return value.isoformat()
    return value if isinstance(value, int | float) else str(value)


def _filters(search: str, states: Collection[CampaignState], vehicles: Collection[str]) -> list[ColumnElement[bool]]:
    return [
        *([CampaignRow.name.icontains(search, autoescape=True)] if search else []),
        *([CampaignRow.state.in_(states)] if states else []),
        *([VehicleRow.kind.in_(vehicles)] if vehicles else []),
    ]


def unflown_on(session: Session, vehicle_id: int) -> Sequence[CampaignRow]:
    """The vehicle's campaigns that have not flown."""
    return session.scalars(
        select(CampaignRow).where(CampaignRow.vehicle_id == vehicle_id, CampaignRow.definition_digest.is_(None))
    ).all()


def rehearsals(session: Session, campaign_id: int) -> Sequence[CampaignRow]:
    """The campaigns that rehearse this one, newest first."""
    joined = select(CampaignRow).join(RehearsalRow, RehearsalRow.rehearsal_id == CampaignRow.id)
    return session.scalars(joined.where(RehearsalRow.campaign_id == campaign_id).order_by(CampaignRow.id.desc())).all()


def rehearsed_id(session: Session, rehearsal_id: int) -> int | None:
    return session.scalar(select(RehearsalRow.campaign_id).where(RehearsalRow.rehearsal_id == rehearsal_id))


def get_proposal_or_none(session: Session, proposal_id: int) -> ProposalRow | None:
    return session.get(ProposalRow, proposal_id)


def proposals_by_id(session: Session, proposal_ids: Collection[int]) -> Mapping[int, ProposalRow]:
    found = session.scalars(select(ProposalRow).where(ProposalRow.id.in_(proposal_ids)))
    return {row.id: row for row in found}


def proposals(session: Session, campaign_id: int) -> Sequence[ProposalRow]:
    return session.scalars(select(ProposalRow).where(ProposalRow.campaign_id == campaign_id)).all()


def latest_proposal(session: Session, campaign_id: int) -> ProposalRow | None:
    return session.scalar(
        select(ProposalRow).where(ProposalRow.campaign_id == campaign_id).order_by(ProposalRow.id.desc()).limit(1)
    )


def of_vehicle(session: Session, vehicle_id: int) -> Sequence[CampaignRow]:
    """The vehicle's campaigns, oldest first."""
    return session.scalars(
        select(CampaignRow).where(CampaignRow.vehicle_id == vehicle_id).order_by(CampaignRow.id)
    ).all()
