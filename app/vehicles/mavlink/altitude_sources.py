"""A second source of altitude beside the vehicle's own, such as motion capture.

A record has both: `altitude_m` is the scored one, `altitude_2_m` the other.
"""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.link import Received


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSample:
    """What a source saw once.

    `received_s`: by the clock that the source was given, as the vehicle's messages are stamped; `seen_s`: when it saw
    that, on the same clock but for a constant latency, whatever held the message up; `altitude_m`: positive up, on the
    source's own zero, which is compared from the ground on; `tracking_valid`: false where the source says that it does
    not see the vehicle; `advances`: false where it repeats an old frame.
    """

    received_s: float
    seen_s: float
    altitude_m: float
    tracking_valid: bool
    advances: bool


class AltitudeSource(Protocol):
    """Hears in a thread of its own, or what it is given; nothing of it ever waits."""

    @property
    def name(self) -> str:
        """For a person: what it is and where it is heard."""
        ...

    @property
    def trouble(self) -> str:
        """Why nothing comes, where the source knows; empty otherwise."""
        ...

    def on_message(self, received: Received) -> None:
        """Take in a message of the vehicle's own link; a source with a link of its own passes it over."""
        ...

    def take(self) -> Sequence[SourceSample]:
        """What came since the last call, oldest first."""
        ...

    def close(self) -> None: ...


class AlignedAltitudeSource:
    """A source whose altitudes are put on the vehicle's datum: both stood on the ground at the same time.

    `seen` are the sightings of the flight so far, as `SourceSample.seen_s` and altitude (m).
    """

    def __init__(self, source: AltitudeSource) -> None:
        self.source = source
        self.seen: list[tuple[float, float]] = []
        self._rise_m = 0.0

    def discard_pending(self) -> None:
        """Pass over what came while nobody needed it."""
        self.source.take()

    def ground_altitudes(self) -> tuple[float, ...]:
        """The altitudes at which it saw the vehicle since the last call."""
        return tuple(sample.altitude_m for sample in self.source.take() if sample.tracking_valid and sample.advances)

    def align(self, stood_m: Sequence[float], ground_m: float) -> None:
        """A flight begins: `stood_m` is where it saw the vehicle stand, which is at `ground_m` on its own datum."""
        self._rise_m = ground_m - statistics.median(stood_m)
        self.seen.clear()
        self.discard_pending()

    def take_samples(self) -> list[SecondaryAltitudeReceived]:
        """What it saw since the last call."""
        samples = [(sample, sample.tracking_valid and sample.advances) for sample in self.source.take()]
        self.seen += [(sample.seen_s, sample.altitude_m + self._rise_m) for sample, is_new in samples if is_new]
        return [
            SecondaryAltitudeReceived(
                altitude_m=sample.altitude_m + self._rise_m, is_new=is_new, now_s=sample.received_s
            )
            for sample, is_new in samples
        ]
