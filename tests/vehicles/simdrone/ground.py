"""A plain ground station on a real UDP socket, of the MAVLink library's own dialect objects and nothing of ours."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Final

from app.vehicles.base import OptionValue
from app.vehicles.mavlink.addresses import parse
from app.vehicles.mavlink.clock import ScaledClock
from app.vehicles.mavlink.transports import open_transport
from app.vehicles.simdrone.autopilots.registry import get_autopilot
from app.vehicles.simdrone.body import new_body
from app.vehicles.simdrone.drone import Drone
from app.vehicles.simdrone.faults import parse_fault
from app.vehicles.simdrone.server import Server

MODULES: Final = {
    "paparazzi": "pymavlink.dialects.v10.paparazzi",
    "ardupilot": "pymavlink.dialects.v20.ardupilotmega",
    "px4": "pymavlink.dialects.v20.common",
}
SPEED: Final = 20.0
WALL_LIMIT_S: Final = 30.0
BOOTED_WITHIN_MS: Final = 1000
STILL: Final[Mapping[str, OptionValue]] = {"scatter": 0.0, "start_latency_s": 0.0}
"""A twin without scatter, that starts at once."""

Heard = Any
"""A message of the library, which has no types."""


@dataclass
class Ground:
    """Speaks to one drone. `heard` holds every message, the oldest first.

    Time is the vehicle's, as its messages tell it, so that a busy machine makes tests slower and not different.
    """

    mavlink: Any
    radio: socket.socket
    drone: tuple[str, int]
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
        self.radio.sendto(data, self.drone)

    def listen(self, seconds: float) -> list[Heard]:
        """Everything not looked at yet, and what comes while so many seconds pass on the vehicle."""
        first = self._looked_at
        self._catch_up()
        until_s = self.elapsed_s + seconds
        with self._patience():
            while self.elapsed_s < until_s:
                self._hear(WALL_LIMIT_S)
        self._looked_at = len(self.heard)
        return self.heard[first:]

    def listen_on_the_wall(self, seconds: float) -> list[Heard]:
        """Everything not looked at yet, and what comes in so many seconds of this computer's clock: for vehicles that
        are silent."""
        first = self._looked_at
        self._catch_up()
        until_s = time.monotonic() + seconds
        while (left_s := until_s - time.monotonic()) > 0.0:
            self._hear(left_s)
        self._looked_at = len(self.heard)
        return self.heard[first:]

    def wait_for(
        self, kind: str, fits: Callable[[Heard], bool] = lambda _message: True, *, within_s: float = 5.0
    ) -> Heard | None:
        """The next message of this kind that fits; None when so many seconds passed on the vehicle without one."""
        self._catch_up()
        until_s = self.elapsed_s + within_s
        with self._patience():
            while True:
                while self._looked_at < len(self.heard):
                    message = self.heard[self._looked_at]
                    self._looked_at += 1
                    if message.get_type() == kind and fits(message):
                        return message
                if self.elapsed_s > until_s:
                    return None
                self._hear(WALL_LIMIT_S)

    def expect(
        self, kind: str, fits: Callable[[Heard], bool] = lambda _message: True, *, within_s: float = 5.0
    ) -> Heard:
        message = self.wait_for(kind, fits, within_s=within_s)
        assert message is not None, f"no such {kind} within {within_s} s"
        return message

    def ask(self, kind: str, answer: str, **fields: float | str | bytes) -> Heard:
        self.send(kind, **fields)
        return self.expect(answer)

    @contextlib.contextmanager
    def _patience(self) -> Iterator[None]:
        self._give_up_at_s = time.monotonic() + WALL_LIMIT_S
        yield

    def _catch_up(self) -> None:
        """Take in what came while nobody listened."""
        self._give_up_at_s = time.monotonic() + WALL_LIMIT_S
        before = -1
        while before != len(self.heard):
            before = len(self.heard)
            self._hear(0.0001)

    def _hear(self, timeout_s: float) -> None:
        assert time.monotonic() < self._give_up_at_s, f"the vehicle's time stands at {self.elapsed_s:.1f} s"
        self.radio.settimeout(max(min(timeout_s, 1.0), 0.0001))
        with contextlib.suppress(TimeoutError):
            for message in self.mav.parse_buffer(self.radio.recv(65536)) or []:
                self.heard.append(message)
                self._tell_time(getattr(message, "time_boot_ms", self._boot_ms))

    def _tell_time(self, boot_ms: int) -> None:
        """A message may be late, or repeat an old time; a reboot starts near 0."""
        if boot_ms < BOOTED_WITHIN_MS < self._boot_ms - boot_ms:
            self._boot_ms = boot_ms
        self.elapsed_s += max(boot_ms - self._boot_ms, 0) / 1000
        self._boot_ms = max(boot_ms, self._boot_ms)


@contextlib.contextmanager
def served(
    autopilot: str,
    link: str,
    *,
    vehicle: str = "twin",
    options: Mapping[str, OptionValue] = STILL,
    faults: Sequence[str] = (),
    speed: float = SPEED,
    seed: int = 1,
) -> Iterator[Drone]:
    """A drone on this link, in a thread of its own."""
    kind = get_autopilot(autopilot)
    body = new_body(vehicle, options, seed=seed)
    drone = Drone(body, lambda fresh: kind.make(fresh, kind.system), [parse_fault(text) for text in faults])
    transport = open_transport(parse(link))
    server = Server(drone, transport, ScaledClock(speed))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        yield drone
    finally:
        server.stop()
        thread.join()
        transport.close()


@contextlib.contextmanager
def flying(autopilot: str, **settings: Any) -> Iterator[Ground]:
    """A drone served on a free port, with the settings of `served`, and a ground station that it speaks to."""
    module = import_module(MODULES[autopilot.partition("-")[0]])
    local = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", 0))
        with served(autopilot, f"udp:127.0.0.1:{radio.getsockname()[1]}@{local}", **settings):
            yield Ground(module, radio, ("127.0.0.1", local))


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def eventually(holds: Callable[[], bool], within_s: float = 20.0) -> None:
    """Raises AssertionError when it did not come to hold in so many seconds of this computer's clock."""
    until_s = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < until_s
        time.sleep(0.05)
