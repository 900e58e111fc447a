"""HTTP protocol of `app.web_server`: Uvicorn's own, which also reports each connection's phase to `app.connections` and
refuses headers that are too large."""

import asyncio
import json
from http import HTTPStatus
from typing import Any, Final

from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from app.common.settings import is_loopback
from app.connections import Connection, Connections, Phase

MAX_HEAD_BYTES: Final = 64 * 1024
"""Maximum size of the request line and the headers together."""
_STOPPING: Final = (b"/abort", b"/land", b"/motors-off")
_ANSWER: Final = (
    "HTTP/1.1 {status.value} {status.phrase}\r\nContent-Type: application/problem+json\r\nContent-Length: {size}\r\n"
    "Cache-Control: no-store\r\nConnection: close\r\n\r\n"
)


class LimitedProtocol(HttpToolsProtocol):
    """One connection."""

    def __init__(
        self,
        connections: Connections,
        config: Config,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self._all = connections
        self._own: Connection | None = None
        self._head_bytes = self._told_bytes = 0
        self._refused = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as Uvicorn has it
        super().connection_made(transport)
        self._all.held += 1
        peer = "" if self.client is None else self.client[0].removeprefix("::ffff:")
        own = Connection("" if is_loopback(peer) else peer, transport.abort, lambda: self.flow.read_paused)
        if self._all.add(own):
            self._own = own
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.held -= 1
        if self._own is not None:
            self._all.remove(self._own)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._own is None or self._refused:
            return
        was_head = self._own.phase in {Phase.IDLE, Phase.HEAD}
        self._all.hear(self._own)
        super().data_received(data)
        if was_head and self._own.phase in {Phase.IDLE, Phase.HEAD} and not self._refused:
            # Part of a head; the parser reports it only line by line.
            self._head_bytes += len(data)
            self._all.enter(self._own, Phase.HEAD)
            self._refuse_long_head()

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._told_bytes = 0
        self._enter(Phase.HEAD)

    def on_url(self, url: bytes) -> None:
        super().on_url(url)
        self._told_bytes += len(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        super().on_header(name, value)
        self._told_bytes += len(name) + len(value) + len(b": \r\n")

    def on_headers_complete(self) -> None:
        self._head_bytes = max(self._told_bytes, self._head_bytes)
        self._refuse_long_head()
        self._head_bytes = 0
        if self._refused:
            return
        if self._own is not None and self._own.for_stopping and not self.url.partition(b"?")[0].endswith(_STOPPING):
            self._refuse(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "This server has more connections open than it can serve; only abort, land and motors off are taken.",
                "Try again in a few seconds.",
            )
            return
        self._enter(Phase.BODY)
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        if not self._refused:
            super().on_body(body)

    def on_message_complete(self) -> None:
        if not self._refused:
            self._enter(Phase.BUSY)
            super().on_message_complete()

    def on_response_complete(self) -> None:
        if not self.cycle.more_body:
            self._enter(Phase.IDLE)
        super().on_response_complete()

    def _enter(self, phase: Phase) -> None:
        if self._own is not None:
            self._all.enter(self._own, phase)

    def _refuse_long_head(self) -> None:
        if self._head_bytes > MAX_HEAD_BYTES:
            self._refuse(
                HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE,
                f"The headers are larger than {MAX_HEAD_BYTES // 1024} KiB; nothing was done.",
                "Send smaller headers; what is large belongs into the body.",
            )

    def _refuse(self, status: HTTPStatus, detail: str, hint: str) -> None:
        """Send an error without the application, and close the connection."""
        self._refused = True
        problem = {"type": "about:blank", "title": status.phrase, "status": status, "detail": detail, "hint": hint}
        body = json.dumps({**problem, "problems": []}).encode()
        self.transport.write(_ANSWER.format(status=status, size=len(body)).encode() + body)
        self.transport.close()
