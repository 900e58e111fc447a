"""Size limits of request bodies: enforced by the stated length if there is one, else as soon as the limit is
exceeded."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.common.errors import GainlineError, Problem, TooLargeError

JSON_BYTES: Final = 2**20
"""Largest JSON body."""
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


_JSON: Final = _Limit("body", JSON_BYTES, "no act of the API needs more")


class BodyLimitMiddleware:
    """Limits every request's body: flight records to `upload_bytes`, photos to 10 MiB, bundles to 1 GiB, everything
    else to 1 MiB."""

    def __init__(self, app: ASGIApp, *, upload_bytes: int, refuse: Callable[[GainlineError], Response]) -> None:
        self._app = app
        record = "a flight record has at most 200 000 rows, so thin a longer one or cut it"
        self._uploads = {
            "/trajectory": _Limit("file", upload_bytes, f"{record}. `gainline import` reads larger logs"),
            "/controller-checks": _Limit("file", upload_bytes, "`gainline controller check` reads larger logs"),
            "/photos": _Limit("file", PHOTO_BYTES, "a lower resolution in the camera's settings is enough"),
            "/api/bundles": _Limit("file", BUNDLE_BYTES, "`gainline unbundle` brings in larger ones"),
        }
        self._refuse = refuse

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        path: str = scope["path"]
        limit = next((limit for ending, limit in self._uploads.items() if path.endswith(ending)), _JSON)
        stated = Headers(scope=scope).get("content-length", "")
        if stated.isdecimal() and int(stated) > limit.size_bytes:
            await self._refuse(_too_large(limit))(scope, receive, send)
            return
        received = 0

        async def receive_bounded() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > limit.size_bytes:
                raise _too_large(limit)
            return message

        await self._app(scope, receive_bounded, send)


def _too_large(limit: _Limit) -> TooLargeError:
    size = f"{limit.size_bytes / 2**20:.4g} MiB"
    return TooLargeError(
        "The request is too large; nothing was stored.",
        hint=f"Send at most {size}: {limit.otherwise}.",
        problems=(Problem(limit.field, f"is larger than {size}"),),
    )
