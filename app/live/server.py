"""The worker's end of the live link: listens, publishes, and receives aborts and commands, in its own thread.

Neither direction waits for storage or for a flight: an abort is forwarded from the socket's thread at once, and a
client that reads too slowly loses telemetry instead of delaying the flight.
"""

import asyncio
import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Final, Self

import structlog

from app.core.errors import InputError
from app.live.messages import (
    MAX_LINE_BYTES,
    Abort,
    Answer,
    FromWorker,
    Ping,
    PublishedMessage,
    Telemetry,
    VehicleCommandKind,
    VehicleOrder,
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

_log = structlog.get_logger(__name__)


class LiveServer:
    """Listens at `path` between enter and exit.

    `abort(trial_id, reason)` is called on the socket's thread and returns whether that trial is flying.
    `order(vehicle_id, order, reason, by_s)` returns a future with why the command did not reach the vehicle, or "" if
    it did. `hello()` describes the worker to a new client. All must return at once. A request that is handled after its
    deadline, because this process was suspended, is not carried out.
    """

    def __init__(
        self,
        path: Path,
        *,
        abort: Callable[[int, str], bool],
        order: Callable[[int, VehicleCommandKind, str, float], Future[str]],
        hello: Callable[[], WorkerHello],
    ) -> None:
        self._path = path
        self._abort = abort
        self._order = order
        self._hello = hello
        self._writers: set[asyncio.StreamWriter] = set()
        self._orders: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="live", daemon=True)

    def __enter__(self) -> Self:
        listener = _listen(self._path)
        self._thread.start()
        asyncio.run_coroutine_threadsafe(self._open(listener), self._loop).result()
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

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_forever()

    async def _open(self, listener: socket.socket) -> None:
        self._server = await asyncio.start_unix_server(self._serve, sock=listener, limit=MAX_LINE_BYTES)

    async def _close(self) -> None:
        self._server.close()
        for writer in tuple(self._writers):
            writer.close()
        await asyncio.sleep(0)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        try:
            writer.write(encode(self._hello()))
            while line := await reader.readline():
                self._answer(line, writer)
        except (ConnectionError, InputError, ValueError) as error:
            _log.warning("live client dropped", why=str(error))
        finally:
            self._writers.discard(writer)
            writer.close()

    def _answer(self, line: bytes, writer: asyncio.StreamWriter) -> None:
        match decode(line):
            case Abort(request=request, trial_id=trial_id, reason=reason, by_s=by_s):
                accepted = _is_in_time(by_s) and self._abort(trial_id, reason)
                answer = Answer(request=request, accepted=accepted)
                _log.info("abort requested", trial_id=trial_id, reason=reason, accepted=accepted)
            case VehicleOrder() as ordered:
                task = self._loop.create_task(self._pass_on(ordered, writer))
                self._orders.add(task)
                task.add_done_callback(self._orders.discard)
                return
            case Ping(request=request):
                answer = Answer(request=request)
            case other:
                raise InputError(
                    f"A client sent {other.type!r}, which only the worker may send.",
                    hint="Connect to the worker's socket with Gainline only.",
                )
        writer.write(encode(answer))

    async def _pass_on(self, ordered: VehicleOrder, writer: asyncio.StreamWriter) -> None:
        """Forward a command and send the answer: when the vehicle's process answers, or shortly after the deadline if
        it does not."""
        problem = LATE
        if _is_in_time(ordered.by_s):
            forwarded = asyncio.wrap_future(
                self._order(ordered.vehicle_id, ordered.order, ordered.reason, ordered.by_s)
            )
            await asyncio.wait({forwarded}, timeout=ordered.by_s + CONFIRMATION_S - time.monotonic())
            problem = forwarded.result() if forwarded.done() else UNCONFIRMED
        vehicle_id = ordered.vehicle_id
        _log.info("vehicle command", vehicle_id=vehicle_id, order=ordered.order, reason=ordered.reason, problem=problem)
        writer.write(encode(Answer(request=ordered.request, accepted=not problem, problem=problem)))

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


def _listen(path: Path) -> socket.socket:
    """A bound socket that only this user may open; no client can connect before it listens, which is after the chmod.

    The caller holds the worker's lock, so an existing file belongs to a dead worker.
    """
    path.unlink(missing_ok=True)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    listener.bind(str(path))
    path.chmod(0o600)
    return listener
