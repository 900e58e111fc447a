"""A motion-capture system on real UDP sockets: the simulated drone's, moved by hand."""

import threading
import time
from types import TracebackType
from typing import Final, Self

from app.simdrone.motion_capture import MocapOutput, MotionCapture, open_outlet
from app.vehicles.mavlink.altitude_sources import AltitudeSource, SourceSample
from app.vehicles.mocap.addresses import SourceAddress
from tests.waiting import eventually

LOOPBACK: Final = "127.0.0.1"


class FakeMotive:
    """Streams in real time what is `altitude_m` high, from its beginning to its end; its clock begins at `clock_s`."""

    def __init__(self, address: SourceAddress, outlet: MocapOutput | None = None, *, clock_s: float = 0.0) -> None:
        self.cameras = MotionCapture()
        self.altitude_m = 0.0
        self._clock_s = clock_s
        self._outlet = outlet or open_outlet(address)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join()
        self._outlet.close()

    def _run(self) -> None:
        begun_s = time.monotonic() - self._clock_s
        while not self._stopping.wait(0.002):
            self._outlet.send(self.cameras.advance(time.monotonic() - begun_s, self.altitude_m))


def news(source: AltitudeSource, count: int = 10) -> list[SourceSample]:
    """What comes from now on, at least so many samples."""
    source.take()
    heard: list[SourceSample] = []

    def enough() -> bool:
        heard.extend(source.take())
        return len(heard) >= count

    eventually(enough)
    return heard
