"""Notes and photos of the flights, limited to a file size that can still be sent."""

from collections.abc import Iterator, Sequence
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns.trials.schemas import Trial
from app.db.models import TrialPhotoRow
from app.reports import repository
from app.reports.content import Photo, Remark

MAX_BYTES: Final = 24 * 2**20
"""Limit for all photos together, in original size; they take a third more in the file."""


def remarks_on(session: Session, campaign_id: int, trials: Sequence[Trial]) -> Iterator[Remark]:
    """Remarks of the trials that have any, in order."""
    photos: dict[int, list[tuple[TrialPhotoRow, int]]] = {}
    for row, size in repository.photos(session, campaign_id):
        photos.setdefault(row.trial_id, []).append((row, size))
    kept = _fitting(photos)
    for trial in trials:
        own = photos.get(trial.id, [])
        if not trial.note and not own:
            continue
        shown = [Photo(row.media_type, row.data, row.added_at) for row, _ in own if row.id in kept]
        yield Remark(trial=trial, photos=tuple(shown), left_out=len(own) - len(shown))


def _fitting(photos: dict[int, list[tuple[TrialPhotoRow, int]]]) -> set[int]:
    """Ids of the photos that fit: the first photo of each trial comes before the second of any."""
    kept, room = set[int](), MAX_BYTES
    turns = sorted((place, row.id, size) for own in photos.values() for place, (row, size) in enumerate(own))
    for _, photo_id, size in turns:
        if size <= room:
            kept.add(photo_id)
            room -= size
    return kept
