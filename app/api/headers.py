"""Headers of every response: what a page may load, and what the browser may cache."""

from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

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


class HeadersMiddleware:
    """Adds the headers as a response starts; the body passes unchanged.

    Removes the Accept header of requests under /api, so that an unknown path there gives a problem and not the
    dashboard.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
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

        await self._app(scope, receive, send_with_headers)
