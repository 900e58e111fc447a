"""Queries on what a bundle holds beside the trials."""

from collections.abc import Sequence

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.db.models import FlightRow, ProposalRow, TrialPhotoRow, TrialRow


def proposals(session: Session, campaign_id: int) -> Sequence[ProposalRow]:
    """In the order in which they were made."""
    return session.scalars(
        select(ProposalRow).where(ProposalRow.campaign_id == campaign_id).order_by(ProposalRow.id)
    ).all()


def photos(session: Session, campaign_id: int) -> Sequence[TrialPhotoRow]:
    """Of all its trials, in the order in which they were added; without the pictures."""
    return session.scalars(
        select(TrialPhotoRow)
        .join(TrialPhotoRow.trial)
        .where(TrialRow.campaign_id == campaign_id)
        .order_by(TrialPhotoRow.id)
    ).all()


def flights(session: Session, campaign_id: int) -> Sequence[tuple[int, int]]:
    """Trial and flight ids, the oldest first."""
    wanted = select(FlightRow.trial_id, FlightRow.id).where(FlightRow.campaign_id == campaign_id)
    return [(trial_id, flight_id) for trial_id, flight_id in session.execute(wanted.order_by(FlightRow.id))]
