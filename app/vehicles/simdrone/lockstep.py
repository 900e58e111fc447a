"""A simulated drone and its ground side in one thread: the drone's time is the clock of both, and passes only while
the ground waits. Whatever the machine does meanwhile, the same inputs give the same packets at the same instants."""

from collections import deque
from typing import Final

from app.vehicles.mavlink.transports import Peer
from app.vehicles.simdrone.drone import Drone

PEER: Final[Peer] = ("lockstep", 0)


class Lockstep:
    """The ground side's clock and its transport: `MavlinkVehicle(…, clock=lockstep, transport=lockstep)`.

    `muted`: the drone hears, and nothing that it says arrives.
    """

    remote: Final = PEER

    def __init__(self, drone: Drone) -> None:
        self.drone: Final = drone
        self.muted = False
        self._frames: deque[bytes] = deque()

    # ---- the clock of both sides

    def now_s(self) -> float:
        """Seconds since the drone was switched on."""
        return self.drone.time_s

    def wait_s(self, seconds: float) -> None:
        """Let the drone live for so long, in whole ticks. Raises VehicleError when the simulation broke down."""
        until_s = self.drone.time_s + seconds
        while self.drone.time_s < until_s:
            self.tick()

    def wall_s(self, seconds: float) -> float:  # noqa: ARG002 - whatever the vehicle's time
        """Nothing takes time on the wall."""
        return 0.0

    # ---- the ground side's transport

    def read(self, timeout_s: float) -> list[tuple[bytes, Peer]]:  # noqa: ARG002 - nothing more comes by itself
        heard = [(frame, PEER) for frame in self._frames]
        self._frames.clear()
        return heard

    def write(self, data: bytes) -> bool:
        self.drone.receive(data)
        return True

    def adopt(self, peer: Peer) -> None:
        """There is but one."""

    def wake(self) -> None:
        """Nobody waits."""

    def close(self) -> None:
        """What the drone says from now on is said to nobody."""
        self._frames.clear()

    # ----

    def tick(self) -> None:
        """Let one tick of the drone pass."""
        frames = self.drone.tick()
        if not self.muted:
            self._frames.extend(self.arriving(frames))

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        """What arrives of the packets of one tick: all, unless a link does something to them."""
        return frames
