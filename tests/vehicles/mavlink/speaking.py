"""The other end of a link: a socket of the operating system and a vehicle's MAVLink identity."""

import socket
from types import TracebackType
from typing import Final, Self

from app.autopilots.dialects import Dialect, FieldValue, Message
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.link import Link, Received
from tests.ports import free_port
from tests.waiting import Waits, wait_for

LOOPBACK: Final = "127.0.0.1"
"""Far longer than anything on the loopback interface takes."""


class FakeVehicleEndpoint:
    """The vehicle's end of a UDP link: sends given messages and records what it receives."""

    def __init__(
        self,
        dialect: Dialect,
        *,
        system: int = 31,
        component: int = 1,
        key: bytes | None = None,
        host: str = LOOPBACK,
    ) -> None:
        self.dialect = dialect
        self.codec = dialect.codec(system=system, component=component, signing_key=key)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((host, 0))
        self.ground = (LOOPBACK, free_port())
        self.frames: list[bytes] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.socket.close()

    @property
    def port(self) -> int:
        port: int = self.socket.getsockname()[1]
        return port

    @property
    def address(self) -> Address:
        """Where a ground station reaches it, speaking from the one port that it sends to."""
        return Address("udp", LOOPBACK, self.port, self.ground[1])

    @property
    def ground_address(self) -> Address:
        """Where a ground station waits for it."""
        return Address("udpin", *self.ground)

    def frame(self, kind: str, **fields: FieldValue) -> bytes:
        return self.codec.pack(self.dialect.message(kind, fields))

    def say(self, kind: str, **fields: FieldValue) -> None:
        self.send(self.frame(kind, **fields))

    def send(self, datagram: bytes) -> None:
        self.socket.sendto(datagram, self.ground)

    def beat(self) -> None:
        self.send(heartbeat(self))

    def hear(self, timeout_s: float | None = None) -> list[Message]:
        """The messages of the next datagram, none after the time-out."""
        self.socket.settimeout(Waits.at_most_s if timeout_s is None else timeout_s)
        try:
            frame = self.socket.recv(4096)
        except TimeoutError:
            return []
        self.frames.append(frame)
        return self.codec.parse(frame)


def heartbeat(speaker: FakeVehicleEndpoint, *, autopilot: int = 3, kind: int = 2) -> bytes:
    """A frame saying that this is a quadrotor flown by ArduPilot, unless told otherwise."""
    return speaker.frame(
        "HEARTBEAT", type=kind, autopilot=autopilot, base_mode=0, custom_mode=0, system_status=3, mavlink_version=3
    )


def position(time_boot_ms: int, z: float = 0.0) -> dict[str, FieldValue]:
    """The fields of LOCAL_POSITION_NED."""
    return {"time_boot_ms": time_boot_ms, "x": 0.0, "y": 0.0, "z": z, "vx": 0.0, "vy": 0.0, "vz": 0.0}


def collect(link: Link, count: int) -> list[Received]:
    """The next `count` messages of the link, or more."""
    found: list[Received] = []
    wait_for(f"{count} messages", lambda: len(found) >= count, lambda: found.extend(link.receive(0.1)))
    return found
