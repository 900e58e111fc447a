"""How much may be sent at once: refused by the stated length where there is one, else as soon as it is passed."""

from collections.abc import Callable
from typing import Final

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.errors import GainlineError, Problem, TooLargeError

JSON_BYTES: Final = 2**20
"""Largest JSON body."""
PHOTO_BYTES: Final = 10 * 2**20 + 2**12
"""Largest photo, with the form that it comes in."""
BUNDLE_BYTES: Final = 2**30
"""Largest campaign in one file; `gainline unbundle` has no such limit."""


class BodyLimitMiddleware:
    """Bounds every request's body: flight records to `upload_bytes`, photos to 10 MiB, bundles to 1 GiB, everything
    else to 1 MiB."""

    def __init__(self, app: ASGIApp, *, upload_bytes: int, refuse: Callable[[GainlineError], Response]) -> None:
        self._app = app
        self._uploads = {
            "/trajectory": upload_bytes,
            "/controller-checks": upload_bytes,
            "/photos": PHOTO_BYTES,
            "/api/bundles": BUNDLE_BYTES,
        }
        self._refuse = refuse

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        named = next((limit for ending, limit in self._uploads.items() if scope["path"].endswith(ending)), None)
        field, limit = ("body", JSON_BYTES) if named is None else ("file", named)
        stated = Headers(scope=scope).get("content-length", "")
        if stated.isdecimal() and int(stated) > limit:
            await self._refuse(_too_large(field, limit))(scope, receive, send)
            return
        received = 0

        async def receive_bounded() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit:
                raise _too_large(field, limit)
            return message

        await self._app(scope, receive_bounded, send)


def _too_large(field: str, limit_bytes: int) -> TooLargeError:
    size = f"{limit_bytes / 2**20:.4g} MiB"
    return TooLargeError(
        "The request is too large; nothing was stored.",
        hint=f"Send at most {size}: a photo in a lower resolution is enough; a flight record has at most 200 000 rows, "
        "so thin a longer one or cut it. "
        "`gainline import` reads larger logs.",
        problems=(Problem(field, f"is larger than {size}"),),
    )
