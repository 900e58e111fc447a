"""Who may speak to us: the machine's own names and addresses, and for acts only our own pages.

A page from elsewhere can make a browser send an act to a server on loopback, and a foreign name can be pointed at this
machine so that its pages count as ours. Neither carries what is checked here.
"""

import ipaddress
from collections.abc import Callable
from urllib.parse import urlsplit

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope, Send

_READS = frozenset({"GET", "HEAD", "OPTIONS"})
_GUARDED = ("/api/system/backup", "/report.pdf", "/bundle")
"""How the paths end that another site may not even set going, though its page could not read what comes: they take a
browser's start or a whole database's or campaign's room on the disk, while something may fly."""


class OriginMiddleware:
    """Refuses requests under a foreign name, and acts that another site's page asks for.

    `host` is the name that the dashboard was told to listen on; `refuse` makes the answer from a sentence and a hint.
    """

    def __init__(self, app: ASGIApp, *, host: str, refuse: Callable[[str, str], Response]) -> None:
        self._app = app
        self._names = {"localhost", host.lower()}
        self._refuse = refuse

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and (refusal := self._refusal(scope)) is not None:
            await self._refuse(*refusal)(scope, receive, send)
            return
        await self._app(scope, receive, send)

    def _refusal(self, scope: Scope) -> tuple[str, str] | None:
        headers = Headers(scope=scope)
        address = headers.get("host", "")
        if not self._is_ours(address):
            return (
                f"This server does not answer to the name “{address}”.",
                "Use localhost or the machine's address, or start it with that name as --host (GAINLINE_HOST).",
            )
        is_read = scope["method"] in _READS and not scope["path"].endswith(_GUARDED)
        if not is_read and _is_foreign(headers, address):
            return (
                "This was asked for by a page of another site; nothing was done.",
                "Do it in the dashboard itself, or send it from a program, without the header Origin.",
            )
        return None

    def _is_ours(self, address: str) -> bool:
        try:
            name = urlsplit(f"//{address}").hostname or ""
        except ValueError:
            return False
        return name in self._names or _is_ip_address(name)


def _is_ip_address(name: str) -> bool:
    """Such a name cannot be pointed elsewhere."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _is_foreign(headers: Headers, address: str) -> bool:
    origin = headers.get("origin")
    return headers.get("sec-fetch-site") in {"cross-site", "same-site"} or (
        origin is not None and origin.partition("://")[2] != address
    )
