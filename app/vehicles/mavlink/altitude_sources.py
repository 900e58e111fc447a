"""Second source of altitude in addition to the vehicle's own, such as motion capture.

A record contains both: `altitude_m` is the scored one, `altitude_2_m` the other.
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.link import Received


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


class AltitudeSource(Protocol):
    """Second source of altitude, which receives in its own thread or through `on_message`; no method waits."""

    @property
    def name(self) -> str:
        """Description for the operator: what it is and where it is received."""

    @property
    def trouble(self) -> str:
        """Reason why no samples arrive, if known; otherwise empty."""

    def on_message(self, received: Received) -> None:
        """Process a message of the vehicle's own link; a source with its own link ignores it."""

    def take(self) -> Sequence[SourceSample]:
        """Return the samples since the last call, oldest first."""

    def close(self) -> None: ...


class AlignedAltitudeSource:
    """Source whose altitudes are converted to the vehicle's datum by their values on the ground.

    `seen` are the samples of the flight so far, as `SourceSample.measured_s` and altitude (m) on the vehicle's datum.
    """

    def __init__(self, source: AltitudeSource) -> None:
        self.source = source
        self.seen: list[tuple[float, float]] = []
        self._rise_m = 0.0

    def discard_pending(self) -> None:
        """Discard the samples since the last call."""
        self.source.take()

    def ground_altitudes(self) -> tuple[float, ...]:
        """Return the valid altitudes since the last call, on the source's datum."""
        return tuple(sample.altitude_m for sample in self.source.take() if sample.tracking_valid and sample.advances)

    def align(self, stood_m: Sequence[float], ground_m: float) -> None:
        """Begin a flight: `stood_m` are the source's altitudes of the vehicle on the ground, which is at `ground_m` on
        the vehicle's datum."""
        self._rise_m = ground_m - statistics.median(stood_m)
        self.seen.clear()
        self.discard_pending()

    def take_samples(self) -> list[SecondaryAltitudeReceived]:
        """Return the samples since the last call as events."""
        samples = [(sample, sample.tracking_valid and sample.advances) for sample in self.source.take()]
        self.seen += [(sample.measured_s, sample.altitude_m + self._rise_m) for sample, is_new in samples if is_new]
        return [
            SecondaryAltitudeReceived(
                altitude_m=sample.altitude_m + self._rise_m, is_new=is_new, now_s=sample.received_s
            )
            for sample, is_new in samples
        ]
