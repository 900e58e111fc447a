"""What surrounds every request and response: security and cache headers, size limits of request bodies, and the
dashboard's scripts and styles.

Those are compressed once and then sent from memory: compressed for every request, the chart library alone kept the
server busy for 0.1 s, just when a page requests its figures. A body is refused by its stated length if there is one,
else as soon as the limit is exceeded.
"""

import gzip
from dataclasses import dataclass
from functools import lru_cache
from http import HTTPStatus
from pathlib import Path
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.common.errors import Problem, TooLargeError
from app.web.errors import problem_response

_SECURITY: Final = {
    "Content-Security-Policy": (
        "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
        "object-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",
}


def _caching(path: str, status: int) -> str:
    """Cache-Control of a response: built assets have a content hash in their names and never change; the rest is
    revalidated."""
    if path.startswith("/assets/") and status in {200, 206, 304}:
        return "public, max-age=31536000, immutable"
    return "no-store" if path.startswith("/api/") else "no-cache"


@dataclass(frozen=True, slots=True)
class HeadersMiddleware:
    """Adds the headers as a response starts; the body passes unchanged.

    Removes the Accept header of requests under /api, so that an unknown path there gives a problem and not the
    dashboard.
    """

    app: ASGIApp

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        if scope["path"] == "/api" or scope["path"].startswith("/api/"):
            scope = {**scope, "headers": [header for header in scope["headers"] if header[0] != b"accept"]}

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _SECURITY.items():
                    headers.setdefault(name, value)
                headers.setdefault("Cache-Control", _caching(scope["path"], message["status"]))
            await send(message)

        await self.app(scope, receive, send_with_headers)


class Assets(StaticFiles):
    """Static files whose names contain a hash of their content, so that the cached compressed data stays valid."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, compressed if the client accepts gzip; raises HTTPException 404 when there is none."""
        answer = await super().get_response(path, scope)
        asked = Headers(scope=scope)
        whole = scope["method"] == "GET" and "range" not in asked
        if not isinstance(answer, FileResponse) or not whole or "gzip" not in asked.get("accept-encoding", ""):
            return answer
        body = await run_in_threadpool(_compressed, Path(answer.path))
        headers = {"Content-Encoding": "gzip", "Vary": "Accept-Encoding", "ETag": answer.headers["etag"]}
        return Response(body, media_type=answer.media_type, headers=headers)


@lru_cache(maxsize=64)  # more files than a build has
def _compressed(file: Path) -> bytes:
    return gzip.compress(file.read_bytes(), mtime=0)


PHOTO_BYTES: Final = 10 * 2**20 + 2**12
"""Largest photo, including the form around it."""
BUNDLE_BYTES: Final = 2**30
"""Largest campaign in one file; `gainline unbundle` has no such limit."""


@dataclass(frozen=True, slots=True)
class _Limit:
    """Size limit of a request's `field`; `otherwise` is the advice for larger ones."""

    field: str
    size_bytes: int
    otherwise: str


_JSON: Final = _Limit("body", 2**20, "no operation of the API needs more")


class BodyLimitMiddleware:
    """Limits every request's body: flight records to `upload_bytes`, photos to 10 MiB, bundles to 1 GiB, everything
    else to 1 MiB."""

    def __init__(self, app: ASGIApp, *, upload_bytes: int) -> None:
        self._app = app
        record = "a flight record has at most 200 000 rows, so downsample or trim a longer one"
        of_flight = _Limit("file", upload_bytes, f"{record}. `gainline import` reads larger logs")
        analysed = _Limit("file", upload_bytes, "`gainline analyze` reads larger logs")
        self._uploads = {
            "/trajectory": of_flight,
            "/records": of_flight,
            "/log-analyses": analysed,
            "/log-analyses/campaign": analysed,
            "/file": analysed,
            "/photos": _Limit("file", PHOTO_BYTES, "a lower resolution in the camera's settings is enough"),
            "/api/bundles": _Limit("file", BUNDLE_BYTES, "`gainline unbundle` imports larger ones"),
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path: str = scope["path"]
        limit = next((limit for ending, limit in self._uploads.items() if path.endswith(ending)), _JSON)
        stated = Headers(scope=scope).get("content-length", "")
        if stated.isdecimal() and int(stated) > limit.size_bytes:
            await problem_response(_too_large(limit))(scope, receive, send)
            return
        received = 0

        async def receive_bounded() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit.size_bytes:
                raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE) from _too_large(limit)
            return message

        await self._app(scope, receive_bounded, send)


def _too_large(limit: _Limit) -> TooLargeError:
    size = f"{limit.size_bytes / 2**20:.4g} MiB"
    return TooLargeError(
        "The request is too large; nothing was stored.",
        hint=f"Send at most {size}: {limit.otherwise}.",
        problems=(Problem(limit.field, f"is larger than {size}"),),
    )
