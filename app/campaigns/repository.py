"""Queries on campaigns, proposals, trials and flights."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

from sqlalchemy import ColumnElement, Select, String, delete, func, or_, select, union_all
from sqlalchemy.orm import Session, defer, joinedload

from app.campaigns.schemas import Sort
from app.common.states import CampaignState, TrialState
from app.db.base import OptionsJson, existing
from app.db.models import (
    CampaignRow,
    FlightRow,
    ProposalRow,
    RehearsalRow,
    TrajectoryRow,
    TrialPhotoRow,
    TrialRow,
    VehicleRow,
)
from app.db.pages import Order

BEST_ERROR: Final = (
    select(func.min(TrialRow.error))
    .where(TrialRow.campaign_id == CampaignRow.id, TrialRow.state == TrialState.VALID)
    .correlate(CampaignRow)
    .scalar_subquery()
)
"""Lowest error of a campaign's valid trials, as an SQL expression on the campaign's row."""


def checksums(session: Session, campaign_id: int) -> Mapping[int, str]:
    """Checksums of the trials' records, by trial id."""
    wanted = select(TrialRow.id, TrajectoryRow.checksum).join(TrialRow.trajectory)
    return dict(session.execute(wanted.where(TrialRow.campaign_id == campaign_id)).all())


def settings(session: Session, trial_ids: Collection[int]) -> Mapping[int, OptionsJson]:
    """What the vehicles reported of these trials' flights, by trial id."""
    wanted = select(TrialRow.id, TrialRow.settings).where(TrialRow.id.in_(trial_ids))
    return dict(session.execute(wanted).all())


class GatedTrial(NamedTuple):
    """Number and state of a trial; `gate_passed` is false where the gate's refusal of its gains was overruled."""

    number: int
    state: TrialState
    gate_passed: bool


def gated(session: Session, campaign_id: int) -> Sequence[GatedTrial]:
    """The trials of a campaign by number."""
    wanted = select(TrialRow.number, TrialRow.state, TrialRow.gate["passed"].as_boolean())
    found = session.execute(wanted.where(TrialRow.campaign_id == campaign_id).order_by(TrialRow.number))
    return [GatedTrial(number, state, bool(passed)) for number, state, passed in found]


def curves(session: Session, trial_ids: Collection[int]) -> Mapping[int, list[list[float]]]:
    """Coarse curves of those trials that have one, by trial id."""
    wanted = select(TrialRow.id, TrialRow.curve).where(TrialRow.id.in_(trial_ids), TrialRow.curve.is_not(None))
    return {identity: curve for identity, curve in session.execute(wanted) if curve}


def trials_wanted(campaign_id: int) -> Select[TrialRow]:
    """The campaign's trials with the descriptions of their records."""
    return (
        select(TrialRow)
        .where(TrialRow.campaign_id == campaign_id)
        .options(
            defer(TrialRow.curve),
            # This column is stored behind the samples: to read it, SQLite would walk through all their pages.
            joinedload(TrialRow.trajectory).defer(TrajectoryRow.created_at),
        )
    )


def has_claimed_flight(session: Session, campaign_id: int) -> bool:
    """Whether a worker has claimed any flight of the campaign; its vehicle's ledger then refers to it."""
    wanted = select(FlightRow.id).where(FlightRow.campaign_id == campaign_id, FlightRow.claimed_at.is_not(None))
    return session.scalar(wanted.limit(1)) is not None


def delete_unclaimed_flights(session: Session, campaign_id: int) -> None:
    """Delete flights that were requested and withdrawn; nothing was ever sent to a vehicle for them."""
    session.execute(delete(FlightRow).where(FlightRow.campaign_id == campaign_id, FlightRow.claimed_at.is_(None)))


def next_number(session: Session, campaign_id: int) -> int:
    last = session.scalar(select(func.max(TrialRow.number)).where(TrialRow.campaign_id == campaign_id))
    return (last or 0) + 1


def photos_of_trial(session: Session, trial_id: int) -> Sequence[TrialPhotoRow]:
    """Photos without their picture data, in the order in which they were added."""
    return session.scalars(
        select(TrialPhotoRow).where(TrialPhotoRow.trial_id == trial_id).order_by(TrialPhotoRow.id)
    ).all()


def flight_ids(session: Session, trial_ids: Collection[int]) -> Mapping[int, Sequence[int]]:
    """Flight ids of these trials, newest first, by trial id."""
    wanted = select(FlightRow.trial_id, FlightRow.id).where(FlightRow.trial_id.in_(trial_ids))
    found: dict[int, list[int]] = {}
    for trial_id, flight_id in session.execute(wanted.order_by(FlightRow.id.desc())):
        found.setdefault(trial_id, []).append(flight_id)
    return found


_NO_ERROR: Final = 1e300
"""Sort key of campaigns without an error: they come last."""


ORDERS: Final[Mapping[Sort, Order]] = {
    sort: Order(sort, value, descending=sort.startswith("-"))
    for sort, value in (
        (Sort.NEWEST, CampaignRow.id.expression),
        (Sort.OLDEST, CampaignRow.id.expression),
        (Sort.LATELY_CHANGED, CampaignRow.updated_at.expression),
        (Sort.NAME, func.lower(CampaignRow.name, type_=String())),
        (Sort.BEST_ERROR, func.coalesce(BEST_ERROR, _NO_ERROR)),
    )
}


def get_campaign(session: Session, campaign_id: int) -> CampaignRow:
    """The campaign with that id. Raises NotFoundError."""
    return existing(session, CampaignRow, campaign_id, "campaign")


def ids_of_name(session: Session, name: str) -> list[int]:
    """Ids of all campaigns of that name, ignoring case, oldest first."""
    same = or_(CampaignRow.name == name, func.lower(CampaignRow.name) == name.lower())
    return list(session.scalars(select(CampaignRow.id).where(same).order_by(CampaignRow.id).limit(20)))


def names_beginning(session: Session, beginning: str) -> set[str]:
    """Names of all campaigns that begin so."""
    return set(session.scalars(select(CampaignRow.name).where(CampaignRow.name.startswith(beginning, autoescape=True))))


def campaigns_wanted(search: str, states: Collection[CampaignState], vehicles: Collection[str]) -> Select[CampaignRow]:
    """Campaigns whose name contains `search`, in those states, on vehicles of those kinds; of all if empty."""
    wanted: list[ColumnElement[bool]] = [
        *([CampaignRow.name.icontains(search, autoescape=True)] if search else []),
        *([CampaignRow.state.in_(states)] if states else []),
        *([VehicleRow.kind.in_(vehicles)] if vehicles else []),
    ]
    return select(CampaignRow).join(CampaignRow.vehicle).where(*wanted)


def rehearsals(session: Session, campaign_id: int) -> Sequence[CampaignRow]:
    """The campaigns that rehearse this one, newest first."""
    joined = select(CampaignRow).join(RehearsalRow, RehearsalRow.rehearsal_id == CampaignRow.id)
    return session.scalars(joined.where(RehearsalRow.campaign_id == campaign_id).order_by(CampaignRow.id.desc())).all()


def rehearsed_id(session: Session, rehearsal_id: int) -> int | None:
    """The campaign that this one rehearses; None if it is not a rehearsal."""
    return session.scalar(select(RehearsalRow.campaign_id).where(RehearsalRow.rehearsal_id == rehearsal_id))


def rehearsed_ids(session: Session, campaign_ids: Collection[int]) -> Mapping[int, int]:
    """The campaigns that these rehearse, by the id of the rehearsal."""
    wanted = select(RehearsalRow).where(RehearsalRow.rehearsal_id.in_(campaign_ids))
    return {row.rehearsal_id: row.campaign_id for row in session.scalars(wanted)}


def proposals(session: Session, campaign_id: int) -> Sequence[ProposalRow]:
    return session.scalars(select(ProposalRow).where(ProposalRow.campaign_id == campaign_id)).all()


def predicted_curves(session: Session, campaign_id: int) -> Sequence[TrajectoryRow]:
    """The predicted curves of the campaign's proposals, and of its trials that have none."""
    ids = [
        select(table.predicted_id).where(table.campaign_id == campaign_id, table.predicted_id.is_not(None))
        for table in (ProposalRow, TrialRow)
    ]
    return session.scalars(select(TrajectoryRow).where(TrajectoryRow.id.in_(union_all(*ids)))).all()


def latest_proposal(session: Session, campaign_id: int) -> ProposalRow | None:
    return session.scalar(
        select(ProposalRow).where(ProposalRow.campaign_id == campaign_id).order_by(ProposalRow.id.desc()).limit(1)
    )


def of_vehicle(session: Session, vehicle_id: int) -> Sequence[CampaignRow]:
    """The vehicle's campaigns, oldest first."""
    return session.scalars(
        select(CampaignRow).where(CampaignRow.vehicle_id == vehicle_id).order_by(CampaignRow.id)
    ).all()
