"""A simulated drone: an autopilot with its body and the faults that are injected into it, and its service on a link."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from app.autopilots.dialects import Codec
from app.autopilots.simulated.body import MOTORS_OFF, TICK_S, TICK_STEPS, Body, OutgoingMessage, SimulatedAutopilot
from app.core.clock import Clock
from app.core.errors import InputError, Problem
from app.core.policy import is_finite
from app.simdrone.fault_kinds import FAULTS, Fault
from app.simdrone.motion_capture import MocapOutput, MotionCapture
from app.vehicles.mavlink.transports import Transport

BOOT_S: Final = 2.0
"""Silence after a reboot."""
_FORM: Final = "NAME[:DURATION]@T, T in seconds after the takeoff command, or NAME[:DURATION]@connect"


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault and its time: `start_s` after the takeoff command, None from the beginning; with an infinite
    `duration_s` it does not end."""

    fault: str
    start_s: float | None
    duration_s: float = float("inf")

    def is_active(self, now_s: float, takeoff_s: float | None) -> bool:
        """Whether it is active at `now_s`; both times are in seconds since the drone was switched on."""
        if self.start_s is None:
            return now_s < self.duration_s
        return takeoff_s is not None and 0.0 <= now_s - takeoff_s - self.start_s < self.duration_s


def parse_fault(text: str) -> PlannedFault:
    """Parse a fault of `_FORM`. Raises InputError with the reason if it is invalid."""
    what, at, when = text.partition("@")
    name, colon, duration = what.partition(":")
    if name not in FAULTS:
        raise _unusable(f"must be one of {', '.join(FAULTS)}, got {name!r}")
    if not at:
        raise _unusable(f"must have a time: {_FORM}")
    start_s = None if when == "connect" else _seconds(when)
    return PlannedFault(name, start_s, _seconds(duration)) if colon else PlannedFault(name, start_s)


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
        self._planned = list(faults)
        self._active: list[tuple[PlannedFault, Fault]] = []
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
        self._planned.append(PlannedFault(fault, None, self.time_s + duration_s))

    def receive(self, data: bytes) -> None:
        """Process bytes received over the link."""
        is_deaf = any(fault.receives_nothing for _, fault in self._active)
        if not is_deaf and self.time_s >= self._silent_until_s:
            self.autopilot.receive(data)

    def tick(self) -> list[bytes]:
        """Advance by one tick; return the packets sent. Raises VehicleError if the simulation diverged."""
        self._begin_and_end_faults()
        self._ticks += 1
        seen = self._outlet.send(self.cameras.advance(self.time_s, self.body.altitude_m)) if self._outlet else []
        if self.time_s < self._silent_until_s:
            self.body.advance(TICK_STEPS, MOTORS_OFF)
            return []
        messages = [*self.autopilot.tick(), *seen]
        for _, fault in self._active:
            messages = fault.transform_messages(messages)
        if self._takeoff_s is None and self.autopilot.took_off:
            self._takeoff_s = self.time_s
        frames = [self._packed(message) for message in messages]
        for _, fault in self._active:
            frames = fault.transform_frames(frames)
        return frames

    def reboot(self) -> None:
        """Restart the autopilot in any state of the body; its faults persist."""
        before, self.autopilot = self.autopilot, self._switch_on(self.body)
        self.autopilot.restore_persistent(before)
        self.autopilot.refuses_arming = before.refuses_arming
        self.autopilot.ignores_parameters = before.ignores_parameters
        self._codecs.clear()
        self._silent_until_s = self.time_s + BOOT_S

    def _begin_and_end_faults(self) -> None:
        """Begin and end faults at their times; each occurs once."""
        now_s, takeoff_s = self.time_s, self._takeoff_s
        for plan in [each for each in self._planned if each.is_active(now_s, takeoff_s)]:
            self._planned.remove(plan)
            self._active.append((plan, FAULTS[plan.fault](self)))
        for entry in [each for each in self._active if not each[0].is_active(now_s, takeoff_s)]:
            self._active.remove(entry)
            entry[1].end()

    def _packed(self, message: OutgoingMessage) -> bytes:
        system = message.system or self.autopilot.system
        key = (message.counter, system)
        if key not in self._codecs:
            self._codecs[key] = self.autopilot.dialect.codec(system=system, component=self.autopilot.component)
        dialect, kind = self.autopilot.dialect, message.kind
        return self._codecs[key].pack(dialect.message(kind, {**dialect.zeros(kind), **message.fields}))


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
                for frame in self._drone.tick():
                    self._transport.write(frame)

    def stop(self) -> None:
        """Make `run` return soon; from any thread or a signal handler."""
        self._stopping.set()
        self._transport.wake()

    def _receive(self, wait_s: float) -> None:
        """Receive from the link; very short waits are rounded up."""
        for data, peer in self._transport.read(max(wait_s, _SHORTEST_WAIT_S) if wait_s > 0.0 else 0.0):
            if self._transport.remote is None:
                self._transport.remote = peer
            if peer == self._transport.remote:
                self._drone.receive(data)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not (is_finite(seconds) and seconds >= 0.0):
        raise _unusable(f"a time must be a number of seconds, 0 or more, got {text!r}")
    return seconds


def _unusable(reason: str) -> InputError:
    return InputError(
        "This fault is not valid.",
        problems=(Problem("fault", reason),),
        hint="For example link-lost:8@6, reboot@5 or no-heartbeat@connect.",
    )
