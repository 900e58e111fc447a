"""A simulated drone on a link: the loop that carries bytes and keeps vehicle time in step with the clock."""

import threading
from typing import Final

from app.core.clock import Clock
from app.vehicles.mavlink.transports import Transport
from app.vehicles.simdrone.body import TICK_S
from app.vehicles.simdrone.drone import Drone

LARGEST_LAG_S: Final = 2.0
"""Vehicle time that a busy machine may still catch up; what is more is lost, and the drone's clock late by it."""
TICKS_AT_ONCE: Final = 8
"""Ticks between two looks at the link when there is time to catch up."""
_SHORTEST_WAIT_S: Final = 0.0005


class Server:
    """Runs one drone on one transport until it is stopped. The transport is closed by its owner."""

    def __init__(self, drone: Drone, transport: Transport, clock: Clock) -> None:
        self._drone = drone
        self._transport = transport
        self._clock = clock
        self._stopping = threading.Event()
        self.lost_s = 0.0
        """Vehicle time lost because the machine was too slow for this speed."""

    def run(self) -> None:
        """Until `stop`. Raises VehicleError when the simulation broke down."""
        start_s = self._clock.now_s()
        while not self._stopping.is_set():
            behind_s = self._clock.now_s() - start_s - self._drone.time_s
            if behind_s > LARGEST_LAG_S:
                self.lost_s += behind_s - LARGEST_LAG_S
                start_s += behind_s - LARGEST_LAG_S
                behind_s = LARGEST_LAG_S
            self._hear(self._clock.wall_s(TICK_S - behind_s))
            for _ in range(min(int(behind_s / TICK_S), TICKS_AT_ONCE)):
                self._send(self._drone.tick())

    def stop(self) -> None:
        """Make `run` return soon; from any thread or a signal handler."""
        self._stopping.set()
        self._transport.wake()

    def _hear(self, wait_s: float) -> None:
        """What has come; a wait too short to be worth it is made a little longer."""
        for data, peer in self._transport.read(max(wait_s, _SHORTEST_WAIT_S) if wait_s > 0.0 else 0.0):
            if self._transport.remote is None:
                self._transport.adopt(peer)
            if peer == self._transport.remote:
                self._drone.receive(data)

    def _send(self, frames: list[bytes]) -> None:
        for frame in frames:
            self._transport.write(frame)
