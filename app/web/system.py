"""This server: the addresses where other devices reach it, its data, a backup, what a client may do here, and the link
that unlocks a browser: it works once and sets a cookie.
"""

import shutil
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Final, Literal

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse, StreamingResponse

from app import __version__
from app.accounts.keys_and_links import LINK_VALID_S, Keyring
from app.accounts.permissions import UNLOCK_HINT, Key, Permission, is_allowed
from app.common.data_folder import folder_bytes
from app.common.errors import InputError, Problem
from app.common.schemas import Schema
from app.db.backup import database_bytes, take_backup
from app.db.migrate import revision_of
from app.db.trajectories import require_intact
from app.web.addresses import EXPOSES, AddressInfo, addresses_elsewhere, exposure, is_in_container, qr_svg
from app.web.dependencies import CurrentDatabase, CurrentSettings, Live, described, download
from app.web.origin import caller_of

router = APIRouter(tags=["system"])

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


@router.get("/api/system")
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


@router.get("/api/system/qr.svg", response_class=Response, responses=described("image/svg+xml", binary=False))
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


@router.get("/api/system/backup", response_class=StreamingResponse, responses=described(_SQLITE))
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


_UNLOCK_HEADERS: Final = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer"}
"""The token is in the address: these headers keep it out of caches and from the next page."""

_UNLOCKED: Final = "/?unlocked"
"""The first page, which confirms it."""

_SPENT: Final = (
    (Path(__file__).parent / "spent_link.html").read_text("utf-8").replace("MINUTES", f"{LINK_VALID_S // 60}")
)


class Access(Schema):
    """What the client may do: `may_change` campaigns and simulated flights, `may_link` vehicles with a link,
    `may_command` real ones. `elsewhere`: the client is not on this computer. `hint` describes how to unlock a browser;
    empty if a link would change nothing."""

    elsewhere: bool
    may_change: bool
    may_link: bool
    may_command: bool
    hint: str


@router.get("/api/access")
def get_access(request: Request) -> Access:
    """What this client may do."""
    caller = caller_of(request)
    may_change, may_command = is_allowed(Permission.CHANGE, caller), is_allowed(Permission.TAKE_OFF, caller)
    link_helps = caller.key < Key.REMOTE if caller.is_elsewhere else not caller.exposed
    return Access(
        elsewhere=caller.is_elsewhere,
        may_change=may_change,
        may_link=is_allowed(Permission.LINK, caller),
        may_command=may_command,
        hint=UNLOCK_HINT if link_helps and not may_command else "",
    )


@router.get("/unlock", include_in_schema=False)
def unlock(request: Request, token: Annotated[str, Query(max_length=200)] = "") -> Response:
    """Exchange a link's token for a cookie, once. What the cookie permits depends on where the browser is."""
    keyring: Keyring = request.app.state.keyring
    caller = caller_of(request)
    given = Key.REMOTE if caller.is_elsewhere else Key.BROWSER
    if not keyring.open_link(token):
        if caller.key >= given:  # the link was opened twice in the same browser
            return RedirectResponse(_UNLOCKED, 303, headers=_UNLOCK_HEADERS)
        return HTMLResponse(_SPENT.replace("{minutes}", f"{LINK_VALID_S // 60}"), 403, headers=_UNLOCK_HEADERS)
    answer = RedirectResponse(_UNLOCKED, 303, headers=_UNLOCK_HEADERS)
    answer.set_cookie(keyring.cookie, keyring.value(given), max_age=90 * 24 * 3600, httponly=True, samesite="strict")
    return answer
