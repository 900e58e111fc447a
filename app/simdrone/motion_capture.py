"""Motion capture as a simulated drone is seen by it: what cameras in its room make out, and three ways to say so."""

import random
import socket
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from app.simdrone.body import OutgoingMessage
from app.vehicles.mavlink.dialects import COMMON, FieldValue
from app.vehicles.mavlink.transports import LinkError, Transport, open_transport
from app.vehicles.mocap.addresses import NatNetAddress, OdometryAddress, SourceAddress, StreamAddress

RATE_HZ: Final = 100.0
NOISE_M: Final = 0.001
LATENCY_S: Final = 0.02
DRIFT_M_S: Final = 0.1

Version = tuple[int, int, int, int]
NAT_NET: Final[Version] = (4, 1, 0, 0)

_CONNECT: Final = 0
_SERVER_INFO: Final = 1
_FRAME: Final = 7
_TICKS_HZ: Final = 10_000_000
_SYSTEM: Final = 1
_COMPONENT: Final = 197


@dataclass(frozen=True, slots=True)
class MocapFrame:
    """What the cameras saw once: the body's place, x north, y east, z up, and when by their own clock."""

    frame: int
    time_s: float
    position_m: tuple[float, float, float]
    tracked: bool


class MotionCapture:
    """Look 100 times a second, and say it 20 ms later."""

    def __init__(self, seed: int = 1) -> None:
        self._random = random.Random(seed)  # noqa: S311  noise
        self._late: deque[MocapFrame] = deque()
        self._frame = 0
        self._drift_m = 0.0
        self.blind = False
        """A fault: the body is not tracked, and its last place is repeated."""
        self.stuck = False
        """A fault: the last frame is sent again and again."""
        self.drifts = False
        """A fault: the altitude goes away from the true one, by 0.1 m/s."""
        self._last = MocapFrame(0, 0.0, (0.0, 0.0, 0.0), tracked=False)

    def look(self, time_s: float, altitude_m: float) -> list[MocapFrame]:
        """What is said in the tick that ends at `time_s`; the body stands or hovers over one spot."""
        frame = int(time_s * RATE_HZ)
        if frame > self._frame:
            self._frame = frame
            self._late.append(self._see(time_s, altitude_m))
        due = []
        while self._late and time_s >= self._late[0].time_s + LATENCY_S:
            due.append(self._late.popleft())
        return [self._last] * len(due) if self.stuck else due

    def _see(self, time_s: float, altitude_m: float) -> MocapFrame:
        self._drift_m += DRIFT_M_S / RATE_HZ if self.drifts else 0.0
        x, y, noise = (self._random.gauss(0.0, NOISE_M) for _ in range(3))
        seen = (x, y, altitude_m + self._drift_m + noise)
        glimpse = MocapFrame(self._frame, time_s, self._last.position_m if self.blind else seen, not self.blind)
        self._last = self._last if self.stuck else glimpse
        return glimpse


class MocapOutput(Protocol):
    """Says what the cameras saw."""

    def send(self, glimpses: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        """Send it; what is to go over the drone's own link is returned."""
        ...

    def close(self) -> None: ...


class VehicleLinkOutput:
    """VISION_POSITION_ESTIMATE among the drone's own messages, as every version of MAVLink carries it; it cannot say
    that the body is not tracked, so nothing is said then."""

    def send(self, glimpses: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        return [
            OutgoingMessage("VISION_POSITION_ESTIMATE", _vision(each), "cameras") for each in glimpses if each.tracked
        ]

    def close(self) -> None:
        """Nothing was opened."""


class OdometryOutput:
    """ODOMETRY on a link of its own."""

    def __init__(self, address: StreamAddress) -> None:
        self._transport: Transport = open_transport(address.link)
        self._codec = COMMON.codec(system=_SYSTEM, component=_COMPONENT)

    def send(self, glimpses: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        for glimpse in glimpses:
            self._transport.write(self._codec.pack(COMMON.message("ODOMETRY", _odometry(glimpse))))
        return []

    def close(self) -> None:
        self._transport.close()


class NatNetServer:
    """Motive as its clients see it: answers who it is, and streams one rigid body in the manner of NatNet 4.1."""

    def __init__(self, address: NatNetAddress, version: Version = NAT_NET) -> None:
        """`version` is the protocol's that it says it speaks. Raises LinkError when the port is taken."""
        self._address, self._version = address, version
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((address.host, address.command_port))
            self._socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address.host))
        except OSError as error:
            self._socket.close()
            raise LinkError(
                f"NatNet's port {address.command_port} of {address.host} could not be opened: {error.strerror}.",
                hint="See that no other program has it, or choose another with &command_port=.",
            ) from error
        group = (address.multicast, address.data_port)
        self._listeners: set[tuple[str, int]] = {group} if address.multicast else set()

    def send(self, glimpses: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        self._answer()
        for glimpse in glimpses:
            packet = frame_packet(glimpse, self._address.body, up=self._address.up)
            for listener in self._listeners:
                self._send(packet, listener)
        return []

    def close(self) -> None:
        self._socket.close()

    def _answer(self) -> None:
        while True:
            try:
                data, peer = self._socket.recvfrom(2048)
            except (BlockingIOError, ConnectionError):
                return
            if data[:2] == struct.pack("<H", _CONNECT):
                self._send(server_packet(self._version), peer)
            if not self._address.multicast:
                self._listeners.add(peer)

    def _send(self, packet: bytes, listener: tuple[str, int]) -> None:
        try:
            self._socket.sendto(packet, listener)
        except OSError:  # it has gone
            self._listeners.discard(listener)


def open_outlet(address: SourceAddress) -> MocapOutput:
    """Raises LinkError when it cannot be opened."""
    match address:
        case NatNetAddress():
            return NatNetServer(address)
        case OdometryAddress():
            return VehicleLinkOutput()
        case StreamAddress():
            return OdometryOutput(address)


def server_packet(version: Version) -> bytes:
    """NAT_SERVERINFO: name, version of the application, version of the protocol, the clock's rate."""
    return _packet(_SERVER_INFO, struct.pack("<256s4B4BQ", b"Gainline sim-drone", 3, 1, 0, 0, *version, _TICKS_HZ))


def frame_packet(glimpse: MocapFrame, body: int, *, up: str) -> bytes:
    """NAT_FRAMEOFDATA of NatNet 4.1: every list with its count and its size in bytes, only that of bodies filled."""
    north, east, height = glimpse.position_m
    place = (north, height, east) if up == "y" else (north, -east, height)
    pose = struct.pack("<I3f4ffH", body, *place, 0.0, 0.0, 0.0, 1.0, 0.0002, int(glimpse.tracked))
    empty = struct.pack("<II", 0, 0)
    ticks = round(glimpse.time_s * _TICKS_HZ)
    suffix = struct.pack("<IIdQQQHI", 0, 0, glimpse.time_s, ticks, ticks, ticks, 0, 0)
    bodies = struct.pack("<II", 1, len(pose)) + pose
    return _packet(_FRAME, struct.pack("<I", glimpse.frame) + 2 * empty + bodies + 5 * empty + suffix)


def _packet(kind: int, payload: bytes) -> bytes:
    return struct.pack("<HH", kind, len(payload)) + payload


def _vision(glimpse: MocapFrame) -> dict[str, FieldValue]:
    x, y, z = glimpse.position_m
    return {"usec": round(glimpse.time_s * 1e6), "x": x, "y": y, "z": -z, "roll": 0.0, "pitch": 0.0, "yaw": 0.0}


def _odometry(glimpse: MocapFrame) -> dict[str, FieldValue]:
    x, y, z = glimpse.position_m
    unknown = [float("nan"), *(0.0 for _ in range(20))]
    still = dict.fromkeys(("vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed"), 0.0)
    return {
        "time_usec": round(glimpse.time_s * 1e6),
        "frame_id": 1,
        "child_frame_id": 12,
        "x": x,
        "y": y,
        "z": -z,
        "q": [1.0, 0.0, 0.0, 0.0],
        **still,
        "pose_covariance": unknown,
        "velocity_covariance": unknown,
        "quality": 100 if glimpse.tracked else -1,
    }
