"""Bundles over HTTP: export of a campaign as one file, and import."""

import tempfile
from contextlib import ExitStack
from typing import Final

from fastapi import APIRouter, status
from fastapi.responses import StreamingResponse

from app.bundles.export import write_bundle
from app.bundles.importer import store_bundle
from app.bundles.reader import Bundle
from app.campaigns.schemas import Campaign
from app.web.dependencies import FILE_BODY, CurrentDatabase, CurrentSettings, Id, Record, described, download

router = APIRouter(prefix="/api", tags=["bundles"])

_ZIP: Final = "application/zip"


@router.get("/campaigns/{campaign_id}/bundle", response_class=StreamingResponse, responses=described(_ZIP))
def get_bundle(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> StreamingResponse:
    """Export the whole campaign as one file: definition, trials, proposals, every record, photo and telemetry log."""
    with ExitStack() as until_made:
        file = until_made.enter_context(tempfile.TemporaryFile())
        with database.read() as session:
            name = write_bundle(session, campaign_id, settings.data_dir, file)
        until_made.pop_all()
    return download(file, name, media_type=_ZIP)


@router.post("/bundles", status_code=status.HTTP_201_CREATED, openapi_extra=FILE_BODY)
def bring_in_bundle(record: Record, settings: CurrentSettings) -> Campaign:
    """Import a bundle as a new campaign, with every number unchanged. What was flown on a registered vehicle becomes
    history: it can be read, compared and cloned, but not flown."""
    with Bundle(record.file) as bundle:
        bundle.check()
        return record.once(lambda session: store_bundle(session, bundle, settings.data_dir))
