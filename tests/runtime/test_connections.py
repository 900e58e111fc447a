"""A real server while its connections are all taken, and what it takes no more of; how soon an abort is answered then:
bench/abort.py."""

import re
import resource
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Final

import httpx2
import pytest

from app.runtime.http_connections import RESERVED_FOR_ABORTS, room_for_connections
from tests.runtime.processes import Serving, in_the_air
from tests.waiting import Waits

pytestmark = pytest.mark.real_time("a real server closes connections after times of its own", about_s=10)

FILES: Final = 256
"""That the server may have open."""


@pytest.fixture(scope="module")
def limited(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Serving]:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, hard))
    try:
        one = Serving(tmp_path_factory.mktemp("connections") / "data")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    with one:
        one.worker_pid()
        yield one


def connected(serving: Serving) -> socket.socket:
    host, port = serving.url.removeprefix("http://").split(":")
    return socket.create_connection((host, int(port)), timeout=Waits.at_most_s)


def is_closed(connection: socket.socket) -> bool:
    """Whether the server has closed it, without waiting for that."""
    connection.setblocking(False)
    try:
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


def open_files(serving: Serving) -> int:
    return len(list(Path(f"/proc/{serving.process.pid}/fd").iterdir()))


@pytest.mark.complete
@pytest.mark.parametrize("first", [b"", b"GET /api/he", b"POST /api/campaigns HTTP/1.1\r\nHost: 127.0.0.1\r\n"])
def test_an_abort_is_answered_while_idle_connections_fill_every_place(limited: Serving, first: bytes) -> None:
    trial_id = in_the_air(limited, limited.campaign(), speed=1.0)
    with ExitStack() as stack:
        idle = [stack.enter_context(connected(limited)) for _ in range(2 * FILES)]
        for connection in idle:
            if not is_closed(connection):
                connection.setblocking(True)
                connection.sendall(first)
        with httpx2.Client(base_url=limited.url, timeout=Waits.at_most_s) as operator:
            answer = operator.post(f"/api/trials/{trial_id}/abort", json={"reason": "too close"})
        assert (answer.status_code, answer.json()["accepted"]) == (202, True)
        assert open_files(limited) < FILES
        places = room_for_connections(FILES) + RESERVED_FOR_ABORTS
        assert sum(not is_closed(connection) for connection in idle) <= places
    assert limited.trial(trial_id, "aborted")["reason"] == "too close"
    assert "connections cannot be accepted" not in limited.logged()


@pytest.mark.complete
def test_event_streams_without_end_make_room_for_an_abort(limited: Serving) -> None:
    request = b"GET /api/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"
    with ExitStack() as stack:
        for _ in range(FILES):
            stream = stack.enter_context(connected(limited))
            stream.sendall(request)
        with httpx2.Client(base_url=limited.url, timeout=Waits.at_most_s) as operator:
            answer = operator.post("/api/vehicles/4711/land")
        assert answer.status_code == 202
        with httpx2.Client(base_url=limited.url, timeout=Waits.at_most_s) as somebody:
            try:
                status = somebody.get("/api/health").status_code
            except httpx2.TransportError:
                status = 503  # the last places may be taken as well
            assert status in {200, 503}


def answered(serving: Serving, *parts: bytes) -> bytes:
    """What comes back for a request that is sent in these parts."""
    with connected(serving) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for part in parts:
            connection.sendall(part)
        received = b""
        while b"\r\n\r\n" not in received and (more := connection.recv(2**16)):
            received += more
        return received


BEGIN = b"GET /api/health HTTP/1.1\r\nHost: 127.0.0.1\r\n"
LINE = b"X-Long: " + 1000 * b"a" + b"\r\n"


@pytest.mark.parametrize(
    "parts",
    [
        (BEGIN + 70 * LINE + b"\r\n",),
        (BEGIN, *(65 * (LINE,))),
        (BEGIN, b"X-One: ", *(66 * (1000 * b"a",))),
        (b"GET /api/health?" + 70_000 * b"a" + b" HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",),
    ],
    ids=["at once", "line by line", "one line", "address"],
)
def test_headers_without_end_are_refused(serving: Serving, parts: tuple[bytes, ...]) -> None:
    answer = answered(serving, *parts)
    assert answer.startswith(b"HTTP/1.1 431 ")
    assert b"larger than 64 KiB" in answer


def memory_mib(serving: Serving) -> float:
    status = Path(f"/proc/{serving.process.pid}/status").read_text()
    found = re.search(r"VmRSS:\s+(\d+) kB", status)
    assert found is not None
    return int(found.group(1)) / 1024


def test_trailers_without_end_are_not_kept(serving: Serving) -> None:
    """20 MiB of them once took 390 MiB of memory, and stayed as long as the connection."""
    before_mib = memory_mib(serving)
    with connected(serving) as connection:
        connection.sendall(
            b"POST /api/campaigns HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
            b"Transfer-Encoding: chunked\r\n\r\n1\r\n{\r\n0\r\n"
        )
        for _ in range(20):
            connection.sendall(2**18 * b"a:\r\n")
        assert connection.recv(2**16).startswith(b"HTTP/1.1 431 ")
        assert memory_mib(serving) - before_mib < 40.0


@pytest.mark.complete
@pytest.mark.parametrize("length", ["Content-Length: 1100000000", "Transfer-Encoding: chunked"])
def test_an_upload_that_is_too_large_is_not_read_to_its_end(serving: Serving, length: str) -> None:
    """As a client sends it that looks for the answer afterwards; at 50 MB/s it once took 22 s."""
    chunk = b"100000\r\n" + 2**20 * b"a" + b"\r\n"
    begun_s = time.monotonic()
    with connected(serving) as connection:
        connection.sendall(b"POST /api/trials/1/trajectory HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: text/csv\r\n")
        connection.sendall(f"{length}\r\n\r\n".encode())
        with suppress(ConnectionError):
            for number in range(1000):
                connection.sendall(chunk)
                time.sleep(max(0.0, number / 50.0 - (time.monotonic() - begun_s)))
        answer = connection.recv(2**16)
    assert time.monotonic() - begun_s < 10.0
    assert answer.startswith(b"HTTP/1.1 413 ")
    assert b"is larger than 48 MiB" in answer


@pytest.mark.complete
@pytest.mark.parametrize("first", [b"", BEGIN], ids=["silent", "half a head"])
def test_a_connection_that_does_not_go_on_is_closed(serving: Serving, first: bytes) -> None:
    with connected(serving) as connection:
        connection.sendall(first)
        assert connection.recv(1) == b"", "the server closed it"


def test_headers_of_a_usual_size_are_taken_in_any_parts(serving: Serving) -> None:
    whole = BEGIN + 50 * LINE + b"\r\n"
    for parts in ((whole,), (BEGIN, *(50 * (LINE,)), b"\r\n")):
        assert answered(serving, *parts).startswith(b"HTTP/1.1 200 ")


def test_a_connection_serves_one_request_after_the_other(serving: Serving) -> None:
    with httpx2.Client(
        base_url=serving.url, timeout=Waits.at_most_s, limits=httpx2.Limits(max_connections=1)
    ) as client:
        for _ in range(5):
            assert client.get("/api/health").status_code == 200
            assert client.post("/api/campaigns", content=b"x" * 200_000).status_code == 415
