"""How many connections there are, how long they may take, and who goes first; and what the parser of one does with what
arrives."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest
import uvicorn
from starlette.types import Message, Receive, Scope, Send
from uvicorn.server import ServerState

from app.runtime.http_connections import (
    ANSWERED_WITHIN_S,
    BODY_SILENCE_S,
    BODY_WITHIN_S,
    HEAD_WITHIN_S,
    MAX_CONNECTIONS_PER_DEVICE,
    MAX_PIPELINED,
    RESERVED_FOR_ABORTS,
    RESERVED_FOR_ARRIVING,
    STREAM_AFTER_S,
    Connection,
    Connections,
    LimitedProtocol,
    Phase,
    room_for_connections,
)
from tests.clocks import ManualClock

TABLET = "192.0.2.9"


class Table:
    """Connections with a clock of the test's, and which of them were dropped."""

    def __init__(self, most: int) -> None:
        self.clock = ManualClock()
        self.all = Connections(most, self.clock)
        self.dropped: list[Connection] = []
        self.held = False

    def pass_s(self, seconds: float) -> None:
        self.clock.time_s += seconds

    def open(self, client: str = "", phase: Phase = Phase.IDLE) -> Connection:
        """One that has come as far as this phase, a moment after the last."""
        connection = Connection(client, lambda: self.dropped.append(connection), lambda: self.held)
        self.pass_s(0.001)
        self.taken = self.all.add(connection)
        self.all.enter(connection, phase)
        return connection


def test_the_oldest_silent_connection_makes_room_for_a_new_one() -> None:
    table = Table(3)
    first, second, third = (table.open() for _ in range(3))
    assert table.dropped == []
    table.open()
    assert table.dropped == [first]
    table.open()
    assert table.dropped == [first, second]
    assert third in table.all.open
    assert len(table.all.open) == 3


def test_who_is_silent_goes_before_who_has_begun_to_speak_and_what_is_answered_stays() -> None:
    table = Table(5)
    phases = (Phase.BUSY, Phase.BODY, Phase.HEAD, Phase.IDLE, Phase.ANSWERED)
    busy, body, head, idle, answered = (table.open(phase=phase) for phase in phases)
    for _ in range(4):
        table.open(phase=Phase.BUSY)
    assert table.dropped == [answered, idle, head, body]
    assert busy in table.all.open


def test_an_event_stream_makes_room_where_everything_else_is_being_answered() -> None:
    table = Table(2)
    stream = table.open(phase=Phase.BUSY)
    table.pass_s(STREAM_AFTER_S + 0.1)
    table.open(phase=Phase.BUSY)
    table.open(phase=Phase.BUSY)
    assert table.dropped == [stream]


def test_the_last_places_are_for_stopping_and_beyond_them_nobody_is_taken() -> None:
    table = Table(1)
    assert not table.open(phase=Phase.BUSY).for_stopping
    last = [table.open(phase=Phase.BUSY) for _ in range(RESERVED_FOR_ABORTS)]
    assert all(each.for_stopping for each in last)
    assert table.dropped == []
    table.open()
    assert not table.taken
    assert len(table.all.open) == 1 + RESERVED_FOR_ABORTS


def test_another_device_has_a_limit_of_its_own_and_this_computer_none() -> None:
    table = Table(10 * MAX_CONNECTIONS_PER_DEVICE)
    here = [table.open() for _ in range(2 * MAX_CONNECTIONS_PER_DEVICE)]
    there = [table.open(TABLET) for _ in range(MAX_CONNECTIONS_PER_DEVICE + 1)]
    assert table.dropped == there[:1]
    assert all(each in table.all.open for each in here)
    for each in there[1:]:
        table.all.enter(each, Phase.BUSY)
    table.open(TABLET)
    assert not table.taken


@pytest.mark.parametrize(
    ("phase", "within_s"),
    [
        (Phase.ANSWERED, ANSWERED_WITHIN_S),
        (Phase.IDLE, HEAD_WITHIN_S),
        (Phase.HEAD, HEAD_WITHIN_S),
        (Phase.BODY, BODY_SILENCE_S),
    ],
)
def test_what_its_client_does_not_go_on_with_is_closed(phase: Phase, within_s: float) -> None:
    table = Table(5)
    slow, busy = table.open(phase=phase), table.open(phase=Phase.BUSY)
    table.pass_s(within_s - 0.1)
    table.all.drop_overdue()
    assert table.dropped == []
    table.pass_s(0.2)
    table.all.drop_overdue()
    assert table.dropped == [slow]
    assert list(table.all.open) == [busy]


def drip(table: Table, connection: Connection, until: Callable[[], bool]) -> float:
    """Send a byte every second until that; how long it took."""
    begun_s = table.clock.now_s()
    while not until():
        table.pass_s(1.0)
        connection.heard_s = table.all.clock.now_s()
        table.all.enter(connection, connection.phase)
        table.all.drop_overdue()
    return table.clock.now_s() - begun_s


@pytest.mark.parametrize(
    ("phase", "within_s"),
    [(Phase.ANSWERED, ANSWERED_WITHIN_S), (Phase.HEAD, HEAD_WITHIN_S), (Phase.BODY, BODY_WITHIN_S)],
)
def test_a_byte_a_second_keeps_nothing_open_for_ever(phase: Phase, within_s: float) -> None:
    table = Table(5)
    slow = table.open(phase=phase)
    assert drip(table, slow, lambda: table.dropped == [slow]) == pytest.approx(within_s + 1.0, abs=1.0)


def test_a_body_that_we_do_not_read_on_is_not_held_against_its_client() -> None:
    table = Table(5)
    table.open(phase=Phase.BODY)
    table.held = True
    table.pass_s(10 * BODY_SILENCE_S)
    table.all.drop_overdue()
    assert table.dropped == []


@pytest.mark.parametrize(("descriptors", "most"), [(1024, 672), (256, 32), (4096, 1024), (2**20, 1024)])
def test_descriptors_are_left_for_all_else(descriptors: int, most: int) -> None:
    assert room_for_connections(descriptors) == most
    assert descriptors - most - RESERVED_FOR_ABORTS - RESERVED_FOR_ARRIVING >= min(256, descriptors // 2)


class Wire(asyncio.Transport):
    """The client's end of a connection: what it has received, and how the connection ended."""

    def __init__(self) -> None:
        super().__init__({"peername": ("127.0.0.1", 40_000), "sockname": ("127.0.0.1", 8000)})
        self.received = b""
        self.ended = ""

    def write(self, data: bytes | bytearray | memoryview) -> None:
        self.received += bytes(data)

    def write_eof(self) -> None:
        self.ended = self.ended or "no more comes"

    def close(self) -> None:
        self.ended = "closed"

    def abort(self) -> None:
        self.ended = "aborted"

    def is_closing(self) -> bool:
        return self.ended in {"closed", "aborted"}

    def pause_reading(self) -> None:
        """What a test sends arrives all the same."""

    def resume_reading(self) -> None:
        """See above."""


class Peer:
    """A client of the protocol itself, with an application that the test gives; the scopes that it was called with, and
    what it received."""

    def __init__(self, application: Callable[["Peer", Receive, Send], Awaitable[None]]) -> None:
        self.table = Table(5)
        self.scopes: list[Scope] = []
        self.messages: list[Message] = []
        self.wire = Wire()

        async def called(scope: Scope, receive: Receive, send: Send) -> None:
            self.scopes.append(scope)
            await application(self, receive, send)

        config = uvicorn.Config(called, http="httptools", ws="none", lifespan="off", log_config=None)
        config.load()
        self.protocol = LimitedProtocol(self.table.all, config, ServerState(), {}, asyncio.get_running_loop())
        self.protocol.connection_made(self.wire)

    def phase(self) -> Phase:
        (own,) = self.table.all.open
        return own.phase

    async def send(self, *parts: bytes) -> None:
        for part in parts:
            self.protocol.data_received(part)
            for _ in range(5):  # the application's turns
                await asyncio.sleep(0)


async def answer(send: Send, *, more: bool = False) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"o" if more else b"ok", "more_body": more})


async def at_once(_peer: Peer, _receive: Receive, send: Send) -> None:
    await answer(send)


async def after_the_body(peer: Peer, receive: Receive, send: Send) -> None:
    while True:
        peer.messages.append(await receive())
        if not peer.messages[-1].get("more_body"):
            break
    await answer(send)


async def never(_peer: Peer, _receive: Receive, _send: Send) -> None:
    await asyncio.Event().wait()


async def begun(peer: Peer, receive: Receive, send: Send) -> None:
    await answer(send, more=True)
    await never(peer, receive, send)


HOST = b" HTTP/1.1\r\nHost: 127.0.0.1\r\n"
CHUNKED = b"POST /a" + HOST + b"Transfer-Encoding: chunked\r\n\r\n"
LINE = b"X-Long: " + 1000 * b"a" + b"\r\n"


def test_a_body_that_is_answered_before_its_end_is_not_read_to_it() -> None:
    async def run() -> None:
        peer = Peer(at_once)
        await peer.send(b"POST /a" + HOST + b"Content-Length: 1100000000\r\n\r\n", 65_536 * b"a")
        assert peer.wire.received.endswith(b"\r\n\r\nok")
        assert (peer.phase(), peer.wire.ended) == (Phase.ANSWERED, ""), "the client is left time to read that"
        peer.table.pass_s(ANSWERED_WITHIN_S + 0.1)
        await peer.send(65_536 * b"a")
        peer.table.all.drop_overdue()
        assert peer.wire.ended == "aborted"

    asyncio.run(run())


def test_a_connection_whose_body_ends_after_the_answer_waits_for_the_next_request() -> None:
    async def run() -> None:
        peer = Peer(at_once)
        await peer.send(b"POST /a" + HOST + b"Content-Length: 6\r\n\r\n", b"abc")
        assert peer.phase() is Phase.ANSWERED
        await peer.send(b"def")
        assert peer.phase() is Phase.IDLE
        await peer.send(b"GET /b" + HOST + b"\r\n")
        assert [scope["path"] for scope in peer.scopes] == ["/a", "/b"]

    asyncio.run(run())


def test_a_trailer_is_no_header() -> None:
    async def run() -> None:
        peer = Peer(after_the_body)
        await peer.send(CHUNKED + b"1\r\na\r\n0\r\n", b"X-Forwarded-For: 192.0.2.9\r\n\r\n")
        assert [name for name, _ in peer.scopes[0]["headers"]] == [b"host", b"transfer-encoding"]
        assert (peer.wire.received[-2:], peer.phase()) == (b"ok", Phase.IDLE)

    asyncio.run(run())


@pytest.mark.parametrize(
    "parts",
    [
        (b"1\r\na\r\n0\r\n", *(66 * (LINE,))),
        (b"0\r\nX-Long: ", *(66 * (1000 * b"a",))),
        (b"1;x=", *(66 * (1000 * b"a",))),
        66 * (1000 * b"0",),
    ],
    ids=["trailers", "one trailer", "chunk extension", "chunk size"],
)
def test_what_is_no_body_has_the_limit_of_headers_also_within_a_request(parts: tuple[bytes, ...]) -> None:
    async def run() -> None:
        waiting, responding = Peer(after_the_body), Peer(begun)
        for peer in (waiting, responding):
            await peer.send(CHUNKED, *parts)
        assert waiting.wire.received.startswith(b"HTTP/1.1 431 ")
        assert waiting.wire.ended == "no more comes"
        assert waiting.phase() is Phase.ANSWERED
        assert waiting.messages[-1]["type"] == "http.disconnect"
        assert responding.wire.received.startswith(b"HTTP/1.1 200 ")
        assert (responding.wire.received.count(b"HTTP/1.1"), responding.wire.ended) == (1, "aborted")

    asyncio.run(run())


def test_a_long_body_of_small_chunks_with_small_extensions_is_read() -> None:
    async def run() -> None:
        peer = Peer(after_the_body)
        await peer.send(CHUNKED, *(40 * (100 * (b"1;x=" + 30 * b"a" + b"\r\na\r\n"),)), b"0\r\n\r\n")
        assert sum(len(message["body"]) for message in peer.messages) == 4000
        assert peer.wire.received.endswith(b"ok")

    asyncio.run(run())


def test_requests_are_not_taken_without_end_before_the_first_one_is_answered() -> None:
    async def run() -> None:
        request = b"GET /a" + HOST + b"\r\n"
        taken, flood = Peer(never), Peer(never)
        await taken.send((1 + MAX_PIPELINED) * request)
        assert taken.wire.ended == ""
        await flood.send(2000 * request)
        assert (flood.wire.ended, len(flood.protocol.pipeline)) == ("aborted", MAX_PIPELINED)

    asyncio.run(run())
