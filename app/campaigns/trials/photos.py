"""Photos of flights, stored as uploaded."""

import re
from typing import Final

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.campaigns.trials.schemas import TrialPhoto
from app.common.errors import ConflictError, InputError, MediaTypeError, NotFoundError, Problem, TooLargeError
from app.db.base import added
from app.db.models import TrialPhotoRow, TrialRow

MAX_BYTES: Final = 10 * 2**20
MAX_PER_TRIAL: Final = 20
ENDINGS: Final = {"image/jpeg": "jpg", "image/png": "png", "image/webp": "webp"}
"""File extensions by media type; every browser shows these types."""
_FIRST_BYTES: Final = {
    "image/jpeg": re.compile(rb"\xff\xd8\xff"),
    "image/png": re.compile(rb"\x89PNG\r\n\x1a\n"),
    "image/webp": re.compile(rb"RIFF.{4}WEBP", re.DOTALL),
}


def media_type_of(content: bytes) -> str | None:
    """Media type of a picture by its first bytes, whatever its file name; None if it is not an accepted type."""
    return next((media_type for media_type, begins in _FIRST_BYTES.items() if begins.match(content)), None)


def add_photo(session: Session, trial_id: int, content: bytes) -> TrialPhoto:
    """Add a photo to a trial.

    Raises NotFoundError; TooLargeError, MediaTypeError or InputError when the content is not an acceptable photo;
    ConflictError when the trial has the maximum number of photos.
    """
    trial = history.trial_row(session, trial_id)
    if len(content) > MAX_BYTES:
        size = f"{MAX_BYTES / 2**20:g} MiB"
        raise TooLargeError(
            "The photo is too large; nothing was stored.",
            hint=f"Choose one of at most {size}; reduce the resolution in the camera's settings.",
            problems=(Problem("file", f"is larger than {size}"),),
        )
    if not content:
        raise InputError("The photo is empty.", hint="Take it again.", problems=(Problem("file", "is empty"),))
    if (media_type := media_type_of(content)) is None:
        raise MediaTypeError(
            "This is not a JPEG, PNG or WebP picture; nothing was stored.",
            hint="Set the camera to JPEG (iPhone: Settings, Camera, Formats, Most Compatible), or send a screenshot.",
            problems=(Problem("file", "is not a JPEG, PNG or WebP picture"),),
        )
    if len(repository.photos_of_trial(session, trial_id)) >= MAX_PER_TRIAL:
        raise ConflictError(
            f"Flight {trial.number} has {MAX_PER_TRIAL} photos, the maximum.",
            hint="Delete one of them, then add this one.",
        )
    return TrialPhoto.view_of(added(session, TrialPhotoRow(trial=trial, media_type=media_type, data=content)))


def list_photos(session: Session, trial_id: int) -> list[TrialPhoto]:
    """Photos of a trial in the order in which they were added. Raises NotFoundError."""
    return [
        TrialPhoto.view_of(row) for row in repository.photos_of_trial(session, history.trial_row(session, trial_id).id)
    ]


def photos_of_campaign(session: Session, campaign_id: int) -> list[tuple[TrialPhotoRow, int]]:
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


def get_picture(session: Session, trial_id: int, photo_id: int) -> tuple[TrialPhotoRow, str]:
    """The photo and its file name for download. Raises NotFoundError."""
    row = _one(session, trial_id, photo_id)
    name = f"campaign-{row.trial.campaign_id}-trial-{row.trial.number}-photo-{row.id}.{ENDINGS[row.media_type]}"
    return row, name


def delete_photo(session: Session, trial_id: int, photo_id: int) -> None:
    """Raises NotFoundError."""
    session.delete(_one(session, trial_id, photo_id))


def _one(session: Session, trial_id: int, photo_id: int) -> TrialPhotoRow:
    row = session.get(TrialPhotoRow, photo_id)
    if row is None or row.trial_id != trial_id:
        raise NotFoundError("photo", photo_id)
    return row
