"""Origin and permissions of a request, from its connection, its headers, and the key that it presents.

These checks address three attacks: a page of another site makes a browser send a change to a server on loopback; a
foreign host name is pointed at this machine, so that its pages count as ours; a proxy or tunnel on this machine
connects from loopback on behalf of remote clients. Headers alone prove nothing, so a request that commands a real
vehicle must also present a key (`app.accounts.keys_and_links`).
"""

import ipaddress
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from fastapi import Request
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from app.accounts.keys_and_links import Keyring
from app.accounts.permissions import Caller, Key, Permission, require
from app.common.errors import ForeignRequestError, NotAllowedError
from app.common.settings import is_loopback
from app.web.errors import problem_response

_READS: Final = frozenset({"GET", "HEAD", "OPTIONS"})
_GUARDED: Final = ("/api/system/backup", "/report.pdf", "/bundle", "/file")
"""Suffixes of paths whose reading computes for long or fills a disk, possibly during a flight, or gives away a log with
the places where it was flown; these need the permission to change."""
_FORWARDED: Final = frozenset({"forwarded", "via", "x-real-ip", "x-client-ip", "true-client-ip", "cdn-loop"})
_FORWARDED_BEGINS: Final = (
    *("x-forwarded", "x-original-", "x-proxy", "x-remote-", "x-cluster-", "x-tunnel", "proxy-client-"),
    *("x-amzn-", "x-appengine-", "x-arr-", "x-azure-", "x-envoy-", "x-vercel-"),
    *("cf-", "do-connecting-", "fastly-", "fly-", "ngrok-", "tailscale-"),
)
"""Headers that proxies and tunnels add, and browsers do not."""


@dataclass(frozen=True, slots=True)
class AccessMiddleware:
    """Refuses requests under a foreign host name, API requests from another site's pages, and changes without a key for
    them."""

    app: ASGIApp

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            try:
                _require_admitted(Request(scope))
            except NotAllowedError as error:
                await problem_response(error)(scope, receive, send)
                return
        await self.app(scope, receive, send)


def _require_admitted(request: Request) -> None:
    """Raise NotAllowedError for a request that is refused whatever it asks for."""
    address = request.headers.get("host", "")
    name = _name_of(address)
    own_names = {"localhost", request.app.state.settings.host.lower()}
    if name not in own_names and not _is_ip_address(name):  # DNS rebinding needs a name
        raise ForeignRequestError(
            f"This server does not accept requests for the host name “{address}”.",
            hint="Use localhost or the computer's address, or start it with that name as --host (GAINLINE_HOST).",
        )
    path: str = request.scope["path"]
    changes = request.method not in _READS
    if (changes or path.startswith("/api/")) and _is_foreign(request.headers, address):
        raise ForeignRequestError(
            "The request came from a page of another site and was rejected.",
            hint="Use the dashboard, or send the request from a program without the header Origin.",
        )
    if changes or path.endswith(_GUARDED):
        require(Permission.CHANGE, caller_of(request))


def caller_of(request: Request) -> Caller:
    """The caller of a request."""
    keyring: Keyring = request.app.state.keyring
    return Caller(
        key=max(map(keyring.key_of, _shown(request.headers, keyring.cookie)), default=Key.NONE),
        exposed=not is_loopback(request.app.state.settings.host),
        because=_describe_origin(request),
    )


def _describe_origin(request: Request) -> str:
    """How a request came that is not from this computer; empty for one that is."""
    for header in request.headers:
        if header in _FORWARDED or header.startswith(_FORWARDED_BEGINS):
            return f"through a proxy or tunnel (header {header})"
    peer = "" if request.client is None else request.client.host
    if not is_loopback(peer.removeprefix("::ffff:")):
        return f"from another device ({peer})"
    address = request.headers.get("host", "")
    return "" if is_loopback(_name_of(address)) else f"under a name that is not this computer's own ({address})"


def _shown(headers: Headers, cookie: str) -> Iterator[str]:
    """Every value in the request that may be a key.

    A page at another port of this computer can set a second cookie of the same name, which must not hide ours.
    """
    for each in headers.get("cookie", "").split(";"):
        name, _, value = each.strip().partition("=")
        if name == cookie:
            yield value
    scheme, _, token = headers.get("authorization", "").partition(" ")
    if scheme.lower() == "bearer":
        yield token.strip()


def _name_of(address: str) -> str:
    try:
        return urlsplit(f"//{address}").hostname or ""
    except ValueError:
        return ""


def _is_ip_address(name: str) -> bool:
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
