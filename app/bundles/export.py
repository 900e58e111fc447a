"""Export of a campaign as one file: its rows, and those of the campaigns that it starts from, as the parts of a zip."""

import hashlib
import json
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Final

from pydantic import ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session

from app import __version__
from app.bundles.contents import (
    CONTENTS,
    MANIFEST,
    MAX_CAMPAIGNS,
    VERSION,
    Campaign,
    Contents,
    Manifest,
    Photo,
    Proposal,
    Record,
    Trial,
    Vehicle,
)
from app.campaigns import history
from app.campaigns import service as campaigns
from app.campaigns.trials.photos import ENDINGS, media_type_of, photos_of_campaign
from app.campaigns.trials.records import telemetry_logs
from app.common.errors import BusyError, ConflictError, StorageError
from app.db.base import utc_now
from app.db.models import CampaignRow, ProposalRow, TrajectoryRow, TrialPhotoRow, TrialRow, VehicleRow
from app.db.trajectories import is_intact, refused_for
from app.fleet.registration import origin_of

_EPOCH: Final = (1980, 1, 1, 0, 0, 0)
"""Time stamp of every part, so that the same campaign makes the same parts."""


class Packer:
    """Writes the parts of one bundle, each as soon as it is read, and collects their digests for the manifest."""

    def __init__(self, session: Session, data_dir: Path, out: IO[bytes]) -> None:
        self._session = session
        self._data_dir = data_dir
        self._out = out
        self._zip = zipfile.ZipFile(out, "w", allowZip64=True)
        self._digests: dict[str, str] = {}

    def pack(self, campaigns: Sequence[CampaignRow]) -> None:
        """Write the bundle; the campaign comes last, after those that it starts from.

        Raises ConflictError if a bundle cannot hold the campaign, StorageError that names the trial when a record or
        photo is damaged, and StorageError when the file does not hold what was written to it.
        """
        with self._zip:
            try:
                contents = Contents(campaigns=[self._campaign(row) for row in campaigns])
            except ValidationError as error:
                first = error.errors(include_url=False, include_input=False)[0]  # mostly a list that is too long
                where = ".".join(map(str, first["loc"]))
                raise ConflictError(
                    "This campaign, or one that it starts from, cannot be exported as a bundle: "
                    f"{where}: {first['msg']}.",
                    hint="No data is lost. Export its report and the records of its trials one by one.",
                ) from error
            self._write(CONTENTS, _json(contents.model_dump(mode="json")), squeeze=True)
            manifest = Manifest(
                format="gainline-campaign", version=VERSION, program=__version__, made_at=utc_now(), parts=self._digests
            )
            self._write(MANIFEST, _json(manifest.model_dump(mode="json")), squeeze=True)
        self._verify()

    def _verify(self) -> None:
        """Read every part back from the file."""
        try:
            with zipfile.ZipFile(self._out) as written:
                spoilt = [name for name, digest in self._digests.items() if _digest(written.read(name)) != digest]
        except (zipfile.BadZipFile, KeyError, OSError) as error:
            raise _not_written(str(error)) from error
        if spoilt:
            raise _not_written(f"{spoilt[0]} differs from what was written")

    def _write(self, name: str, data: bytes, *, squeeze: bool = False) -> str:
        """Write a part; `squeeze` compresses what is not compressed already."""
        described = zipfile.ZipInfo(name, _EPOCH)
        described.compress_type = zipfile.ZIP_DEFLATED if squeeze else zipfile.ZIP_STORED
        self._zip.writestr(described, data)
        self._digests[name] = _digest(data)
        return name

    def _campaign(self, row: CampaignRow) -> Campaign:
        wanted = select(ProposalRow).where(ProposalRow.campaign_id == row.id).order_by(ProposalRow.id)
        proposals = self._session.scalars(wanted).all()
        places = {proposal.id: place for place, proposal in enumerate(proposals)}
        trials = history.trials_of(self._session, row.id)
        logs = telemetry_logs(self._session, [trial.id for trial in trials], self._data_dir)
        photos: dict[int, list[TrialPhotoRow]] = {}
        for photo, _ in photos_of_campaign(self._session, row.id):
            photos.setdefault(photo.trial_id, []).append(photo)
        return Campaign.view_of(
            row,
            vehicle=_vehicle(row.vehicle),
            trials=[
                Trial.view_of(
                    trial,
                    proposal=None if trial.proposal_id is None else places.get(trial.proposal_id),
                    record=self._record(trial.trajectory, refused_for((trial,), "The bundle was not created")),
                    predicted=self._record(trial.predicted, _damaged_curve(f"flight {trial.number}", row)),
                    photos=[self._photo(trial, photo) for photo in photos.get(trial.id, [])],
                    telemetry=self._telemetry(trial, logs.get(trial.id)),
                )
                for trial in trials
            ],
            proposals=[
                Proposal.view_of(
                    proposal, predicted=self._record(proposal.predicted, _damaged_curve(f"proposal {proposal.id}", row))
                )
                for proposal in proposals
            ],
        )

    def _record(self, row: TrajectoryRow | None, damaged: StorageError) -> Record | None:
        if row is None:
            return None
        if not is_intact(row):
            raise damaged
        part = self._write(f"records/{row.id}.zst", row.data)
        self._session.expire(row, ["data"])
        return Record.view_of(row, part=part, codec=1)

    def _photo(self, trial: TrialRow, row: TrialPhotoRow) -> Photo:
        if media_type_of(row.data) != row.media_type:
            raise StorageError(
                f"The bundle was not created: a photo of trial {trial.number} of campaign {trial.campaign_id} is "
                "damaged.",
                hint="Delete that photo, or restore it from an earlier backup. Everything else is intact.",
            )
        part = self._write(f"photos/{row.id}.{ENDINGS[row.media_type]}", row.data)
        self._session.expire(row, ["data"])
        return Photo.view_of(row, part=part)

    def _telemetry(self, row: TrialRow, log: Path | None) -> str | None:
        return None if log is None else self._write(f"telemetry/{row.id}.tlog", log.read_bytes(), squeeze=True)


def _vehicle(row: VehicleRow) -> Vehicle:
    """The vehicle's description; for a placeholder, that of the vehicle it stands for."""
    if (origin := origin_of(row)) is None:
        return Vehicle.view_of(row)
    kind, name = origin
    return Vehicle.view_of(row, kind=kind, name=name, registered=True)


def _damaged_curve(whose: str, campaign: CampaignRow) -> StorageError:
    return StorageError(
        f"The bundle was not created: the predicted curve of {whose} of campaign {campaign.id} is damaged.",
        hint="Restore the database from an earlier backup.",
    )


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _not_written(why: str) -> StorageError:
    return StorageError(
        f"The bundle was not created: the file does not contain what was written to it ({why}).",
        hint="Check the disk that it was written to, then export the bundle again.",
    )


def _json(document: object) -> bytes:
    return json.dumps(document, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()


def write_bundle(session: Session, campaign_id: int, data_dir: Path, out: IO[bytes]) -> str:
    """Write the campaign, after those that it starts from; returns the file name.

    Raises NotFoundError, BusyError while one of them has a flight under way, and ConflictError for more than a bundle
    holds.
    """
    row = campaigns.get_row(session, campaign_id)
    chain = _chain(session, row)
    for each in chain:
        if history.flight_under_way(session, each.id) is not None:
            raise BusyError(
                f"Campaign {each.id} has a flight under way.", hint="Wait until it has ended, then export the bundle."
            )
    Packer(session, data_dir, out).pack(chain)
    return f"campaign-{row.id}.gainline.zip"


def _chain(session: Session, row: CampaignRow) -> list[CampaignRow]:
    """The campaign and those that it starts from, the first of them first.

    None can be left out, because the campaign's first gains could not be computed again without it.
    """
    chain = [row]
    while (donor := (chain[0].definition.get("start") or {}).get("donor")) is not None:
        found = campaigns.get_row(session, donor["campaign_id"])
        if any(found is known for known in chain):
            break
        chain.insert(0, found)
    if len(chain) > MAX_CAMPAIGNS:
        raise ConflictError(
            f"Campaign {row.id} follows a chain of {len(chain) - 1} warm starts; a bundle can hold {MAX_CAMPAIGNS} "
            "campaigns, and without the first ones its gains could not be recomputed.",
            hint=f"Export the bundle of an earlier campaign of the chain (campaign {chain[MAX_CAMPAIGNS - 1].id} "
            "is the last that fits), or the report and the records of this one.",
        )
    return chain
