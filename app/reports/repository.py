"""What a report reads that no view of the API tells."""

from collections.abc import Sequence

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.db.models import TrialPhotoRow, TrialRow


def photos(session: Session, campaign_id: int) -> Sequence[tuple[TrialPhotoRow, int]]:
    """The photos of all its trials with their sizes in bytes, in the order in which they were added; what they show is
    read only when it is asked for."""
    wanted = (
        select(TrialPhotoRow, func.length(TrialPhotoRow.data))
        .join(TrialPhotoRow.trial)
        .where(TrialRow.campaign_id == campaign_id)
        .order_by(TrialPhotoRow.id)
    )
    return [(row, size) for row, size in session.execute(wanted)]
