"""The live link between worker and web process, both ends: the worker listens, publishes, and receives aborts and
commands, in its own thread; the web process stays connected while there is a worker, and sends it what cannot wait for
the database.

Neither direction waits for storage or for a flight: an abort is forwarded from the socket's thread at once, and a
client that reads too slowly loses telemetry instead of delaying the flight.
"""

import asyncio
import itertools
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Final, Self

import structlog

from app.core.errors import GainlineError, InputError
from app.live.messages import (
    MAX_LINE_BYTES,
    Answer,
    FromWorker,
    Message,
    PublishedMessage,
    Request,
    RequestKind,
    Telemetry,
    VehicleCommandKind,
    VehicleStatus,
    WorkerHello,
    decode,
    encode,
)

SLOW_CLIENT_BYTES: Final = 256 * 1024
"""A client with more unread bytes gets neither telemetry nor vehicle status until it has caught up."""
STUCK_CLIENT_BYTES: Final = 4 * 1024 * 1024
"""A client with more unread bytes is disconnected; it reconnects and reads the database."""
CONFIRMATION_S: Final = 0.25
"""How long after a command's deadline to wait for the answer that it was forwarded in time."""
LATE: Final = "The command reached the worker too late and was not executed: use the vehicle's own remote control now."
UNCONFIRMED: Final = (
    "The process that has the vehicle's link did not answer, and will not execute the command later: use the "
    "vehicle's own remote control now."
)
CONNECT_EVERY_S: Final = 0.1
ANSWER_TIMEOUT_S: Final = 2.0
ORDER_TIMEOUT_S: Final = 1.5
"""A later request is not carried out; less than ANSWER_TIMEOUT_S, so that the worker has time to answer that."""
PING_EVERY_S: Final = 1.0

_log = structlog.get_logger(__name__)


class LiveServer:
    """Listens at `path` between enter and exit.

    `abort(trial_id, reason)` is called on the socket's thread and returns whether that trial is flying.
    `order(vehicle_id, order, reason, by_s)` returns a future with why the command did not reach the vehicle, or "" if
    it did. Both must return at once. A request that is handled after its deadline, because this process was suspended,
    is not carried out.
    """

    def __init__(
        self,
        path: Path,
        *,
        abort: Callable[[int, str], bool],
        order: Callable[[int, VehicleCommandKind, str, float], Future[str]],
    ) -> None:
        self._path = path
        self._abort = abort
        self._order = order
        self._writers: set[asyncio.StreamWriter] = set()
        self._orders: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="live", daemon=True)

    def __enter__(self) -> Self:
        """Listen at a socket that only this user may open; no client can connect before it listens, which is after the
        chmod. The caller holds the worker's lock, so an existing file belongs to a dead worker."""
        self._path.unlink(missing_ok=True)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        listener.bind(str(self._path))
        self._path.chmod(0o600)
        self._thread.start()
        serving = asyncio.start_unix_server(self._serve, sock=listener, limit=MAX_LINE_BYTES)
        self._server = asyncio.run_coroutine_threadsafe(serving, self._loop).result()
        return self

    def __exit__(self, *_: object) -> None:
        asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
        self._path.unlink(missing_ok=True)

    def publish(self, message: PublishedMessage) -> None:
        """Send to every client, without blocking. May be called from any thread."""
        self._loop.call_soon_threadsafe(self._send_all, message)

    async def _close(self) -> None:
        self._server.close()
        for writer in tuple(self._writers):
            writer.close()
        await asyncio.sleep(0)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            writer.write(encode(WorkerHello()))
            while line := await reader.readline():
                self._answer(line, writer)
        except (ConnectionError, InputError, ValueError) as error:
            _log.warning("live client dropped", why=str(error))
        finally:
            self._writers.discard(writer)
            writer.close()

    def _answer(self, line: bytes, writer: asyncio.StreamWriter) -> None:
        asked = decode(line)
        if not isinstance(asked, Request):
            raise InputError(
                f"A client sent {asked.type!r}, which only the worker may send.",
                hint="Connect to the worker's socket with Gainline only.",
            )
        match asked.kind:
            case "ping":
                answer = Answer(request=asked.request)
            case "abort":
                accepted = _is_in_time(asked.by_s) and self._abort(asked.of, asked.reason)
                answer = Answer(request=asked.request, accepted=accepted)
                _log.info("abort requested", trial_id=asked.of, reason=asked.reason, accepted=accepted)
            case order:
                task = self._loop.create_task(self._pass_on(asked, order, writer))
                self._orders.add(task)
                task.add_done_callback(self._orders.discard)
                return
        writer.write(encode(answer))

    async def _pass_on(self, asked: Request, order: VehicleCommandKind, writer: asyncio.StreamWriter) -> None:
        """Forward a command and send the answer: when the vehicle's process answers, or shortly after the deadline if
        it does not."""
        problem = LATE
        if _is_in_time(asked.by_s):
            forwarded = asyncio.wrap_future(self._order(asked.of, order, asked.reason, asked.by_s))
            await asyncio.wait({forwarded}, timeout=asked.by_s + CONFIRMATION_S - time.monotonic())
            problem = forwarded.result() if forwarded.done() else UNCONFIRMED
        _log.info("vehicle command", vehicle_id=asked.of, order=order, reason=asked.reason, problem=problem)
        writer.write(encode(Answer(request=asked.request, accepted=not problem, problem=problem)))

    def _send_all(self, message: FromWorker) -> None:
        line = encode(message)
        for writer in tuple(self._writers):
            unread = writer.transport.get_write_buffer_size()
            if unread > STUCK_CLIENT_BYTES:
                writer.transport.abort()
            elif unread <= SLOW_CLIENT_BYTES or not isinstance(message, Telemetry | VehicleStatus):
                writer.write(line)


def _is_in_time(by_s: float) -> bool:
    return time.monotonic() <= by_s


class LinkDownError(GainlineError):
    """The worker cannot be reached, so a message would not arrive."""


class LiveClient:
    """Keeps one connection to the worker at `path` and reconnects indefinitely. For one event loop only.

    `on_message` receives the messages that the worker publishes. `on_link` is called when the connection is
    established or lost, and when the worker stops or resumes answering.
    """

    def __init__(
        self, path: Path, *, on_message: Callable[[PublishedMessage], None], on_link: Callable[[bool], None]
    ) -> None:
        self._path = path
        self._on_message = on_message
        self._on_link = on_link
        self._writer: asyncio.StreamWriter | None = None
        self._waiting: dict[int, asyncio.Future[Answer]] = {}
        self._answers = True
        self._numbers = itertools.count(1)

    @property
    def connected(self) -> bool:
        return self._writer is not None

    @property
    def answers(self) -> bool:
        """Whether there is a worker that answered the last ping."""
        return self.connected and self._answers

    async def watch(self) -> None:
        """Ping the worker periodically until cancelled."""
        while True:
            await asyncio.sleep(PING_EVERY_S)
            if self.connected:
                try:
                    await self._ask("ping")
                    answers = True
                except LinkDownError:
                    answers = False
                before, self._answers = self.answers, answers
                if self.answers != before:
                    _log.warning("worker answers again" if answers else "worker does not answer")
                    self._on_link(self.answers)

    async def run(self) -> None:
        """Connect and listen until cancelled."""
        while True:
            try:
                reader, writer = await asyncio.open_unix_connection(str(self._path), limit=MAX_LINE_BYTES)
            except OSError:
                await asyncio.sleep(CONNECT_EVERY_S)
            else:
                await self._listen(reader, writer)

    async def abort(self, trial_id: int, reason: str) -> Answer:
        """Request that the worker aborts a flight, without the database, and wait for its answer. Raises
        LinkDownError when it cannot be reached."""
        return await self._ask("abort", trial_id, reason)

    async def order(self, vehicle_id: int, order: VehicleCommandKind, reason: str) -> Answer:
        """Request that the worker lands a vehicle or stops its motors. Raises LinkDownError as `abort` does."""
        return await self._ask(order, vehicle_id, reason)

    async def _ask(self, kind: RequestKind, of: int = 0, reason: str = "") -> Answer:
        if self._writer is None:
            raise _link_down("no worker is running")
        answered: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        number = next(self._numbers)
        by_s = time.monotonic() + ORDER_TIMEOUT_S
        self._waiting[number] = answered
        self._writer.write(encode(Request(request=number, kind=kind, of=of, reason=reason, by_s=by_s)))
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_S):  # wait_for can swallow a cancellation in Python 3.11
                return await answered
        except TimeoutError as error:
            raise _link_down(f"the worker did not answer within {ANSWER_TIMEOUT_S:g} s") from error
        finally:
            del self._waiting[number]

    async def _listen(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                self._take(decode(line), writer)
        except (OSError, InputError, ValueError) as error:
            _log.warning("live link broken", why=str(error))
        finally:
            self._drop(writer)

    def _take(self, message: Message, writer: asyncio.StreamWriter) -> None:
        match message:
            case WorkerHello():
                self._writer, self._answers = writer, True
                self._on_link(True)
            case Answer(request=request):
                if (answer := self._waiting.get(request)) is not None and not answer.done():
                    answer.set_result(message)
            case Request():
                raise InputError(f"The worker sent an unexpected message: {message.type}.", hint="Restart the worker.")
            case _:
                self._on_message(message)

    def _drop(self, writer: asyncio.StreamWriter) -> None:
        was_up, self._writer = self.connected, None
        for answer in self._waiting.values():
            if not answer.done():
                answer.set_exception(_link_down("the worker disconnected"))
        with suppress(OSError):
            writer.close()
        if was_up:
            self._on_link(False)


def _link_down(why: str) -> LinkDownError:
    return LinkDownError(
        f"The worker could not be reached: {why}.",
        hint="If a vehicle is in the air, use its own remote control now. The server restarts its own worker "
        "within seconds. If the worker runs separately, start it again with `gainline worker`.",
    )
