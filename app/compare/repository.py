"""Database queries for compared flights."""

from collections.abc import Collection, Mapping

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.db.models import FlightRow, TrialRow


def trials_by_id(session: Session, trial_ids: Collection[int]) -> Mapping[int, TrialRow]:
    """The existing trials among these ids."""
    return {row.id: row for row in session.scalars(select(TrialRow).where(TrialRow.id.in_(trial_ids)))}


def batteries(session: Session, trial_ids: Collection[int]) -> Mapping[int, str]:
    """Battery label of each trial's last flight, if one was entered."""
    last = select(func.max(FlightRow.id)).where(FlightRow.trial_id.in_(trial_ids)).group_by(FlightRow.trial_id)
    told = select(FlightRow).where(FlightRow.id.in_(last), FlightRow.battery != "")
    return {row.trial_id: row.battery for row in session.scalars(told)}
