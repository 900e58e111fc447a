"""Distribution of events to the open event streams of the web process, with the present state for streams that join
late: telemetry so far of each running flight, and the vehicles' status. For one event loop only.
"""

import asyncio
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

from app.live.messages import FlightPhase, PublishedMessage, Telemetry, VehicleLinkState, VehicleStatus, encode

WAITING_CHANGES: Final = 2000
"""A stream that lags behind by more changes is ended; its client reconnects with the last id and misses none."""
WAITING_TELEMETRY: Final = 100
"""A stream that lags behind by more live messages loses the oldest; more than 3 s of one flight and its vehicle."""

WRITTEN: Final = 2 * WAITING_TELEMETRY
"""Live messages whose JSON is cached: every stream sends the same, and encoding it for each would delay an abort."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One row of the outbox: which thing changed. Clients read its new state over REST."""

    id: int
    topic: str
    entity_id: int
    campaign_id: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkState:
    """Whether the worker can be reached at this moment."""

    worker: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleReport:
    """What is known of a vehicle at this moment: whether the worker answers, and the newest status with its age."""

    worker: bool
    status: VehicleStatus | None = None


Live = PublishedMessage | LinkState


class Subscription:
    """Queue of one stream: all changes in order and first, then the newest telemetry."""

    def __init__(self) -> None:
        self._changes: deque[Change] = deque()
        self._live: deque[Live] = deque(maxlen=WAITING_TELEMETRY)
        self._ready = asyncio.Event()
        self._open = True

    def push(self, item: Change | Live) -> None:
        if isinstance(item, Change):
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

    async def __aiter__(self) -> AsyncIterator[Change | Live]:
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
        self._written: dict[int, tuple[PublishedMessage, str]] = {}
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

    def publish(self, item: Change | Live) -> None:
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

    def text(self, item: PublishedMessage) -> str:
        """JSON of a message, encoded once for all streams."""
        known = self._written.get(id(item))
        if known is None:  # the item is kept with its text, so that no other object can get its id
            known = self._written[id(item)] = item, encode(item).decode().rstrip()
            if len(self._written) > WRITTEN:
                del self._written[next(iter(self._written))]
        return known[1]

    def close(self) -> None:
        """End every stream, so that the server can stop at once."""
        self._open = False
        for subscription in self._subscriptions:
            subscription.end()
