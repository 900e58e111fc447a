"""A simulated drone: an autopilot with its body and faults, and its service on a link."""

import threading
from collections.abc import Callable, Sequence
from typing import Final

from app.autopilots.dialects import Codec
from app.autopilots.simulated.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body, OutgoingMessage, SimulatedAutopilot
from app.core.clock import Clock
from app.simdrone.faults import Faults, PlannedFault
from app.simdrone.motion_capture import MocapOutput, MotionCapture
from app.vehicles.mavlink.transports import Transport

BOOT_S: Final = 2.0
"""Silence after a reboot."""


class Drone:
    """A drone whose time advances in ticks of TICK_S. `switch_on(body)` returns an autopilot after its start. Motion
    capture of the body is sent by `outlet`."""

    def __init__(
        self,
        body: Body,
        switch_on: Callable[[Body], SimulatedAutopilot],
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
        """Time since it was switched on, s."""
        return self._ticks * TICK_S

    def inject_fault(self, fault: str, duration_s: float = float("inf")) -> None:
        """Begin a fault of `FAULTS` with the next tick."""
        self._faults.add(PlannedFault(fault, None, self.time_s + duration_s))

    def receive(self, data: bytes) -> None:
        """Process bytes received over the link."""
        if not self._faults.receives_nothing and self.time_s >= self._silent_until_s:
            self.autopilot.receive(data)

    def tick(self) -> list[bytes]:
        """Advance by one tick; return the packets sent. Raises VehicleError if the simulation diverged."""
        self._faults.update(self.time_s, self._takeoff_s, self)
        self._ticks += 1
        seen = self._outlet.send(self.cameras.advance(self.time_s, self.body.altitude_m)) if self._outlet else []
        if self.time_s < self._silent_until_s:
            self.body.advance(TICK_STEPS, MOTORS_OFF)
            return []
        messages = self._faults.messages([*self.autopilot.tick(), *seen])
        if self._takeoff_s is None and self.autopilot.took_off:
            self._takeoff_s = self.time_s
        return self._faults.frames([self._packed(message) for message in messages])

    def reboot(self) -> None:
        """Restart the autopilot in any state of the body; its faults persist."""
        before, self.autopilot = self.autopilot, self._switch_on(self.body)
        self.autopilot.restore_persistent(before)
        self.autopilot.refuses_arming = before.refuses_arming
        self.autopilot.ignores_parameters = before.ignores_parameters
        self._codecs.clear()
        self._silent_until_s = self.time_s + BOOT_S

    def _packed(self, message: OutgoingMessage) -> bytes:
        system = message.system or self.autopilot.system
        key = (message.counter, system)
        if key not in self._codecs:
            self._codecs[key] = self.autopilot.dialect.codec(system=system, component=self.autopilot.component)
        return self._codecs[key].pack(self.autopilot.dialect.message(message.kind, message.fields))


CATCH_UP_S: Final = 2.0
TICKS_AT_ONCE: Final = 8
"""Maximum number of ticks between two reads of the link while catching up."""
_SHORTEST_WAIT_S: Final = 0.0005


class Server:
    """Runs one drone on one transport until it is stopped. The owner of the transport closes it.

    A lag of vehicle time of up to `catch_up_s` is caught up on a busy machine; a longer one is lost, and the drone's
    clock stays late.
    """

    def __init__(self, drone: Drone, transport: Transport, clock: Clock, *, catch_up_s: float = CATCH_UP_S) -> None:
        self._drone = drone
        self._transport = transport
        self._clock = clock
        self._catch_up_s = catch_up_s
        self._stopping = threading.Event()
        self.lost_s = 0.0
        """Vehicle time lost because the machine was too slow for this speed."""

    def run(self) -> None:
        """Run until `stop`. Raises VehicleError if the simulation diverged."""
        start_s = self._clock.now_s()
        while not self._stopping.is_set():
            behind_s = self._clock.now_s() - start_s - self._drone.time_s
            lost_s = max(0.0, behind_s - self._catch_up_s)
            self.lost_s += lost_s
            start_s += lost_s
            behind_s -= lost_s
            self._receive(self._clock.wall_s(TICK_S - behind_s))
            for _ in range(min(int(behind_s / TICK_S), TICKS_AT_ONCE)):
                self._send(self._drone.tick())

    def stop(self) -> None:
        """Make `run` return soon; from any thread or a signal handler."""
        self._stopping.set()
        self._transport.wake()

    def _receive(self, wait_s: float) -> None:
        """Receive from the link; very short waits are rounded up."""
        for data, peer in self._transport.read(max(wait_s, _SHORTEST_WAIT_S) if wait_s > 0.0 else 0.0):
            if self._transport.remote is None:
                self._transport.adopt(peer)
            if peer == self._transport.remote:
                self._drone.receive(data)

    def _send(self, frames: list[bytes]) -> None:
        for frame in frames:
            self._transport.write(frame)
