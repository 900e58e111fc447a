"""Conversion of a stream of poses into samples of altitude on our clock, with repetitions marked."""

import math
from collections import deque
from typing import Final

from app.vehicles.mavlink.altitude_sources import SourceSample

SILENT_S: Final = 1.0
KEPT: Final = 20_000
"""Maximum number of samples that wait for `take`; beyond it the oldest are dropped."""

_WINDOW_S: Final = 60.0
"""Longer than a flight, so that the same latency is subtracted throughout."""
_RESTART_S: Final = 1.0
"""A source whose clock goes back by more than this has restarted; if by less, a packet was late."""


class ClockOffset:
    """Conversion of a source's time stamps to our clock with the latency of the fastest message of the last minute,
    which removes the variable delays of the network and of a busy computer."""

    def __init__(self) -> None:
        self._fastest: deque[tuple[float, float]] = deque()
        """Time stamps, each with its arrival minus its time stamp, both increasing: a monotonic queue of minima."""

    def measured_s(self, time_s: float, arrived_s: float) -> float:
        """Return when a message stamped `time_s` that arrived at `arrived_s` would have arrived with least latency."""
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
    """Queue that converts poses into samples; one thread may put while another takes.

    A pose is new if its time has advanced and it differs from the previous one in at least one bit: measured poses
    always differ, but a system that has lost a body may repeat the last pose.
    """

    def __init__(self) -> None:
        self._samples: deque[SourceSample] = deque(maxlen=KEPT)
        self._arrivals = ClockOffset()
        self._time_s = float("-inf")
        self._pose: tuple[float, ...] = ()
        self.newest: SourceSample | None = None
        """The last sample put, taken or not."""

    def put(
        self, altitude_m: float, pose: tuple[float, ...], *, time_s: float, arrived_s: float, tracking_valid: bool
    ) -> None:
        """Add a pose; `time_s` is by the source's clock, `arrived_s` by ours. A non-finite altitude counts as not
        tracked."""
        later = math.isfinite(time_s) and (time_s > self._time_s or time_s < self._time_s - _RESTART_S)
        sample = SourceSample(
            received_s=arrived_s,
            measured_s=self._arrivals.measured_s(time_s, arrived_s) if later else arrived_s,
            altitude_m=altitude_m,
            tracking_valid=tracking_valid and math.isfinite(altitude_m),
            advances=later and not _is_same(pose, self._pose),
        )
        if later:
            self._time_s, self._pose = time_s, pose
        self.newest = sample
        self._samples.append(sample)

    def take(self) -> list[SourceSample]:
        """Return the samples since the last call, oldest first."""
        return [self._samples.popleft() for _ in range(len(self._samples))]


def _is_same(pose: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Whether two poses are equal bit by bit; NaN (missing) equals NaN."""
    return len(pose) == len(other) and all(
        a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(pose, other, strict=True)
    )
