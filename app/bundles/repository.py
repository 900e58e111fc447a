"""Queries on the contents of a bundle besides the trials."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.db.models import FlightRow, ProposalRow, TrialPhotoRow, TrialRow


def proposals(session: Session, campaign_id: int) -> Sequence[ProposalRow]:
    """Proposals of a campaign, in the order in which they were made."""
    return session.scalars(
        select(ProposalRow).where(ProposalRow.campaign_id == campaign_id).order_by(ProposalRow.id)
    ).all()


def photos(session: Session, campaign_id: int) -> Sequence[TrialPhotoRow]:
    """Photos of all its trials, without the picture data, in the order in which they were added."""
    return session.scalars(
        select(TrialPhotoRow)
        .join(TrialPhotoRow.trial)
        .where(TrialRow.campaign_id == campaign_id)
        .order_by(TrialPhotoRow.id)
    ).all()


def flights(session: Session, campaign_id: int) -> Sequence[tuple[int, int]]:
    """Trial and flight ids, oldest flight first."""
    wanted = select(FlightRow.trial_id, FlightRow.id).where(FlightRow.campaign_id == campaign_id)
    return [(trial_id, flight_id) for trial_id, flight_id in session.execute(wanted.order_by(FlightRow.id))]
