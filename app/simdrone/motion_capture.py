"""Simulated motion capture of a simulated drone, and three protocols to send it."""

import random
import socket
import struct
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from app.autopilots.dialects import COMMON, FieldValue
from app.autopilots.simulated.body import OutgoingMessage
from app.vehicles.mavlink.transports import LinkError, Transport, open_transport
from app.vehicles.mocap.addresses import NatNetAddress, OdometryAddress, SourceAddress, StreamAddress

RATE_HZ: Final = 100.0
NOISE_M: Final = 0.001
LATENCY_S: Final = 0.02
DRIFT_M_S: Final = 0.1

Version = tuple[int, int, int, int]

_CONNECT: Final = 0
_SERVER_INFO: Final = 1
_FRAME: Final = 7
_TICKS_HZ: Final = 10_000_000


@dataclass(frozen=True, slots=True)
class MocapFrame:
    """One frame: the body's position, x north, y east, z up, m, and its time by the motion capture's clock, s."""

    frame: int
    time_s: float
    position_m: tuple[float, float, float]
    tracked: bool


class MotionCapture:
    """Motion capture at 100 Hz with a latency of 20 ms."""

    def __init__(self, seed: int = 1) -> None:
        self._random = random.Random(seed)  # noqa: S311  noise
        self._late: deque[MocapFrame] = deque()
        self._frame = 0
        self._drift_m = 0.0
        self.blind = False
        """Fault: the body is not tracked, and its last position is repeated."""
        self.stuck = False
        """Fault: the last frame is repeated."""
        self.drifts = False
        """Fault: the altitude drifts from the true one by 0.1 m/s."""
        self._last = MocapFrame(0, 0.0, (0.0, 0.0, 0.0), tracked=False)

    def advance(self, time_s: float, altitude_m: float) -> list[MocapFrame]:
        """Return the frames sent in the tick that ends at `time_s`; the body's horizontal position is constant."""
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
        sample = MocapFrame(self._frame, time_s, self._last.position_m if self.blind else seen, not self.blind)
        self._last = self._last if self.stuck else sample
        return sample


class MocapOutput(Protocol):
    """Output of motion capture frames."""

    def send(self, samples: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        """Send frames; return the messages to send over the drone's own link."""

    def close(self) -> None: ...


class VehicleLinkOutput:
    """Output as VISION_POSITION_ESTIMATE among the drone's own messages, which every version of MAVLink has. It cannot
    report that the body is not tracked, so nothing is sent then."""

    def send(self, samples: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        return [
            OutgoingMessage("VISION_POSITION_ESTIMATE", _vision(each), "cameras") for each in samples if each.tracked
        ]

    def close(self) -> None:
        """Do nothing: no resource is open."""


class OdometryOutput:
    """Output as ODOMETRY on a separate link."""

    def __init__(self, address: StreamAddress) -> None:
        self._transport: Transport = open_transport(address.link)
        self._codec = COMMON.codec(system=1, component=197)

    def send(self, samples: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        for sample in samples:
            self._transport.write(self._codec.pack(COMMON.message("ODOMETRY", _odometry(sample))))
        return []

    def close(self) -> None:
        self._transport.close()


class NatNetServer:
    """Simulated Motive: replies to connection requests, and streams one rigid body in NatNet 4.1."""

    def __init__(self, address: NatNetAddress, version: Version = (4, 1, 0, 0)) -> None:
        """Open the server; `version` is the protocol version that it reports. Raises LinkError if the port is in
        use."""
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
                hint="Check that no other program uses it, or choose another with &command_port=.",
            ) from error
        group = (address.multicast, address.data_port)
        self._listeners: set[tuple[str, int]] = {group} if address.multicast else set()

    def send(self, samples: Sequence[MocapFrame]) -> list[OutgoingMessage]:
        self._answer()
        for sample in samples:
            packet = frame_packet(sample, self._address.body, up=self._address.up)
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
                # name, application version, protocol version, clock rate
                info = struct.pack("<256s4B4BQ", b"Gainline sim-drone", 3, 1, 0, 0, *self._version, _TICKS_HZ)
                self._send(_packet(_SERVER_INFO, info), peer)
            if not self._address.multicast:
                self._listeners.add(peer)

    def _send(self, packet: bytes, listener: tuple[str, int]) -> None:
        try:
            self._socket.sendto(packet, listener)
        except OSError:  # the listener has closed
            self._listeners.discard(listener)


def open_outlet(address: SourceAddress) -> MocapOutput:
    """Open the output for a source's address. Raises LinkError if it cannot be opened."""
    match address:
        case NatNetAddress():
            return NatNetServer(address)
        case OdometryAddress():
            return VehicleLinkOutput()
        case StreamAddress():
            return OdometryOutput(address)


def frame_packet(sample: MocapFrame, body: int, *, up: str) -> bytes:
    """Return NAT_FRAMEOFDATA of NatNet 4.1: lists with count and size in bytes, all empty except that of bodies."""
    north, east, height = sample.position_m
    place = (north, height, east) if up == "y" else (north, -east, height)
    pose = struct.pack("<I3f4ffH", body, *place, 0.0, 0.0, 0.0, 1.0, 0.0002, int(sample.tracked))
    empty = struct.pack("<II", 0, 0)
    ticks = round(sample.time_s * _TICKS_HZ)
    suffix = struct.pack("<IIdQQQHI", 0, 0, sample.time_s, ticks, ticks, ticks, 0, 0)
    bodies = struct.pack("<II", 1, len(pose)) + pose
    return _packet(_FRAME, struct.pack("<I", sample.frame) + 2 * empty + bodies + 5 * empty + suffix)


def _packet(kind: int, payload: bytes) -> bytes:
    return struct.pack("<HH", kind, len(payload)) + payload


def _vision(sample: MocapFrame) -> dict[str, FieldValue]:
    x, y, z = sample.position_m
    return {"usec": round(sample.time_s * 1e6), "x": x, "y": y, "z": -z}


def _odometry(sample: MocapFrame) -> dict[str, FieldValue]:
    x, y, z = sample.position_m
    unknown = [float("nan"), *(0.0 for _ in range(20))]
    return {
        **COMMON.zeros("ODOMETRY"),
        "time_usec": round(sample.time_s * 1e6),
        "frame_id": 1,
        "child_frame_id": 12,
        "x": x,
        "y": y,
        "z": -z,
        "q": [1.0, 0.0, 0.0, 0.0],
        "pose_covariance": unknown,
        "velocity_covariance": unknown,
        "quality": 100 if sample.tracked else -1,
    }
