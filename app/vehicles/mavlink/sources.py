"""A second source of altitude beside the vehicle's own, such as motion capture.

A record has both: `altitude_m` is the scored one, `altitude_2_m` the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from app.vehicles.mavlink.link import Received


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSample:
    """What a source saw once.

    `received_s`: by the clock that the source was given, as the vehicle's messages are stamped; `altitude_m`: positive
    up, on the source's own zero, which is compared from the ground on; `tracking_valid`: false where the source says
    that it does not see the vehicle; `advances`: false where it repeats an old frame.
    """

    received_s: float
    altitude_m: float
    tracking_valid: bool
    advances: bool


class Source(Protocol):
    """Hears in a thread of its own, or what it is given; nothing of it ever waits."""

    @property
    def name(self) -> str:
        """For a person: what it is and where it is heard."""
        ...

    @property
    def trouble(self) -> str:
        """Why nothing comes, where the source knows; empty otherwise."""
        ...

    def hear(self, received: Received) -> None:
        """Take in a message of the vehicle's own link; a source with a link of its own passes it over."""
        ...

    def take(self) -> Sequence[SourceSample]:
        """What came since the last call, oldest first."""
        ...

    def close(self) -> None: ...
