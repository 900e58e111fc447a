"""What a stream of poses says, as samples of altitude: put on our clock, and whether each says anything new."""

import math
from collections import deque
from typing import Final

from app.vehicles.mavlink.altitude_sources import SourceSample

SILENT_S: Final = 1.0
KEPT: Final = 20_000
"""Samples kept for a program that does not ask for them; then the oldest are dropped."""

_WINDOW_S: Final = 60.0
"""Longer than a flight, so that the latency taken off is one and the same in all of it."""
_RESTART_S: Final = 1.0
"""A source whose clock goes back by so much has started anew; by less, a packet came late."""


class ClockOffset:
    """A source's time stamps on our clock, as if every message had travelled as fast as the fastest of the last minute:
    without what the network and a busy computer hold back."""

    def __init__(self) -> None:
        self._fastest: deque[tuple[float, float]] = deque()
        """Time stamps with arrival minus time stamp, both rising: each is the least of those from it on."""

    def seen_s(self, time_s: float, arrived_s: float) -> float:
        """When what was stamped `time_s` and came at `arrived_s` would have come at its fastest."""
        offset_s = arrived_s - time_s
        if self._fastest and time_s < self._fastest[-1][0] - _RESTART_S:
            self._fastest.clear()
        while self._fastest and self._fastest[-1][1] >= offset_s:
            self._fastest.pop()
        self._fastest.append((time_s, offset_s))
        while self._fastest[0][0] < time_s - _WINDOW_S:
            self._fastest.popleft()
        return time_s + self._fastest[0][1]


class PoseStream:
    """Poses in, samples out; one thread may put while another takes.

    A pose says something new when its time has advanced and it is not, to the last bit, the one before: cameras never
    see the same twice, but a system that has lost a body may go on to repeat where it was.
    """

    def __init__(self) -> None:
        self._samples: deque[SourceSample] = deque(maxlen=KEPT)
        self._arrivals = ClockOffset()
        self._time_s = float("-inf")
        self._pose: tuple[float, ...] = ()
        self.newest: SourceSample | None = None
        """The last sample that came, whether it was taken or not."""

    def put(
        self, altitude_m: float, pose: tuple[float, ...], *, time_s: float, arrived_s: float, tracking_valid: bool
    ) -> None:
        """`time_s` by the source's clock, `arrived_s` by ours. An altitude that is not finite is none."""
        later = math.isfinite(time_s) and (time_s > self._time_s or time_s < self._time_s - _RESTART_S)
        sample = SourceSample(
            received_s=arrived_s,
            seen_s=self._arrivals.seen_s(time_s, arrived_s) if later else arrived_s,
            altitude_m=altitude_m,
            tracking_valid=tracking_valid and math.isfinite(altitude_m),
            advances=later and not _is_same(pose, self._pose),
        )
        if later:
            self._time_s, self._pose = time_s, pose
        self.newest = sample
        self._samples.append(sample)

    def take(self) -> list[SourceSample]:
        """What came since the last call, oldest first."""
        return [self._samples.popleft() for _ in range(len(self._samples))]


def _is_same(pose: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """To the last bit, where a number that is missing (NaN) is as missing as another."""
    return len(pose) == len(other) and all(
        a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(pose, other, strict=True)
    )
