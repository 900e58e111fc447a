"""Queries on trials, flights and trajectories."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from sqlalchemy import delete, func, select
from sqlalchemy.orm import Session, defer, joinedload

from app.common.errors import NotFoundError
from app.common.states import ACTIVE_FLIGHT_STATES, FlightState, TrialState
from app.db.models import CampaignRow, FlightRow, GainsJson, TrajectoryRow, TrialPhotoRow, TrialRow

BEST_ERROR: Final = (
    select(func.min(TrialRow.error))
    .where(TrialRow.campaign_id == CampaignRow.id, TrialRow.state == TrialState.VALID)
    .correlate(CampaignRow)
    .scalar_subquery()
)
"""Lowest error of a campaign's valid trials, as an SQL expression on the campaign's row."""


def get_one(session: Session, trial_id: int) -> TrialRow:
    """Raises NotFoundError."""
    if (row := session.get(TrialRow, trial_id)) is None:
        raise NotFoundError("trial", trial_id)
    return row


def of_campaigns(session: Session, campaign_ids: Collection[int]) -> Sequence[TrialRow]:
    """Trials of the campaigns, by campaign and number.

    Large columns that are seldom needed for all trials (gate result, curve, settings, read-back gains) are loaded on
    access.
    """
    return session.scalars(
        select(TrialRow)
        .where(TrialRow.campaign_id.in_(campaign_ids))
        .options(*(defer(column) for column in (TrialRow.gate, TrialRow.curve, TrialRow.settings, TrialRow.read_back)))
        .order_by(TrialRow.campaign_id, TrialRow.number)
    ).all()


def checksums(session: Session, campaign_id: int) -> Mapping[int, str]:
    """Checksums of the trials' records, by trial id."""
    wanted = select(TrialRow.id, TrajectoryRow.checksum).join(TrialRow.trajectory)
    return dict(session.execute(wanted.where(TrialRow.campaign_id == campaign_id)).all())


def gated(session: Session, campaign_id: int) -> Sequence[tuple[int, TrialState, bool]]:
    """Number, state, and whether the gate passed the gains, of each trial; by number."""
    wanted = select(TrialRow.number, TrialRow.state, TrialRow.gate["passed"].as_boolean())
    found = session.execute(wanted.where(TrialRow.campaign_id == campaign_id).order_by(TrialRow.number))
    return [(number, state, bool(passed)) for number, state, passed in found]


def curves(session: Session, trial_ids: Collection[int]) -> Mapping[int, list[list[float]]]:
    """Coarse curves of those trials that have one, by trial id."""
    wanted = select(TrialRow.id, TrialRow.curve).where(TrialRow.id.in_(trial_ids), TrialRow.curve.is_not(None))
    return {identity: curve for identity, curve in session.execute(wanted) if curve}


def page(session: Session, campaign_id: int, *, after_number: int, limit: int) -> tuple[Sequence[TrialRow], int]:
    """The next `limit` + 1 trials after the given number, and the total count."""
    total = session.scalar(select(func.count()).where(TrialRow.campaign_id == campaign_id)) or 0
    rows = session.scalars(
        select(TrialRow)
        .where(TrialRow.campaign_id == campaign_id, TrialRow.number > after_number)
        .options(
            defer(TrialRow.curve),
            # This column is stored behind the samples: to read it, SQLite would walk through all their pages.
            joinedload(TrialRow.trajectory).defer(TrajectoryRow.created_at),
        )
        .order_by(TrialRow.number)
        .limit(limit + 1)
    ).all()
    return rows, total


def scored(session: Session, campaign_id: int) -> Sequence[tuple[int, GainsJson, float]]:
    """Number, gains and error of every valid trial; by number."""
    wanted = select(TrialRow.number, TrialRow.gains, TrialRow.error).where(
        TrialRow.campaign_id == campaign_id, TrialRow.state == TrialState.VALID, TrialRow.error.is_not(None)
    )
    found = session.execute(wanted.order_by(TrialRow.number))
    return [(number, gains, error) for number, gains, error in found if error is not None]


def has_claimed_flight(session: Session, campaign_id: int) -> bool:
    wanted = select(FlightRow.id).where(FlightRow.campaign_id == campaign_id, FlightRow.claimed_at.is_not(None))
    return session.scalar(wanted.limit(1)) is not None


def delete_unclaimed_flights(session: Session, campaign_id: int) -> None:
    session.execute(delete(FlightRow).where(FlightRow.campaign_id == campaign_id, FlightRow.claimed_at.is_(None)))


def next_number(session: Session, campaign_id: int) -> int:
    last = session.scalar(select(func.max(TrialRow.number)).where(TrialRow.campaign_id == campaign_id))
    return (last or 0) + 1


def photos(session: Session, trial_id: int) -> Sequence[TrialPhotoRow]:
    """Photos without their picture data, in the order in which they were added."""
    return session.scalars(
        select(TrialPhotoRow).where(TrialPhotoRow.trial_id == trial_id).order_by(TrialPhotoRow.id)
    ).all()


def photo_or_none(session: Session, photo_id: int) -> TrialPhotoRow | None:
    return session.get(TrialPhotoRow, photo_id)


def get_flight(session: Session, flight_id: int) -> FlightRow:
    """Raises NotFoundError."""
    if (row := session.get(FlightRow, flight_id)) is None:
        raise NotFoundError("flight", flight_id)
    return row


def flight_of_campaign_under_way(session: Session, campaign_id: int) -> FlightRow | None:
    return session.scalar(
        select(FlightRow)
        .where(FlightRow.campaign_id == campaign_id, FlightRow.state.in_(ACTIVE_FLIGHT_STATES))
        .order_by(FlightRow.id)
        .limit(1)
    )


def first_under_way(session: Session) -> FlightRow | None:
    """The first active flight of any vehicle."""
    return session.scalar(
        select(FlightRow).where(FlightRow.state.in_(ACTIVE_FLIGHT_STATES)).order_by(FlightRow.id).limit(1)
    )


def first_requested(session: Session) -> FlightRow | None:
    """The oldest requested flight."""
    return session.scalar(
        select(FlightRow).where(FlightRow.state == FlightState.REQUESTED).order_by(FlightRow.id).limit(1)
    )


def running(session: Session) -> Sequence[FlightRow]:
    return session.scalars(select(FlightRow).where(FlightRow.state == FlightState.RUNNING).order_by(FlightRow.id)).all()


def latest_flights(session: Session, trial_ids: Collection[int]) -> Mapping[int, FlightRow]:
    """The last flight of each trial that has one, by trial id."""
    last = select(func.max(FlightRow.id)).where(FlightRow.trial_id.in_(trial_ids)).group_by(FlightRow.trial_id)
    return {row.trial_id: row for row in session.scalars(select(FlightRow).where(FlightRow.id.in_(last)))}


def flight_ids(session: Session, trial_id: int) -> Sequence[int]:
    """Flight ids of a trial, newest first."""
    return session.scalars(
        select(FlightRow.id).where(FlightRow.trial_id == trial_id).order_by(FlightRow.id.desc())
    ).all()
