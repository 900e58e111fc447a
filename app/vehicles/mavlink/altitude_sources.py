"""Second source of altitude in addition to the vehicle's own, such as motion capture: its poses as samples on our
clock, with repetitions marked, and these on the vehicle's datum.

A record contains both: `altitude_m` is the scored one, `altitude_2_m` the other.
"""

import math
import statistics
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.link import Received

SILENT_S: Final = 1.0
KEPT: Final = 20_000
"""Maximum number of samples that wait for `take`; beyond it the oldest are dropped."""

_WINDOW_S: Final = 60.0
"""Longer than a flight, so that the same latency is subtracted throughout."""
_RESTART_S: Final = 1.0
"""A source whose clock goes back by more than this has restarted; if by less, a packet was late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSample:
    """One sample of a source.

    `received_s`: time of receipt by the clock passed to the source, which also stamps the vehicle's messages;
    `measured_s`: time of the measurement on the same clock, up to a constant latency, without variable delays;
    `altitude_m`: positive up from the source's own zero; `tracking_valid`: false if the source reports that it does not
    track the vehicle; `advances`: false if it repeats an old frame.
    """

    received_s: float
    measured_s: float
    altitude_m: float
    tracking_valid: bool
    advances: bool


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose at a time of the source's clock; altitude is positive up from the source's zero; `values` are all components
    that it sent."""

    time_s: float
    altitude_m: float
    values: tuple[float, ...]
    tracking_valid: bool


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


class AltitudeSource:
    """Second source of altitude, which receives poses in its own thread or through `on_message`; no method waits.

    Poses are queued as samples; one thread may `put` while another takes. A pose is new if its time has advanced and it
    differs from the previous one in at least one value, where a missing one (NaN) equals another: measured poses always
    differ, but a system that has lost a body may repeat the last pose. The altitudes are converted to the vehicle's
    datum by their values on the ground.
    """

    def __init__(self, name: str) -> None:
        self.name: Final = name
        """Description for the operator: what it is and where it is received."""
        # used by both threads, the one that puts and the flight's, which takes
        self._samples: deque[SourceSample] = deque(maxlen=KEPT)
        self.newest: SourceSample | None = None
        """The last sample put, taken or not."""
        # used only by the thread that puts
        self._arrivals = ClockOffset()
        self._time_s = float("-inf")
        self._values: tuple[float, ...] = ()
        # used only by the flight's thread
        self.seen: list[tuple[float, float]] = []
        """The samples of the flight so far, as `SourceSample.measured_s` and altitude (m) on the vehicle's datum."""
        self._rise_m = 0.0

    @property
    def trouble(self) -> str:
        """Reason why no samples arrive, if known; otherwise empty."""
        return ""

    def on_message(self, received: Received) -> None:
        """Process a message of the vehicle's own link; a source with its own link ignores it."""

    def close(self) -> None:
        """Close what is received from, unless it belongs to the vehicle."""

    def put(self, pose: Pose, arrived_s: float) -> None:
        """Add a pose, which arrived at that time of our clock. A non-finite altitude counts as not tracked."""
        time_s = pose.time_s
        later = math.isfinite(time_s) and (time_s > self._time_s or time_s < self._time_s - _RESTART_S)
        sample = SourceSample(
            received_s=arrived_s,
            measured_s=self._arrivals.measured_s(time_s, arrived_s) if later else arrived_s,
            altitude_m=pose.altitude_m,
            tracking_valid=pose.tracking_valid and math.isfinite(pose.altitude_m),
            advances=later and not np.array_equal(pose.values, self._values, equal_nan=True),
        )
        if later:
            self._time_s, self._values = time_s, pose.values
        self.newest = sample
        self._samples.append(sample)

    def take(self) -> list[SourceSample]:
        """Return the samples since the last call, oldest first."""
        return [self._samples.popleft() for _ in range(len(self._samples))]

    def ground_altitudes(self) -> tuple[float, ...]:
        """Return the valid altitudes since the last call, on the source's datum."""
        return tuple(sample.altitude_m for sample in self.take() if sample.tracking_valid and sample.advances)

    def align(self, stood_m: Sequence[float], ground_m: float) -> None:
        """Begin a flight: `stood_m` are the source's altitudes of the vehicle on the ground, which is at `ground_m` on
        the vehicle's datum."""
        self._rise_m = ground_m - statistics.median(stood_m)
        self.seen.clear()
        self.take()

    def take_samples(self) -> list[SecondaryAltitudeReceived]:
        """Return the samples since the last call as events."""
        samples = [(sample, sample.tracking_valid and sample.advances) for sample in self.take()]
        self.seen += [(sample.measured_s, sample.altitude_m + self._rise_m) for sample, is_new in samples if is_new]
        return [
            SecondaryAltitudeReceived(
                altitude_m=sample.altitude_m + self._rise_m, is_new=is_new, now_s=sample.received_s
            )
            for sample, is_new in samples
        ]
