"""Live part of the web process: reads the outbox and the worker's telemetry, and feeds the event streams."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Final, Literal, TypeVar

from app.db.session import Database
from app.live.address import live_address
from app.live.client import LiveClient
from app.live.hub import Hub, LinkState
from app.live.messages import (
    AbortAnswer,
    FlightPhase,
    FromWorker,
    Telemetry,
    VehicleCommandKind,
    VehicleOrderAnswer,
    VehicleStatus,
)
from app.live.tail import OutboxTail

T = TypeVar("T")
BEAT_S: Final = 3.0
"""Interval of a message on every stream, so that a client detects a dead connection by longer silence."""


class Live:
    """The hub of the event streams, and the connection to the worker."""

    def __init__(self, data_dir: Path) -> None:
        self.hub = Hub()
        self.client = LiveClient(
            live_address(data_dir), on_message=self._heard, on_link=lambda up: self.hub.publish(LinkState(worker=up))
        )

    @property
    def worker_running(self) -> bool:
        return self.client.connected

    @property
    def worker(self) -> Literal["running", "not answering", "absent"]:
        if not self.client.connected:
            return "absent"
        return "running" if self.client.answers else "not answering"

    async def abort(self, trial_id: int, reason: str) -> AbortAnswer:
        """Abort a flight directly at the worker, without the database. Raises LinkDownError when it cannot be
        reached."""
        return await self.client.abort(trial_id, reason)

    async def send_vehicle_command(self, vehicle_id: int, order: VehicleCommandKind, reason: str) -> VehicleOrderAnswer:
        """Send land or motors off directly to the worker. Raises LinkDownError when it cannot be reached."""
        return await self.client.order(vehicle_id, order, reason)

    async def beat(self) -> None:
        """Publish periodically whether the worker is there, until cancelled."""
        while True:
            await asyncio.sleep(BEAT_S)
            self.hub.publish(LinkState(worker=self.client.answers))

    def close(self) -> None:
        """End every stream."""
        self.hub.close()

    def _heard(self, message: FromWorker) -> None:
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
        live.close()
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
