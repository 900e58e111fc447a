"""The live link over a real Unix socket, worker's end on its thread, web's end on an event loop."""

import asyncio
import os
import shutil
import socket
import stat
import threading
import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from app.core.errors import InputError
from app.db.session import Database
from app.live import link as client_module
from app.live.hub import live_link
from app.live.link import SLOW_CLIENT_BYTES, LinkDownError, LiveClient, LiveServer
from app.live.messages import (
    LONGEST_PATH_BYTES,
    Answer,
    FlightPhase,
    FromWorker,
    PublishedMessage,
    Request,
    Telemetry,
    VehicleCommandKind,
    VehicleStatus,
    WorkerHello,
    decode,
    encode,
    live_address,
)
from tests.waiting import Waits


def telemetry(time_s: float = 1.0, rows: int = 1) -> Telemetry:
    return Telemetry(
        campaign_id=1,
        trial_id=2,
        time_s=time_s,
        error_so_far=0.25,
        columns=["time_s", "altitude_m", "climb_rate_m_s", "set_point_m", "reference_m", "thrust", "battery_v"],
        samples=[[time_s, 1.5, 0.5, 3.0, 2.5, 0.6, 11.1]] * rows,
    )


def status(altitude_m: float = 0.1) -> VehicleStatus:
    return VehicleStatus(
        vehicle_id=5,
        state="connected",
        at="2026-11-21T23:00:00+00:00",
        step="idle",
        armed=False,
        altitude_m=altitude_m,
        held={"kp": 283.0, "ki": 13.0, "kd": 82.0},
    )


def told(problem: str = "") -> Future[str]:
    """The outcome of an order, at once."""
    answer: Future[str] = Future()
    answer.set_result(problem)
    return answer


def server(
    path: Path,
    abort: Callable[[int, str], bool] = lambda _trial, _why: False,
    order: Callable[[int, VehicleCommandKind, str, float], Future[str]] = lambda *_: told("nobody has its link"),
) -> LiveServer:
    return LiveServer(path, abort=abort, order=order)


class Web:
    """A web process's end: everything it heard, and whether its link is up."""

    def __init__(self, path: Path) -> None:
        self.heard: list[PublishedMessage] = []
        self.links: list[bool] = []
        self.client = LiveClient(path, on_message=self.heard.append, on_link=self.links.append)

    async def until(self, seen: Callable[[], bool]) -> None:
        async with asyncio.timeout(Waits.at_most_s):
            while not seen():
                await asyncio.sleep(0.005)


@asynccontextmanager
async def connected(path: Path) -> AsyncIterator[Web]:
    web = Web(path)
    task = asyncio.create_task(web.client.run())
    try:
        yield web
    finally:
        task.cancel()


@pytest.mark.parametrize(
    "message",
    [
        telemetry(),
        FlightPhase(campaign_id=1, trial_id=2, phase="landed", note="on the ground"),
        status(),
        WorkerHello(),
    ],
    ids=lambda message: message.type,
)
def test_every_message_survives_the_line(message: FromWorker) -> None:
    assert decode(encode(message)) == message


@pytest.mark.parametrize("line", [b"", b"{}", b"not json", b'{"type": "launch"}', b'{"type":"abort","request":1}'])
def test_a_line_that_is_no_message_is_refused_with_a_reason(line: bytes) -> None:
    with pytest.raises(InputError, match="received an invalid message"):
        decode(line)


def test_the_socket_is_open_to_its_owner_only_and_gone_afterwards(tmp_path: Path) -> None:
    path = tmp_path / "w.sock"
    with server(path):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert not path.exists()


def test_a_long_data_folder_gets_a_short_private_address(tmp_path: Path) -> None:
    deep = tmp_path / ("d" * 120)
    deep.mkdir()
    address = live_address(deep)
    assert len(os.fsencode(address)) <= LONGEST_PATH_BYTES
    assert stat.S_IMODE(address.parent.stat().st_mode) == 0o700
    assert address == live_address(deep)
    assert address != live_address(tmp_path / ("e" * 120))
    with server(address):
        assert stat.S_IMODE(address.stat().st_mode) == 0o600


def test_telemetry_and_phases_arrive_in_order(tmp_path: Path) -> None:
    async def scenario() -> None:
        with server(tmp_path / "w.sock") as worker:
            async with connected(tmp_path / "w.sock") as web:
                await web.until(lambda: web.links == [True])
                sent = [telemetry(float(n)) for n in range(50)]
                for message in sent:
                    worker.publish(message)
                worker.publish(FlightPhase(campaign_id=1, trial_id=2, phase="landed"))
                await web.until(lambda: len(web.heard) == 51)
                assert web.heard[:50] == sent

    asyncio.run(scenario())


def test_an_abort_reaches_the_worker_and_its_answer_comes_back(tmp_path: Path) -> None:
    asked: list[tuple[int, str]] = []

    def abort(trial_id: int, reason: str) -> bool:
        asked.append((trial_id, reason))
        return trial_id == 2

    async def scenario() -> None:
        with server(tmp_path / "w.sock", abort):
            async with connected(tmp_path / "w.sock") as web:
                await web.until(lambda: web.client.connected)
                answers = await asyncio.gather(*(web.client.abort(trial, "too high") for trial in (2, 3)))
                assert [answer.accepted for answer in answers] == [True, False]

    asyncio.run(scenario())
    assert asked == [(2, "too high"), (3, "too high")]


def test_a_command_reaches_the_worker_which_reports_whether_it_has_that_vehicle(tmp_path: Path) -> None:
    given: list[tuple[int, VehicleCommandKind, str]] = []

    def order(vehicle_id: int, what: VehicleCommandKind, reason: str, _by_s: float) -> Future[str]:
        given.append((vehicle_id, what, reason))
        return told("" if vehicle_id == 5 else "nobody has its link")

    async def scenario() -> None:
        with server(tmp_path / "w.sock", order=order):
            async with connected(tmp_path / "w.sock") as web:
                await web.until(lambda: web.client.connected)
                assert (await web.client.order(5, "land", "it drifts")).accepted
                refused = await web.client.order(6, "motors off", "it burns")
                assert (refused.accepted, refused.problem) == (False, "nobody has its link")

    asyncio.run(scenario())
    assert given == [(5, "land", "it drifts"), (6, "motors off", "it burns")]


def test_a_late_command_is_not_executed(tmp_path: Path) -> None:
    """Seen: the worker stood still for 20 s, motors off was answered “could not be told”, and was carried out later."""
    done: list[str] = []
    path = tmp_path / "w.sock"
    late_s, early_s = time.monotonic() - 0.001, time.monotonic() + 3600.0

    def abort(_trial_id: int, reason: str) -> bool:
        done.append(reason)
        return True

    def order(_vehicle_id: int, _order: VehicleCommandKind, reason: str, _by_s: float) -> Future[str]:
        done.append(reason)
        return told()

    with server(path, abort, order), socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as web:
        web.connect(str(path))
        reader = web.makefile("rb")
        reader.readline()
        for request, (by_s, reason) in enumerate(((late_s, "late"), (early_s, "in time"))):
            web.sendall(encode(Request(request=request, kind="abort", of=2, reason=f"abort {reason}", by_s=by_s)))
            web.sendall(encode(Request(request=10 + request, kind="motors off", of=5, reason=reason, by_s=by_s)))
        answers = [decode(reader.readline()) for _ in range(4)]
    accepted = {answer.request: answer.accepted for answer in answers if isinstance(answer, Answer)}
    assert accepted == {0: False, 10: False, 1: True, 11: True}
    assert done == ["abort in time", "in time"]


def test_an_order_is_acknowledged_once_the_vehicles_process_has_taken_it_and_holds_up_nothing(tmp_path: Path) -> None:
    """Seen: it was acknowledged as soon as it was in the pipe of a process that was busy, which discarded it later."""
    slow: Future[str] = Future()
    given: list[str] = []

    def order(_vehicle_id: int, _order: VehicleCommandKind, reason: str, _by_s: float) -> Future[str]:
        given.append(reason)
        return slow

    async def scenario() -> None:
        with server(tmp_path / "w.sock", lambda *_: True, order):
            async with connected(tmp_path / "w.sock") as web:
                await web.until(lambda: web.client.connected)
                asked = asyncio.create_task(web.client.order(5, "land", "it drifts"))
                await web.until(lambda: given == ["it drifts"])
                assert (await web.client.abort(2, "meanwhile")).accepted
                assert not asked.done()
                slow.set_result("")
                answer = await asked
                assert (answer.accepted, answer.problem) == (True, "")

    asyncio.run(scenario())


def test_a_command_that_no_process_takes_is_reported_as_not_executed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client_module, "ORDER_TIMEOUT_S", 1.0)  # a later one would be refused before it is passed on
    monkeypatch.setattr(client_module, "ANSWER_TIMEOUT_S", 60.0)
    never: Future[str] = Future()
    deadlines_s: list[float] = []

    def order(_vehicle_id: int, _order: VehicleCommandKind, _reason: str, by_s: float) -> Future[str]:
        deadlines_s.append(by_s)
        return never

    async def scenario() -> None:
        with server(tmp_path / "w.sock", order=order):
            async with connected(tmp_path / "w.sock") as web:
                await web.until(lambda: web.client.connected)
                answer = await web.client.order(5, "motors off", "it burns")
                assert not answer.accepted
                assert "did not answer, and will not execute the command later" in answer.problem
                assert time.monotonic() > deadlines_s[0], "from then on its process refuses it"
                never.set_result("")  # late, to nobody

    asyncio.run(scenario())


def test_a_worker_that_stands_still_is_noticed_and_one_that_goes_on_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The time to answer is short only while it stands still: a busy machine must not make it run out."""
    monkeypatch.setattr(client_module, "PING_EVERY_S", 0.005)
    path, goes_on = tmp_path / "w.sock", threading.Event()

    async def scenario() -> None:
        with server(path) as worker:
            async with connected(path) as web:
                await web.until(lambda: web.client.answers)
                worker._loop.call_soon_threadsafe(goes_on.wait)
                monkeypatch.setattr(client_module, "ANSWER_TIMEOUT_S", 0.05)
                watching = asyncio.create_task(web.client.watch())
                await web.until(lambda: not web.client.answers)
                assert web.client.connected
                monkeypatch.setattr(client_module, "ANSWER_TIMEOUT_S", 60.0)
                goes_on.set()
                await web.until(lambda: web.client.answers)
                watching.cancel()
                assert web.links == [True, False, True]

    asyncio.run(scenario())


def test_an_abort_without_a_worker_fails_at_once(tmp_path: Path) -> None:
    async def scenario() -> None:
        async with connected(tmp_path / "w.sock") as web:
            with pytest.raises(LinkDownError, match="no worker is running"):
                await web.client.abort(1, "now")
            with pytest.raises(LinkDownError, match="no worker is running"):
                await web.client.order(5, "land", "now")

    asyncio.run(scenario())


def test_the_web_process_finds_a_restarted_worker_again(tmp_path: Path) -> None:
    async def scenario() -> None:
        path = tmp_path / "w.sock"
        async with connected(path) as web:
            with server(path):
                await web.until(lambda: web.client.connected)
            await web.until(lambda: not web.client.connected)
            with server(path):
                await web.until(lambda: web.client.connected)
        assert web.links[:3] == [True, False, True]

    asyncio.run(scenario())


def test_a_client_that_never_reads_loses_telemetry_but_no_phase_and_holds_up_nobody(tmp_path: Path) -> None:
    path = tmp_path / "w.sock"
    with server(path) as worker, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as sleeper:
        sleeper.connect(str(path))
        sleeper.settimeout(Waits.at_most_s)
        reader = sleeper.makefile("rb")
        assert isinstance(decode(reader.readline()), WorkerHello)
        count = 4 * SLOW_CLIENT_BYTES // len(encode(telemetry(rows=100))) + 1
        for number in range(count):
            worker.publish(telemetry(float(number), rows=100))
        worker.publish(FlightPhase(campaign_id=1, trial_id=2, phase="landed"))
        asyncio.run_coroutine_threadsafe(asyncio.sleep(0), worker._loop).result()  # all is said before any is read
        heard = 0
        while isinstance(decode(reader.readline()), Telemetry):
            heard += 1
        assert 0 < heard < count


def test_a_client_that_talks_nonsense_is_dropped_and_the_others_stay(tmp_path: Path) -> None:
    async def scenario() -> None:
        path = tmp_path / "w.sock"
        with server(path, lambda _trial, _why: True):
            async with connected(path) as web:
                await web.until(lambda: web.client.connected)
                reader, writer = await asyncio.open_unix_connection(str(path))
                await reader.readline()
                writer.write(b"GET / HTTP/1.1\r\n\r\n")
                assert await reader.read() == b""
                writer.close()
                assert (await web.client.abort(2, "still heard")).accepted

    asyncio.run(scenario())


def test_the_web_process_ends_while_a_worker_owes_it_an_answer(tmp_path: Path, migrated_file: Path) -> None:
    database = Database(Path(shutil.copyfile(migrated_file, tmp_path / "gainline.sqlite3")))

    async def scenario() -> None:
        owing = asyncio.Event()

        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            writer.write(encode(WorkerHello()))
            asked = decode(await reader.readline())
            assert isinstance(asked, Request)
            assert asked.kind == "ping"
            owing.set()
            await reader.read()
            writer.close()

        async with await asyncio.start_unix_server(serve, str(live_address(tmp_path))):
            link = live_link(tmp_path, database)
            await link.__aenter__()
            await asyncio.wait_for(owing.wait(), Waits.at_most_s)
            ended = asyncio.create_task(link.__aexit__(None, None, None))
            done, _ = await asyncio.wait([ended], timeout=Waits.at_most_s)
            assert done, "it hangs"

    asyncio.run(scenario())
    database.close()
