"""Fans what happens out to the open event streams of the web process. One event loop only."""

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from app.live.memory import LiveState
from app.live.messages import FlightPhase, PublishedMessage, Telemetry, VehicleLinkState, VehicleStatus, encode

WAITING_CHANGES: Final = 2000
"""Changes a stream may lag behind before it is ended; its client comes back with the last id and misses none."""
WAITING_TELEMETRY: Final = 100
"""Live messages a stream may lag behind before the oldest are dropped: more than 3 s of one flight and its vehicle."""

WRITTEN: Final = 2 * WAITING_TELEMETRY
"""Live messages whose JSON is kept: every stream sends the same, and to write it again for each delays an abort."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One row of the outbox: which thing changed. What it changed to is read over REST."""

    id: int
    topic: str
    entity_id: int
    campaign_id: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkState:
    """Whether the worker can be reached at this moment."""

    worker: bool


Live = PublishedMessage | LinkState


class Subscription:
    """What one stream has still to send: changes all and in order, and first; of telemetry the newest."""

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
        """The stream stops after the item it is sending."""
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
    """Everything that has happened goes to every subscription; nothing waits for a slow one."""

    def __init__(self) -> None:
        self._subscriptions: set[Subscription] = set()
        self._memory = LiveState()
        self._written: dict[int, tuple[PublishedMessage, str]] = {}
        self._open = True

    @contextmanager
    def subscribe(self) -> Iterator[Subscription]:
        """A subscription to whatever comes from now on, and before it to how the vehicles are and what is in the air
        since its command; over at once when the hub is closed."""
        subscription = Subscription()
        for known in self._memory.snapshot():
            subscription.push(known)
        self._subscriptions.add(subscription)
        if not self._open:
            subscription.end()
        try:
            yield subscription
        finally:
            self._subscriptions.discard(subscription)

    @property
    def streams(self) -> int:
        return len(self._subscriptions)

    def vehicles(self, state: VehicleLinkState) -> list[VehicleStatus]:
        """How the vehicles are whose link is in that state."""
        return self._memory.vehicles(state)

    def publish(self, item: Change | Live) -> None:
        match item:
            case Telemetry() | FlightPhase() | VehicleStatus():
                self._memory.take(item)
            case LinkState(worker=False):
                self._memory.forget_all()
        for subscription in self._subscriptions:
            subscription.push(item)

    def text(self, item: PublishedMessage) -> str:
        """Its JSON, written once for all streams."""
        known = self._written.get(id(item))
        if known is None:  # the item is kept with its text, so that its id is nobody else's meanwhile
            known = self._written[id(item)] = item, encode(item).decode().rstrip()
            if len(self._written) > WRITTEN:
                del self._written[next(iter(self._written))]
        return known[1]

    def close(self) -> None:
        """End every stream, so that the server can stop at once."""
        self._open = False
        for subscription in self._subscriptions:
            subscription.end()
