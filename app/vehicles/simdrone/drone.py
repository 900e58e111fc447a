"""A simulated drone: an autopilot on its body, with what is wrong with it, from bytes to bytes."""

from collections.abc import Callable, Sequence
from typing import Final

from app.vehicles.mavlink.dialects import Codec
from app.vehicles.simdrone.autopilots.base import Autopilot, OutgoingMessage
from app.vehicles.simdrone.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body
from app.vehicles.simdrone.cameras import MocapOutput, MotionCapture
from app.vehicles.simdrone.faults import Faults, PlannedFault

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
