"""Rigid body streamed by Motive or another NatNet server."""

import contextlib
import socket
import struct
import threading
import time
from typing import Final

from natnet import DataFrame, NatNetClient, NatNetError, Version

from app.core.clock import Clock
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.altitude_sources import SILENT_S, AltitudeSource, Pose
from app.vehicles.mocap.addresses import NatNetAddress

ANSWERED_WITHIN_S: Final = 1.0
ATTEMPTS: Final = 3
SEEN_WITHIN_S: Final = 2.0
POLL_S: Final = 0.004
_FIRST_WITH_TRACKING: Final = Version(2, 6)
_GARBLED: Final = (struct.error, ValueError, TypeError, LookupError, OverflowError, MemoryError, NatNetError)
"""Exceptions of the library for packets that violate the protocol."""
_UP: Final = {"y": 1, "z": 2}


class NatNetSource(AltitudeSource):
    """Source of altitude received over NatNet, in its own thread, which polls for packets every 4 ms."""

    def __init__(self, address: NatNetAddress, clock: Clock) -> None:
        """Connect to the server and wait for the body. Raises VehicleError if the server does not answer, no frames
        arrive, or the body is not among those streamed."""
        super().__init__(f"rigid body {address.body} of the motion capture at {address.host}")
        self._address, self._clock = address, clock
        self._streamed_bodies: set[int] = set()
        self._frame_s: float | None = None
        self._client = self._connect()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=str(address), daemon=True)
        try:
            self._await_body()
        except BaseException:
            self._client.shutdown()
            raise
        self._thread.start()

    @property
    def trouble(self) -> str:
        if not self._thread.is_alive():
            return f"Reception of {self.name} has stopped."
        if self._frame_s is not None and (silent_s := time.monotonic() - self._frame_s) > SILENT_S:
            return f"Nothing was received for {self.name} in the last {silent_s:.0f} s."
        newest = self.newest
        return f"The cameras do not see {self.name}." if newest is not None and not newest.tracking_valid else ""

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        self._client.shutdown()

    def _connect(self) -> NatNetClient:
        try:
            server = socket.gethostbyname(self._address.host)
            local = self._address.local or _interface_towards(server, self._address.command_port)
        except OSError as error:
            raise _unreachable(self._address, f"there is no route to it: {error.strerror or error}") from error
        client = NatNetClient(
            server_ip_address=server,
            local_ip_address=local,
            multicast_address=self._address.multicast,
            command_port=self._address.command_port,
            data_port=self._address.data_port,
            use_multicast=bool(self._address.multicast),
        )
        client.on_data_frame_received_event.handlers.append(self._on_frame)
        for _ in range(ATTEMPTS):
            try:
                client.connect(timeout=ANSWERED_WITHIN_S)
            except TimeoutError:
                continue
            except (OSError, *_GARBLED) as error:
                client.shutdown()
                raise _unreachable(self._address, f"{error}") from error
            return client
        raise _unreachable(self._address, f"it did not answer within {ATTEMPTS * ANSWERED_WITHIN_S:g} s")

    def _await_body(self) -> None:
        version = self._client.protocol_version
        if version is None or version < _FIRST_WITH_TRACKING:
            raise VehicleError(
                f"The motion capture at {self._address.host} streams NatNet {version}, which does not report whether "
                f"a body is tracked.",
                hint=f"Set it to NatNet {_FIRST_WITH_TRACKING} or newer.",
            )
        until_s = time.monotonic() + SEEN_WITHIN_S
        while self.newest is None and time.monotonic() < until_s:
            self._process_data()
            time.sleep(POLL_S)
        if self.newest is not None:
            return
        if self._frame_s is None:
            raise VehicleError(
                f"The motion capture at {self._address.host} answers, but sent no frames within {SEEN_WITHIN_S:g} s.",
                hint="Check that Motive streams live, to the multicast group (or unicast) and over the interface that "
                "the address names: &multicast=GROUP or no, &local=ADDRESS of this computer.",
            )
        streamed = ", ".join(map(str, sorted(self._streamed_bodies))) or "none"
        raise VehicleError(
            f"The motion capture at {self._address.host} streams no rigid body {self._address.body}; it streams these "
            f"ids: {streamed}.",
            hint="Use the streaming id that Motive shows with the body, as ?body=ID, and check that it is enabled.",
        )

    def _run(self) -> None:
        while not self._closing.wait(POLL_S):
            self._process_data()

    def _process_data(self) -> None:
        """Process the packets that have arrived. Malformed packets and network failures are treated as silence."""
        with contextlib.suppress(OSError, *_GARBLED):
            self._client.update_sync()

    def _on_frame(self, frame: DataFrame) -> None:
        self._frame_s = time.monotonic()
        for body in frame.rigid_bodies:
            self._streamed_bodies.add(body.id_num)
            if body.id_num == self._address.body:
                up_m, values = body.pos[_UP[self._address.up]], (*body.pos, *body.rot)
                pose = Pose(frame.suffix.timestamp, up_m, values, tracking_valid=bool(body.tracking_valid))
                self.put(pose, self._clock.now_s())


def _interface_towards(server: str, port: int) -> str:
    """Return our address on the route to `server`; no packet is sent. Raises OSError if there is no route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect((server, port))
        return str(probe.getsockname()[0])


def _unreachable(address: NatNetAddress, why: str) -> VehicleError:
    return VehicleError(
        f"The motion capture at {address.host} (NatNet, port {address.command_port}) is not available: {why}.",
        hint="Check that Motive runs there with streaming enabled, and that no firewall blocks its replies.",
    )
