"""Bundles over HTTP: export of a campaign as one file, and import."""

import tempfile
from pathlib import Path

from fastapi import APIRouter, status
from fastapi.responses import FileResponse
from starlette.background import BackgroundTask

from app.bundles.export import write_bundle
from app.bundles.importer import store_bundle
from app.bundles.reader import Bundle
from app.campaigns.schemas import Campaign
from app.web.dependencies import FILE_BODY, CurrentDatabase, CurrentSettings, Id, Record

router = APIRouter(prefix="/api", tags=["bundles"])


@router.get(
    "/campaigns/{campaign_id}/bundle",
    response_class=FileResponse,
    responses={200: {"content": {"application/zip": {"schema": {"type": "string", "format": "binary"}}}}},
)
def get_bundle(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> FileResponse:
    """Export the whole campaign as one file: definition, trials, proposals, every record, photo and telemetry log."""
    with tempfile.NamedTemporaryFile(prefix="gainline-bundle-", suffix=".zip", delete=False) as file:
        path = Path(file.name)
        try:
            with database.read() as session:
                name = write_bundle(session, campaign_id, settings.data_dir, file)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
    return FileResponse(
        path,
        media_type="application/zip",
        filename=name,
        headers={"Content-Encoding": "identity"},  # it is compressed already
        background=BackgroundTask(path.unlink, missing_ok=True),
    )


@router.post("/bundles", status_code=status.HTTP_201_CREATED, openapi_extra=FILE_BODY)
def bring_in_bundle(record: Record, settings: CurrentSettings) -> Campaign:
    """Import a bundle as a new campaign, with every number unchanged. What was flown on a registered vehicle becomes
    history: it can be read, compared and cloned, but not flown."""
    with Bundle(record.file) as bundle:
        bundle.check()
        return record.once(Campaign, lambda session: store_bundle(session, bundle, settings.data_dir))
