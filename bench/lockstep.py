"""A simulated drone in lockstep with its ground side.

The drone's time is the clock of both sides and advances only while the ground side waits, so that the same inputs give
the same packets at the same instants, independent of the machine.
"""

from collections import deque
from typing import Final

from app.simdrone.drone import Drone
from app.vehicles.mavlink.transports import Peer

PEER: Final[Peer] = ("lockstep", 0)


class Lockstep:
    """The ground side's clock and its transport: `MavlinkVehicle(…, clock=lockstep, transport=lockstep)`.

    `muted`: the drone receives, but none of its packets arrive. The drone sends from the address `peer`, and receives
    only what is sent there.
    """

    def __init__(self, drone: Drone) -> None:
        self.drone: Final = drone
        self.muted = False
        self.peer = PEER
        self.remote: Peer | None = PEER
        self._frames: deque[tuple[bytes, Peer]] = deque()

    # ---- the clock of both sides

    def now_s(self) -> float:
        """Return the time since the drone was switched on, s."""
        return self.drone.time_s

    def wait_s(self, seconds: float) -> None:
        """Advance the drone by this time, in whole ticks. Raises VehicleError if the simulation diverged."""
        until_s = self.drone.time_s + seconds
        while self.drone.time_s < until_s:
            self.tick()

    def wall_s(self, seconds: float) -> float:  # noqa: ARG002 - independent of the vehicle's time
        """Return 0: nothing takes wall time."""
        return 0.0

    # ---- the ground side's transport

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:  # noqa: ARG002 - nothing more comes by itself
        frames = list(self._frames)
        self._frames.clear()
        return frames

    def write(self, data: bytes) -> bool:
        if self.remote == self.peer:
            self.drone.receive(data)
        return True

    def wake(self) -> None:
        """Do nothing: no thread waits."""

    def close(self) -> None:
        """Discard the packets that have not been read."""
        self._frames.clear()

    # ----

    def tick(self) -> None:
        """Advance the drone by one tick."""
        frames = self.drone.tick()
        if not self.muted:
            for frame in self.arriving(frames):
                self.deliver(frame, self.peer)

    def deliver(self, frame: bytes, peer: Peer) -> None:
        """Let a packet arrive from this address."""
        self._frames.append((frame, peer))

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        """Return the packets of one tick that arrive; subclasses override it to disturb the link."""
        return frames
