"""A simulated drone: an autopilot on its body, with its faults, from bytes to bytes; served on a link, or in lock-step
with its ground side.

In lock-step the drone's time is the clock of both, and passes only while the ground waits: whatever the machine does
meanwhile, the same inputs give the same packets at the same instants.
"""

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from app.core.clock import Clock
from app.simdrone.body import MOTORS_OFF, TICK_S, TICK_STEPS, Autopilot, Body, OutgoingMessage
from app.simdrone.faults import Faults, PlannedFault
from app.simdrone.motion_capture import MocapOutput, MotionCapture
from app.vehicles.mavlink.dialects import Codec
from app.vehicles.mavlink.transports import Peer, Transport

BOOT_S: Final = 2.0
"""Silence after a reboot."""


class Drone:
    """Time passes in ticks of TICK_S; `switch_on(body)` gives an autopilot fresh from its start. What motion capture
    sees of the body leaves by `outlet`."""

    def __init__(
        self,
        body: Body,
        switch_on: Callable[[Body], Autopilot],
        faults: Sequence[PlannedFault] = (),
        outlet: MocapOutput | None = None,
    ) -> None:
        self.body = body
        self.cameras = MotionCapture()
        self._outlet = outlet
        self.autopilot = switch_on(body)
        self._switch_on = switch_on
        self._faults = Faults(faults)
        self._codecs: dict[tuple[str, int], Codec] = {}
        self._ticks = 0
        self._silent_until_s = 0.0
        self._takeoff_s: float | None = None

    @property
    def time_s(self) -> float:
        """Since it was switched on."""
        return self._ticks * TICK_S

    def inject_fault(self, fault: str, duration_s: float = float("inf")) -> None:
        """Let a fault of `FAULTS` set in with the next tick."""
        self._faults.add(PlannedFault(fault, None, self.time_s + duration_s))

    def receive(self, data: bytes) -> None:
        """What came over the link."""
        if not self._faults.is_deaf and self.time_s >= self._silent_until_s:
            self.autopilot.receive(data)

    def tick(self) -> list[bytes]:
        """Let one tick pass; the packets that leave. Raises VehicleError when the simulation broke down."""
        self._faults.update(self.time_s, self._takeoff_s, self)
        self._ticks += 1
        seen = self._outlet.send(self.cameras.look(self.time_s, self.body.altitude_m)) if self._outlet else []
        if self.time_s < self._silent_until_s:
            self.body.advance(TICK_STEPS, MOTORS_OFF)
            return []
        letters = self._faults.letters([*self.autopilot.tick(), *seen])
        if self._takeoff_s is None and self.autopilot.took_off:
            self._takeoff_s = self.time_s
        return self._faults.frames([self._packed(letter) for letter in letters])

    def reboot(self) -> None:
        """Start the autopilot anew, in whatever state the body is; what is wrong with it stays wrong."""
        before, self.autopilot = self.autopilot, self._switch_on(self.body)
        self.autopilot.restore_persistent(before)
        self.autopilot.refuses_arming = before.refuses_arming
        self.autopilot.ignores_parameters = before.ignores_parameters
        self._codecs.clear()
        self._silent_until_s = self.time_s + BOOT_S

    def _packed(self, letter: OutgoingMessage) -> bytes:
        system = letter.system or self.autopilot.system
        key = (letter.counter, system)
        if key not in self._codecs:
            self._codecs[key] = self.autopilot.dialect.codec(system=system, component=self.autopilot.component)
        return self._codecs[key].pack(self.autopilot.dialect.message(letter.kind, letter.fields))


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
