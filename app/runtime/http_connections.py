"""Connections of the web server: how many are allowed, how long they may take, and which is closed first; and the HTTP
protocol, Uvicorn's own, that reports each connection's phase, refuses headers and trailers that are too large, and does
not read a body to its end once the request is answered.

Descriptors are limited, while opening a connection costs a client nothing. So a new connection is always accepted: at
the limit the one that has waited longest for its client is closed, whether idle, partly sent, or an event stream, which
reconnects by itself. Requests being answered stay; where all others are being answered, the last places are reserved
for requests that end a flight.
"""

import asyncio
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import IntEnum
from http import HTTPStatus
from typing import Any, Final

from uvicorn.config import Config
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from app.common.settings import is_loopback
from app.core.clock import Clock

HEAD_WITHIN_S: Final = 10.0
"""From the connection, or the end of the last response, to the end of a request's headers."""
ANSWERED_WITHIN_S: Final = 2.0
"""From a response that was sent before its request was complete, such as a refusal, to the end of the request: closing
the connection at once would reset it, and the client might not see the response."""
BODY_SILENCE_S: Final = 20.0
BODY_WITHIN_S: Final = 1800.0
STREAM_AFTER_S: Final = 10.0
"""A response that takes longer is an event stream, or is read slowly."""
RESERVED_DESCRIPTORS: Final = 256
"""Descriptors reserved for the database, files and processes."""
RESERVED_FOR_ABORTS: Final = 64
"""Connections beyond the limit, only for requests that end a flight."""
RESERVED_FOR_ARRIVING: Final = 32
"""Connections beyond those that are being accepted, or were dropped and are being closed."""
MAX_CONNECTIONS: Final = 1024
MAX_CONNECTIONS_PER_DEVICE: Final = 64
"""This computer has no limit of its own, because the operator may be one of its users."""


class Phase(IntEnum):
    """Phase of a connection; at the limit, those in the lowest phase are closed first."""

    ANSWERED = 0
    IDLE = 1
    HEAD = 2
    BODY = 3
    STREAM = 4
    BUSY = 5


@dataclass(slots=True, eq=False)
class Connection:
    """One connection.

    `client` is the device that it is from, empty for this computer. `drop` closes it at once. `is_held` returns whether
    the server has stopped reading from it, so that its silence is not the client's. `for_stopping`: it was accepted
    beyond the limit, and serves only requests that end a flight.
    """

    client: str
    drop: Callable[[], None]
    is_held: Callable[[], bool]
    phase: Phase = Phase.IDLE
    since_s: float = 0.0
    heard_s: float = 0.0
    for_stopping: bool = False


@dataclass(slots=True)
class Connections:
    """All open connections. For one event loop only.

    `held` counts descriptors; that of a dropped connection is released shortly after.
    """

    most: int
    clock: Clock
    open: dict[Connection, None] = field(default_factory=dict)
    held: int = 0

    def has_room(self, arriving: int) -> bool:
        """Whether another connection can be accepted now, while `arriving` ones are being accepted."""
        return self.held + arriving < self.most + RESERVED_FOR_ABORTS + RESERVED_FOR_ARRIVING

    def add(self, connection: Connection) -> bool:
        """Add a connection, closing another one if necessary. False when it must be closed, because all others are
        being answered."""
        now_s = self.clock.now_s()
        connection.since_s = connection.heard_s = now_s
        own = [each for each in self.open if each.client == connection.client] if connection.client else []
        is_full = len(self.open) >= self.most
        if len(own) >= MAX_CONNECTIONS_PER_DEVICE or is_full:
            goes = self._first_to_go(own if len(own) >= MAX_CONNECTIONS_PER_DEVICE else self.open, now_s)
            if goes is not None:
                self.remove(goes)
                goes.drop()
            elif own or len(self.open) >= self.most + RESERVED_FOR_ABORTS:
                return False
            else:
                connection.for_stopping = True
        self.open[connection] = None
        return True

    def remove(self, connection: Connection) -> None:
        self.open.pop(connection, None)

    def enter(self, connection: Connection, phase: Phase) -> None:
        """Enter a phase; entering the present phase again is no progress."""
        if connection.phase != phase:
            connection.phase, connection.since_s = phase, self.clock.now_s()

    def drop_overdue(self) -> None:
        """Close connections that take longer than permitted."""
        now_s = self.clock.now_s()
        for connection in [each for each in self.open if _is_overdue(each, now_s)]:
            self.remove(connection)
            connection.drop()

    def _first_to_go(self, among: Iterable[Connection], now_s: float) -> Connection | None:
        waiting = [(phase, each.since_s, each) for each in among if (phase := _standing(each, now_s)) is not Phase.BUSY]
        return min(waiting, key=lambda one: one[:2])[2] if waiting else None


def room_for_connections(descriptors: int) -> int:
    """Maximum number of connections besides `RESERVED_FOR_ABORTS`, given the process's limit of open files."""
    return min(
        MAX_CONNECTIONS,
        max(descriptors - RESERVED_DESCRIPTORS, descriptors // 2) - RESERVED_FOR_ABORTS - RESERVED_FOR_ARRIVING,
    )


def _standing(connection: Connection, now_s: float) -> Phase:
    took_long = connection.phase is Phase.BUSY and now_s - connection.since_s > STREAM_AFTER_S
    return Phase.STREAM if took_long else connection.phase


def _is_overdue(connection: Connection, now_s: float) -> bool:
    match connection.phase:
        case Phase.ANSWERED:
            return now_s - connection.since_s > ANSWERED_WITHIN_S
        case Phase.IDLE | Phase.HEAD:
            return now_s - connection.since_s > HEAD_WITHIN_S
        case Phase.BODY:
            is_silent = now_s - connection.heard_s > BODY_SILENCE_S and not connection.is_held()
            return is_silent or now_s - connection.since_s > BODY_WITHIN_S
        case _:
            return False


MAX_HEAD_BYTES: Final = 64 * 1024
"""Maximum size of the request line and the headers together, and of anything else that is not body: trailers, chunk
extensions."""
MAX_PIPELINED: Final = 16
"""Requests that may wait for the one before them on the same connection."""
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
        self._bare_bytes = self._parsed_bytes = 0
        """Received since the parser last came to the end of headers, some body, or the end of a message; and parsed of
        the present headers."""
        self._in_body = self._got_on = self._has_request = self._refused = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as Uvicorn has it
        super().connection_made(transport)
        self._all.held += 1
        peer = "" if self.client is None else self.client[0].removeprefix("::ffff:")
        self._own = Connection("" if is_loopback(peer) else peer, transport.abort, lambda: self.flow.read_paused)
        if not self._all.add(self._own):
            self._refused = True
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._all.held -= 1
        self._all.remove(self._own)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._refused:
            return
        self._own.heard_s = self._all.clock.now_s()
        self._got_on = False
        super().data_received(data)
        self._bare_bytes = 0 if self._got_on else self._bare_bytes + len(data)
        self._refuse_long_head(self._bare_bytes)

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._parsed_bytes = 0
        self._enter(Phase.HEAD)

    def on_url(self, url: bytes) -> None:
        super().on_url(url)
        self._parsed_bytes += len(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        if self._in_body:
            return  # a trailer: Uvicorn would keep it as one more header
        super().on_header(name, value)
        self._parsed_bytes += len(name) + len(value) + len(b": \r\n")

    def on_headers_complete(self) -> None:
        self._got_on = True
        self._refuse_long_head(max(self._parsed_bytes, self._bare_bytes))
        self._in_body = True
        if len(self.pipeline) >= MAX_PIPELINED:
            self._refused = True
            self.transport.abort()
        if self._refused:
            return
        if self._own.for_stopping and not self.url.partition(b"?")[0].endswith(_STOPPING):
            self._refuse(
                HTTPStatus.SERVICE_UNAVAILABLE,
                "This server has too many open connections; it accepts only abort, land and motors off.",
                "Try again in a few seconds.",
            )
            return
        self._enter(Phase.BODY)
        self._has_request = True
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        self._got_on = True
        if not self._refused:
            super().on_body(body)

    def on_message_complete(self) -> None:
        self._got_on = True
        self._in_body = False
        if not self._refused:
            self._enter(Phase.IDLE if self.cycle.response_complete else Phase.BUSY)
            super().on_message_complete()

    def on_response_complete(self) -> None:
        if self.cycle.response_complete:  # otherwise it is not the last that has arrived
            self._enter(Phase.ANSWERED if self.cycle.more_body else Phase.IDLE)
        super().on_response_complete()

    def _enter(self, phase: Phase) -> None:
        if not self._refused:
            self._all.enter(self._own, phase)

    def _refuse_long_head(self, size_bytes: int) -> None:
        if size_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
            self._refuse(
                HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE,
                f"The headers or trailers are larger than {MAX_HEAD_BYTES // 1024} KiB; the request was rejected.",
                "Send smaller headers; put large data into the body.",
            )

    def _refuse(self, status: HTTPStatus, detail: str, hint: str) -> None:
        """Send an error without the application, unless it is responding already, and read no more."""
        self._enter(Phase.ANSWERED)
        self._refused = True
        if self._has_request and not self.cycle.response_complete:
            if self.cycle.response_started or self.pipeline:
                self.transport.abort()
                return
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        problem = {"type": "about:blank", "title": status.phrase, "status": status, "detail": detail, "hint": hint}
        body = json.dumps({**problem, "problems": []}).encode()
        self.transport.write(_ANSWER.format(status=status, size=len(body)).encode() + body)
        self.transport.write_eof()
