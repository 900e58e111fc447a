"""A plain ground station, of the MAVLink library's own dialect objects and nothing of ours.

It is in lockstep with a simulated drone, whose time passes while the ground listens, or on a real UDP socket.
"""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Final, Protocol

from app.autopilots.simulated.body import TICK_S, Make
from app.core.clock import Clock, ScaledClock
from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import CATCH_UP_S, Drone, Server, parse_fault
from app.simdrone.motion_capture import MocapOutput
from app.vehicles.base import OptionValue
from app.vehicles.mavlink.addresses import parse
from app.vehicles.mavlink.transports import open_transport
from bench.lockstep import Lockstep
from tests.waiting import Waits

MODULES: Final = {
    "paparazzi": "pymavlink.dialects.v10.paparazzi",
    "ardupilot": "pymavlink.dialects.v20.ardupilotmega",
    "px4": "pymavlink.dialects.v20.common",
}
SPEED: Final = 20.0
BOOTED_WITHIN_MS: Final = 1000
HOLDS_AFTER_S: Final = 11.5
STILL: Final[Mapping[str, OptionValue]] = {"scatter": 0.0, "start_latency_s": 0.0}
"""A twin without scatter, that starts at once."""

Heard = Any
"""A message of the library, which has no types."""


class Wire(Protocol):
    """Carries bytes to one drone and back."""

    def send(self, data: bytes) -> None: ...
    def receive(self) -> list[bytes]:
        """What has come, waiting for it a little."""
        ...

    def now_s(self) -> float:
        """The clock by which it is waited."""
        ...

    @property
    def patience_s(self) -> float:
        """On that clock: nothing that is waited for takes as long."""
        ...


class LockstepWire:
    """Whoever waits lets the drone live."""

    patience_s = 120.0

    def __init__(self, lockstep: Lockstep) -> None:
        self.now_s = lockstep.now_s
        self.lockstep = lockstep

    def send(self, data: bytes) -> None:
        self.lockstep.write(data)

    def receive(self) -> list[bytes]:
        self.lockstep.wait_s(TICK_S)
        return [data for data, _ in self.lockstep.read(0.0)]


class UdpWire:
    """A socket of this computer, bound to its own port."""

    def __init__(self, drone: tuple[str, int]) -> None:
        self._drone = drone
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(1.0)
        self.now_s = time.monotonic
        self.patience_s = Waits.at_most_s

    @property
    def port(self) -> int:
        port: int = self._socket.getsockname()[1]
        return port

    def send(self, data: bytes) -> None:
        self._socket.sendto(data, self._drone)

    def receive(self) -> list[bytes]:
        try:
            return [self._socket.recv(65536)]
        except TimeoutError:
            return []

    def close(self) -> None:
        self._socket.close()


@dataclass
class Ground:
    """Speaks to one drone. `heard` holds every message, the oldest first.

    Time is the vehicle's, as its messages tell it, so that a busy machine makes tests slower and not different.
    """

    mavlink: Any
    wire: Wire
    heard: list[Heard] = field(default_factory=list)
    elapsed_s: float = 0.0
    """Vehicle time told so far, through reboots."""
    _boot_ms: int = 0
    _looked_at: int = 0

    def __post_init__(self) -> None:
        self.mav = self.mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self.mav.robust_parsing = True

    def send(self, kind: str, **fields: float | str | bytes) -> None:
        self.send_bytes(self.pack(kind, **fields))

    def pack(self, kind: str, **fields: float | str | bytes) -> bytes:
        encoded = {name: value.encode() if isinstance(value, str) else value for name, value in fields.items()}
        frame: bytes = getattr(self.mavlink, f"MAVLink_{kind.lower()}_message")(**encoded).pack(self.mav)
        self.mav.seq = (self.mav.seq + 1) % 256
        return frame

    def send_bytes(self, data: bytes) -> None:
        self.wire.send(data)

    def listen(self, seconds: float) -> list[Heard]:
        """Everything not looked at yet, and what comes while so many seconds pass on the vehicle."""
        first = self._looked_at
        until_s, give_up_at_s = self.elapsed_s + seconds, self._limit_s()
        while self.elapsed_s < until_s:
            self._hear(give_up_at_s)
        self._looked_at = len(self.heard)
        return self.heard[first:]

    def listen_to_silence(self, seconds: float) -> list[Heard]:
        """Everything not looked at yet, and what comes in so many seconds of the wire's clock: for vehicles that tell
        no time."""
        first, until_s = self._looked_at, self.wire.now_s() + seconds
        while self.wire.now_s() < until_s:
            self._hear(until_s + seconds)
        self._looked_at = len(self.heard)
        return self.heard[first:]

    def wait_for(
        self, kind: str, fits: Callable[[Heard], bool] = lambda _message: True, *, within_s: float = 5.0
    ) -> Heard | None:
        """The next message of this kind that fits; None when so many seconds passed on the vehicle without one."""
        until_s, give_up_at_s = self.elapsed_s + within_s, self._limit_s()
        while True:
            while self._looked_at < len(self.heard):
                message = self.heard[self._looked_at]
                self._looked_at += 1
                if message.get_type() == kind and fits(message):
                    return message
            if self.elapsed_s > until_s:
                return None
            self._hear(give_up_at_s)

    def expect(
        self, kind: str, fits: Callable[[Heard], bool] = lambda _message: True, *, within_s: float = 5.0
    ) -> Heard:
        message = self.wait_for(kind, fits, within_s=within_s)
        assert message is not None, f"no such {kind} within {within_s} s"
        return message

    def ask(self, kind: str, answer: str, **fields: float | str | bytes) -> Heard:
        self.send(kind, **fields)
        return self.expect(answer)

    def _limit_s(self) -> float:
        return self.wire.now_s() + self.wire.patience_s

    def _hear(self, give_up_at_s: float) -> None:
        assert self.wire.now_s() < give_up_at_s, f"the vehicle's time stands at {self.elapsed_s:.1f} s"
        for data in self.wire.receive():
            for message in self.mav.parse_buffer(data) or []:
                self.heard.append(message)
                self._tell_time(getattr(message, "time_boot_ms", self._boot_ms))

    def _tell_time(self, boot_ms: int) -> None:
        """A message may be late, or repeat an old time; a reboot starts near 0."""
        if boot_ms < BOOTED_WITHIN_MS < self._boot_ms - boot_ms:
            self._boot_ms = boot_ms
        self.elapsed_s += max(boot_ms - self._boot_ms, 0) / 1000
        self._boot_ms = max(boot_ms, self._boot_ms)


def switched_on(
    autopilot: str,
    *,
    vehicle: str = "twin",
    options: Mapping[str, OptionValue] = STILL,
    faults: Sequence[str] = (),
    seed: int = 1,
    outlet: MocapOutput | None = None,
    make: Make | None = None,
) -> Drone:
    """`make` takes the place of what the autopilot of that name is made by."""
    kind = get_autopilot(autopilot)
    body = new_body(vehicle, options, seed=seed)
    switch_on = make or kind.make
    return Drone(body, lambda fresh: switch_on(fresh, kind.system), [parse_fault(text) for text in faults], outlet)


@contextlib.contextmanager
def served(
    autopilot: str, link: str, *, clock: Clock | None = None, catch_up_s: float = CATCH_UP_S, **settings: Any
) -> Iterator[Drone]:
    """A drone on this link, in a separate thread, with the settings of `switched_on`."""
    drone = switched_on(autopilot, **settings)
    transport = open_transport(parse(link))
    server = Server(drone, transport, clock or ScaledClock(SPEED), catch_up_s=catch_up_s)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield drone
    finally:
        server.stop()
        thread.join()
        transport.close()


def dialect_of(autopilot: str) -> Any:
    return import_module(MODULES[autopilot.partition("-")[0]])


def flying(autopilot: str, *, settled: bool = True, **settings: Any) -> Ground:
    """A ground station in lockstep with a drone, with the settings of `switched_on`, and the telemetry that ground
    stations ask an ArduPilot for. A `settled` Paparazzi has been on until its plan came to "Holding point"."""
    lockstep = Lockstep(switched_on(autopilot, **settings))
    if settled and autopilot.startswith("paparazzi"):
        lockstep.muted = True
        lockstep.wait_s(HOLDS_AFTER_S)
        lockstep.muted = False
    ground = Ground(dialect_of(autopilot), LockstepWire(lockstep), _boot_ms=round(1000.0 * lockstep.now_s()))
    if autopilot.startswith("ardupilot"):
        rate = {"req_stream_id": 0, "req_message_rate": 4, "start_stop": 1}
        ground.send("REQUEST_DATA_STREAM", target_system=1, target_component=1, **rate)
    return ground
