"""Live part of the web process: distribution of the outbox, in order and once, and of the worker's telemetry to the
open event streams, with the present state for streams that join late: telemetry so far of each running flight, and the
vehicles' status. For one event loop only.
"""

import asyncio
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import structlog
from sqlalchemy.exc import DBAPIError

from app.common.errors import StorageError
from app.db.models import EventRow
from app.db.outbox import DatabaseWatch, events_after, latest_event_id
from app.db.session import Database
from app.live.link import LiveClient
from app.live.messages import (
    FlightPhase,
    PublishedMessage,
    Telemetry,
    VehicleLinkState,
    VehicleStatus,
    live_address,
)

_log = structlog.get_logger(__name__)

WAITING_CHANGES: Final = 2000
"""A stream that lags behind by more changes is ended; its client reconnects with the last id and misses none."""
WAITING_TELEMETRY: Final = 100
"""A stream that lags behind by more live messages loses the oldest; more than 3 s of one flight and its vehicle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkState:
    """Whether the worker can be reached at this moment."""

    worker: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """What is known of a vehicle at this moment: whether the worker answers, and the newest status with its age."""

    worker: bool
    status: VehicleStatus | None = None


LiveItem = PublishedMessage | LinkState


class Subscription:
    """Queue of one stream: all changes in order and first, then the newest telemetry."""

    def __init__(self) -> None:
        self._changes: deque[EventRow] = deque()
        self._live: deque[LiveItem] = deque(maxlen=WAITING_TELEMETRY)
        self._ready = asyncio.Event()
        self._open = True

    def push(self, item: EventRow | LiveItem) -> None:
        if isinstance(item, EventRow):
            self._changes.append(item)
            if len(self._changes) > WAITING_CHANGES:
                self.end()
        else:
            self._live.append(item)
        self._ready.set()

    def end(self) -> None:
        """End the stream after the item that it is sending."""
        self._open = False
        self._ready.set()

    async def __aiter__(self) -> AsyncIterator[EventRow | LiveItem]:
        while self._open:
            if self._changes:
                yield self._changes.popleft()
            elif self._live:
                yield self._live.popleft()
            else:
                self._ready.clear()
                await self._ready.wait()


class Hub:
    """Sends every event to every subscription; never waits for a slow one.

    It accumulates the telemetry of each flight until it is over, and keeps each vehicle's newest status. `clock_s`
    gives the age of a message when it is sent again: from a worker that hangs, no newer one comes.
    """

    def __init__(self, clock_s: Callable[[], float] = time.monotonic) -> None:
        self._clock_s = clock_s
        self._subscriptions: set[Subscription] = set()
        self._flights: dict[int, tuple[Telemetry, float]] = {}
        self._vehicles: dict[int, tuple[VehicleStatus, float]] = {}
        self._open = True

    @contextmanager
    def subscribe(self) -> Iterator[Subscription]:
        """Subscribe to all events from now on.

        The subscription begins with the vehicles' states and the telemetry of running flights since their command. It
        ends at once when the hub is closed.
        """
        subscription = Subscription()
        for known in self.snapshot():
            subscription.push(known)
        self._subscriptions.add(subscription)
        if not self._open:
            subscription.end()
        try:
            yield subscription
        finally:
            self._subscriptions.discard(subscription)

    def snapshot(self) -> list[PublishedMessage]:
        """One message for each vehicle, and one for each flight with its telemetry since the command, each with its
        age."""
        now_s = self._clock_s()
        vehicles = (replace(status, age_s=now_s - heard_s) for status, heard_s in self._vehicles.values())
        flights = (
            replace(flight, samples=list(flight.samples), age_s=now_s - heard_s)
            for flight, heard_s in self._flights.values()
        )
        return [*vehicles, *flights]

    def vehicle(self, vehicle_id: int) -> VehicleStatus | None:
        """The vehicle's newest status with its age; None if none has come from this worker. May be called from any
        thread."""
        if (known := self._vehicles.get(vehicle_id)) is None:
            return None
        status, heard_s = known
        return replace(status, age_s=self._clock_s() - heard_s)

    def vehicles(self, state: VehicleLinkState) -> list[VehicleStatus]:
        """The newest status of each vehicle whose link is in that state."""
        return [status for status, _ in self._vehicles.values() if status.state == state]

    def publish(self, item: EventRow | LiveItem) -> None:
        match item:
            case VehicleStatus():
                self._vehicles[item.vehicle_id] = item, self._clock_s()
            case FlightPhase(phase="landed" | "ended"):
                self._flights.pop(item.trial_id, None)
            case Telemetry():
                self._flights[item.trial_id] = self._grown(item), self._clock_s()
            case LinkState(worker=False):
                self._flights.clear()
                self._vehicles.clear()
        for subscription in self._subscriptions:
            subscription.push(item)

    def _grown(self, message: Telemetry) -> Telemetry:
        """The message with all earlier samples of the flight."""
        if message.trial_id not in self._flights:
            return replace(message, samples=list(message.samples))
        before, _ = self._flights[message.trial_id]
        before.samples.extend(message.samples)
        return replace(message, samples=before.samples)

    def close(self) -> None:
        """End every stream, so that the server can stop at once."""
        self._open = False
        for subscription in self._subscriptions:
            subscription.end()


BATCH: Final = 500
PAUSE_AFTER_TROUBLE_S: Final = 1.0
LOOK_ANYWAY_S: Final = 5.0


def changes_after(database: Database, event_id: int) -> Iterator[EventRow]:
    """All changes after that event up to now, read in short transactions. They name what changed; clients read its new
    state over REST."""
    while True:
        with database.read() as session:
            batch = events_after(session, event_id, limit=BATCH)
        yield from batch
        if len(batch) < BATCH:
            return
        event_id = batch[-1].id


def follow_outbox(database: Database, last: int, publish: Callable[[EventRow], None], stop: threading.Event) -> None:
    """Call `publish` for every event committed after the `last` one, until `stop` is set."""
    while not stop.is_set():
        try:
            with DatabaseWatch(database.file) as watch:
                while not stop.is_set():
                    for change in changes_after(database, last):
                        publish(change)
                        last = change.id
                    watch.wait(stop, LOOK_ANYWAY_S)
        except (StorageError, DBAPIError) as error:
            _log.error("the outbox cannot be read", why=str(error))
            stop.wait(PAUSE_AFTER_TROUBLE_S)


BEAT_S: Final = 3.0
"""Interval of a message on every stream, so that a client detects a dead connection by longer silence."""


class Live:
    """The hub of the event streams, and the connection to the worker."""

    def __init__(self, data_dir: Path) -> None:
        self.hub = Hub()
        self.client = LiveClient(
            live_address(data_dir),
            on_message=self.hub.publish,
            on_link=lambda up: self.hub.publish(LinkState(worker=up)),
        )

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


@asynccontextmanager
async def live_link(data_dir: Path, database: Database) -> AsyncIterator[Live]:
    """Run the live link from the start to the end of the web process."""
    live = Live(data_dir)
    loop = asyncio.get_running_loop()

    def publish(change: EventRow) -> None:
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(live.hub.publish, change)

    with database.read() as session:
        last = latest_event_id(session)
    stop = threading.Event()
    tail = threading.Thread(target=follow_outbox, args=(database, last, publish, stop), name="outbox", daemon=True)
    tail.start()
    running = [asyncio.create_task(work) for work in (live.client.run(), live.client.watch(), live.beat())]
    try:
        yield live
    finally:
        live.hub.close()
        for task in running:
            task.cancel()
        await asyncio.gather(*running, return_exceptions=True)
        stop.set()
        await asyncio.to_thread(tail.join)
