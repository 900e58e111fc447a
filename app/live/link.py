"""Live part of the web process: publishes the outbox, in order and once, and the worker's telemetry to the event
streams.

It stays connected while there is a worker, and sends it what cannot wait for the database.
"""

import asyncio
import itertools
import threading
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Final, Literal, TypeVar

import structlog
from sqlalchemy.exc import DBAPIError

from app.common.errors import StorageError
from app.core.errors import GainlineError, InputError
from app.db.outbox import DatabaseWatch, events_after, latest_event_id
from app.db.session import Database
from app.live.hub import Change, Hub, LinkState, VehicleReport
from app.live.messages import (
    MAX_LINE_BYTES,
    Abort,
    Answer,
    FlightPhase,
    FromWorker,
    Message,
    Ping,
    Telemetry,
    ToWorker,
    VehicleCommandKind,
    VehicleOrder,
    VehicleStatus,
    WorkerHello,
    decode,
    encode,
    live_address,
)

FIRST_PAUSE_S: Final = 0.05
LONGEST_PAUSE_S: Final = 0.5
ANSWER_TIMEOUT_S: Final = 2.0
ORDER_TIMEOUT_S: Final = 1.5
"""A later request is not carried out; less than ANSWER_TIMEOUT_S, so that the worker has time to answer that."""
PING_EVERY_S: Final = 1.0

_log = structlog.get_logger(__name__)


class LinkDownError(GainlineError):
    """The worker cannot be reached, so a message would not arrive."""


class LiveClient:
    """Keeps one connection to the worker at `path` and reconnects indefinitely. For one event loop only.

    `on_message` receives the worker's messages. `on_link` is called when the connection is established or lost, and
    when the worker stops or resumes answering.
    """

    def __init__(
        self, path: Path, *, on_message: Callable[[FromWorker], None], on_link: Callable[[bool], None]
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
                    await self._ask(Ping(request=next(self._numbers)))
                except LinkDownError:
                    self._note(answers=False)
                else:
                    self._note(answers=True)

    def _note(self, *, answers: bool) -> None:
        before, self._answers = self.answers, answers
        if self.answers != before:
            _log.warning("worker answers again" if answers else "worker does not answer")
            self._on_link(self.answers)

    async def run(self) -> None:
        """Connect and listen until cancelled."""
        pause_s = FIRST_PAUSE_S
        while True:
            try:
                reader, writer = await asyncio.open_unix_connection(str(self._path), limit=MAX_LINE_BYTES)
            except OSError:
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
                continue
            pause_s = FIRST_PAUSE_S
            await self._listen(reader, writer)

    async def abort(self, trial_id: int, reason: str) -> Answer:
        """Request that the worker aborts a flight, without the database, and wait for its answer. Raises
        LinkDownError when it cannot be reached."""
        number = next(self._numbers)
        return await self._ask(Abort(request=number, trial_id=trial_id, reason=reason, by_s=_deadline_s()))

    async def order(self, vehicle_id: int, order: VehicleCommandKind, reason: str) -> Answer:
        """Request that the worker lands a vehicle or stops its motors. Raises LinkDownError as `abort` does."""
        number = next(self._numbers)
        return await self._ask(
            VehicleOrder(request=number, vehicle_id=vehicle_id, order=order, reason=reason, by_s=_deadline_s())
        )

    async def _ask(self, question: ToWorker) -> Answer:
        if self._writer is None:
            raise _link_down("no worker is running")
        answered: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()
        self._waiting[question.request] = answered
        self._writer.write(encode(question))
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_S):  # wait_for can swallow a cancellation in Python 3.11
                return await answered
        except TimeoutError as error:
            raise _link_down(f"the worker did not answer within {ANSWER_TIMEOUT_S:g} s") from error
        finally:
            del self._waiting[question.request]

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
                self._on_message(message)
                self._on_link(True)
            case Answer(request=request):
                if (answer := self._waiting.get(request)) is not None and not answer.done():
                    answer.set_result(message)
            case Abort() | VehicleOrder() | Ping():
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


def _deadline_s() -> float:
    return time.monotonic() + ORDER_TIMEOUT_S


def _link_down(why: str) -> LinkDownError:
    return LinkDownError(
        f"The worker could not be reached: {why}.",
        hint="If a vehicle is in the air, use its own remote control now. The server restarts its own worker "
        "within seconds. If the worker runs separately, start it again with `gainline worker`.",
    )


BATCH: Final = 500
PAUSE_AFTER_TROUBLE_S: Final = 1.0
LOOK_ANYWAY_S: Final = 5.0


def changes_after(database: Database, event_id: int) -> Iterator[Change]:
    """All changes after that event up to now, read in short transactions."""
    while True:
        with database.read() as session:
            batch = [
                Change(id=row.id, topic=row.topic, entity_id=row.entity_id, campaign_id=row.campaign_id)
                for row in events_after(session, event_id, limit=BATCH)
            ]
        yield from batch
        if len(batch) < BATCH:
            return
        event_id = batch[-1].id


class OutboxTail:
    """A thread that calls `publish(change)` for every event committed after `start`."""

    def __init__(self, database: Database, publish: Callable[[Change], None]) -> None:
        self._database = database
        self._publish = publish
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="outbox tail", daemon=True)

    def start(self) -> None:
        """Note the present end of the outbox, and start the thread."""
        with self._database.read() as session:
            self._last = latest_event_id(session)
        self._thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stop.is_set():
            try:
                self._follow()
            except (StorageError, DBAPIError) as error:
                _log.error("the outbox cannot be read", why=str(error))
                self._stop.wait(PAUSE_AFTER_TROUBLE_S)

    def _follow(self) -> None:
        with DatabaseWatch(self._database.file) as watch:
            while not self._stop.is_set():
                for change in changes_after(self._database, self._last):
                    self._publish(change)
                    self._last = change.id
                watch.wait(self._stop, LOOK_ANYWAY_S)


T = TypeVar("T")
BEAT_S: Final = 3.0
"""Interval of a message on every stream, so that a client detects a dead connection by longer silence."""


class Live:
    """The hub of the event streams, and the connection to the worker."""

    def __init__(self, data_dir: Path) -> None:
        self.hub = Hub()
        self.client = LiveClient(
            live_address(data_dir),
            on_message=self._on_message,
            on_link=lambda up: self.hub.publish(LinkState(worker=up)),
        )

    @property
    def worker_running(self) -> bool:
        return self.client.connected

    @property
    def worker(self) -> Literal["running", "not answering", "absent"]:
        if not self.client.connected:
            return "absent"
        return "running" if self.client.answers else "not answering"

    def report(self, vehicle_id: int) -> VehicleReport:
        """What is known of a vehicle now; may be called from any thread."""
        return VehicleReport(worker=self.client.answers, status=self.hub.vehicle(vehicle_id))

    async def beat(self) -> None:
        """Publish periodically whether the worker is there, until cancelled."""
        while True:
            await asyncio.sleep(BEAT_S)
            self.hub.publish(LinkState(worker=self.client.answers))

    def _on_message(self, message: FromWorker) -> None:
        if isinstance(message, Telemetry | FlightPhase | VehicleStatus):
            self.hub.publish(message)


@asynccontextmanager
async def live_link(data_dir: Path, database: Database) -> AsyncIterator[Live]:
    """Run the live link from the start to the end of the web process."""
    live = Live(data_dir)
    tail = OutboxTail(database, _on_loop(asyncio.get_running_loop(), live.hub.publish))
    await asyncio.to_thread(tail.start)
    running = [asyncio.create_task(work) for work in (live.client.run(), live.client.watch(), live.beat())]
    try:
        yield live
    finally:
        live.hub.close()
        for task in running:
            task.cancel()
        for task in running:
            with suppress(asyncio.CancelledError):
                await task
        await asyncio.to_thread(tail.stop)


def _on_loop(loop: asyncio.AbstractEventLoop, call: Callable[[T], None]) -> Callable[[T], None]:
    """Wrap a call so that it may be made from any thread; calls after the loop has ended are dropped."""

    def later(item: T) -> None:
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(call, item)

    return later
