"""Queries of report data that no API view contains."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.db.models import TrialPhotoRow, TrialRow


def photos(session: Session, campaign_id: int) -> Sequence[tuple[TrialPhotoRow, int]]:
    """The photos of all trials of a campaign with their sizes in bytes, in the order they were added.

    The image data is loaded on access.
    """
    wanted = (
        select(TrialPhotoRow, func.length(TrialPhotoRow.data))
        .join(TrialPhotoRow.trial)
        .where(TrialRow.campaign_id == campaign_id)
        .order_by(TrialPhotoRow.id)
    )
    return [(row, size) for row, size in session.execute(wanted)]
