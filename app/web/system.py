"""This server: the addresses where other devices reach it, its data, and a backup."""

import shutil
from datetime import UTC, datetime
from typing import Annotated, Final, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import StreamingResponse

from app import __version__
from app.common.data_folder import folder_bytes
from app.common.errors import InputError, Problem
from app.common.schemas import Schema
from app.db.backup import database_bytes, take_backup
from app.db.migrate import revision_of
from app.db.trajectories import require_intact
from app.web.addresses import EXPOSES, AddressInfo, addresses_elsewhere, exposure, is_in_container, qr_svg
from app.web.dependencies import CurrentDatabase, CurrentSettings, Live
from app.web.downloads import described, download

router = APIRouter(prefix="/api/system", tags=["system"])

_SQLITE: Final = "application/vnd.sqlite3"


class System(Schema):
    """This server. `addresses` are those under which other devices reach it, the likeliest first: none on loopback, and
    with `in_container` the container's own, which need not be the host's. `exposes` ends the sentence "It listens on …,
    so"."""

    version: str
    worker: Literal["running", "not answering", "absent"]
    host: str
    is_exposed: bool
    in_container: bool
    exposes: str
    addresses: list[AddressInfo]
    data_dir: str
    data_bytes: int
    free_bytes: int
    database_bytes: int
    database_revision: str


@router.get("")
def get_system(request: Request, settings: CurrentSettings, database: CurrentDatabase, live: Live) -> System:
    """Version, addresses, disk space: the facts to report with a problem."""
    return System(
        version=__version__,
        worker=live.worker,
        host=settings.host,
        is_exposed=exposure(settings.host) is not None,
        in_container=is_in_container(),
        exposes=EXPOSES,
        addresses=_addresses(request, settings),
        data_dir=str(settings.data_dir.resolve()),
        data_bytes=folder_bytes(settings.data_dir),
        free_bytes=shutil.disk_usage(settings.data_dir).free,
        database_bytes=database_bytes(database.file),
        database_revision=revision_of(database.file) or "none",
    )


@router.get("/qr.svg", response_class=Response, responses=described("image/svg+xml", binary=False))
def get_address_code(
    request: Request,
    settings: CurrentSettings,
    address: Annotated[str, Query(max_length=300, description="the `url` of one of the server's addresses")],
) -> Response:
    """One of the server's addresses as a QR code, for the camera of a tablet."""
    if address not in {each.url for each in _addresses(request, settings)}:
        raise InputError(
            "Other devices cannot reach this server at that address.",
            problems=(Problem("address", "is not one of the server's addresses"),),
            hint="GET /api/system lists them; on loopback there are none.",
        )
    return Response(qr_svg(address), media_type="image/svg+xml")


@router.get("/backup", response_class=StreamingResponse, responses=described(_SQLITE))
def get_backup(database: CurrentDatabase) -> StreamingResponse:
    """The whole database at this moment, as one SQLite file; flights and computations continue meanwhile.

    It is verified first; 503 names the trials whose record is damaged. Only for programs and the dashboard itself: a
    page of another site cannot request it.
    """
    copy = take_backup(database.file, require_intact)
    return download(copy, f"gainline-{datetime.now(UTC):%Y-%m-%dT%H%MZ}.sqlite3", media_type=_SQLITE)


def _addresses(request: Request, settings: CurrentSettings) -> list[AddressInfo]:
    _, port = request.scope["server"]
    return addresses_elsewhere(settings.host, port)
