"""Motion capture over MAVLink: ODOMETRY and VISION_POSITION_ESTIMATE, on the vehicle's link or another."""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Final

from app.autopilots.dialects import COMMON, Message, is_known, number
from app.core.clock import Clock
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.altitude_sources import SILENT_S, AltitudeSource, Pose
from app.vehicles.mavlink.link import Received
from app.vehicles.mavlink.transports import Peer, open_transport
from app.vehicles.mocap.addresses import StreamAddress

_UP_FRAMES: Final = frozenset({4, 13, 15, 17, 19, 21})
"""Local frames of MAV_FRAME whose third axis points up (ENU and FLU; 13 to 19 are deprecated)."""
RECEIVED_WITHIN_S: Final = 2.0
_SYSTEM: Final = 255
_COMPONENT: Final = 190
_READ_S: Final = 0.1
_LOST: Final = -1.0
"""ODOMETRY's quality when odometry has failed; 0: not reported."""


def _odometry(message: Message) -> Pose:
    up = 1.0 if int(number(message, "frame_id")) in _UP_FRAMES else -1.0
    values = tuple(number(message, field) for field in ("x", "y", "z", "vx", "vy", "vz"))
    # In MAVLink 1 the message has no quality.
    failed = "quality" in message.get_fieldnames() and number(message, "quality") == _LOST
    return Pose(number(message, "time_usec") / 1e6, up * values[2], values, not failed)


def _vision(message: Message) -> Pose:
    values = tuple(number(message, field) for field in ("x", "y", "z", "roll", "pitch", "yaw"))
    return Pose(number(message, "usec") / 1e6, -values[2], values, tracking_valid=True)


READERS: Final[Mapping[str, Callable[[Message], Pose]]] = {"ODOMETRY": _odometry, "VISION_POSITION_ESTIMATE": _vision}


class OdometrySource(AltitudeSource):
    """Odometry among the messages passed to `on_message`. Only the message type that arrives first is used, because
    two alternating estimates would not be one stream."""

    def __init__(self, name: str, clock: Clock) -> None:
        super().__init__(name)
        self._clock = clock
        self._kind = ""
        self._received_s = clock.now_s()

    @property
    def trouble(self) -> str:
        if (silent_s := self._clock.now_s() - self._received_s) > SILENT_S:
            return f"No {self.name} was received for {silent_s:.0f} s."
        newest = self.newest
        return f"The {self.name} has failed." if newest is not None and not newest.tracking_valid else ""

    def on_message(self, received: Received) -> None:
        message, arrived_s = received.message, received.received_s
        kind = message.get_type()
        if kind not in READERS or kind != (self._kind or kind):
            return
        self._kind, self._received_s = kind, arrived_s
        self.put(READERS[kind](message), arrived_s)


class StreamSource(OdometrySource):
    """Odometry on its own link, received in its own thread. Nothing is sent; the first peer that sends odometry is
    used."""

    def __init__(self, address: StreamAddress, clock: Clock) -> None:
        """Wait for the first odometry. Raises LinkError if the address cannot be opened, VehicleError if none
        arrives."""
        super().__init__(f"odometry at {address}", clock)
        self._transport = open_transport(address.link)
        self._codec = COMMON.codec(system=_SYSTEM, component=_COMPONENT)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=str(address), daemon=True)
        self._thread.start()
        try:
            self._await_odometry(address)
        except BaseException:
            self.close()
            raise

    @property
    def trouble(self) -> str:
        return super().trouble if self._thread.is_alive() else f"Reception of {self.name} has stopped."

    def on_message(self, received: Received) -> None:
        """Ignore messages of the vehicle's link."""

    def close(self) -> None:
        """Close the link; calling it again has no effect."""
        if not self._closing.is_set():
            self._closing.set()
            self._transport.wake()
        self._thread.join()

    def _await_odometry(self, address: StreamAddress) -> None:
        until_s = time.monotonic() + RECEIVED_WITHIN_S
        while self.newest is None:
            if time.monotonic() > until_s:
                raise VehicleError(
                    f"No ODOMETRY and no VISION_POSITION_ESTIMATE arrived at {address} within {RECEIVED_WITHIN_S:g} s.",
                    hint="Check that the motion capture's bridge runs and sends to this computer's port.",
                )
            time.sleep(_READ_S / 10.0)

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                for data, peer in self._transport.read(_READ_S):
                    self._process_data(data, peer)
        finally:
            self._transport.close()

    def _process_data(self, data: bytes, peer: Peer) -> None:
        is_unknown = self._transport.remote is None
        if self._transport.remote not in (None, peer):
            return
        codec = COMMON.codec(system=_SYSTEM, component=_COMPONENT) if is_unknown else self._codec
        messages = [message for message in codec.parse(data) if is_known(message)]
        if is_unknown and any(message.get_type() in READERS for message in messages):
            self._transport.remote = peer
        now_s = self._clock.now_s()
        for message in messages:
            super().on_message(Received(message, now_s))
