"""Statistics of a link: what was received, lost, damaged and sent."""

from dataclasses import dataclass
from typing import Final

MAX_SEQUENCE_LEAD: Final = 128
"""A sequence number further ahead than this is an old one, because packets may overtake each other."""


@dataclass(slots=True)
class LinkHealth:
    """Statistics of a link; times in seconds of the link's clock."""

    received: int = 0
    """Messages of the vehicle that the dialect knows."""
    lost: int = 0
    """Messages missing by the vehicle's sequence numbers."""
    bad: int = 0
    """Sections of bad data: wrong checksums, wrong signatures."""
    foreign: int = 0
    """Datagrams of other senders and messages of other systems, all dropped."""
    overrun: int = 0
    """Messages dropped because `receive` was not called."""
    sent: int = 0
    unsent: int = 0
    """Messages that could not be sent: no peer yet, no connection, full buffer."""
    last_packet_s: float | None = None
    last_heartbeat_s: float | None = None


class LossCounter:
    """Counts missing messages by the sequence numbers of each component."""

    def __init__(self, uncounted: tuple[str, ...]) -> None:
        """`uncounted` are the prefixes of the names of messages with a separate sequence counter."""
        self._uncounted = uncounted
        self._latest: dict[int, int] = {}
        self.lost = 0

    def count(self, kind: str, component: int, number: int) -> None:
        """Count a message by its sequence number, 0 to 255; late and repeated messages are ignored."""
        if kind.startswith(self._uncounted):
            return
        ahead = (number - self._latest.get(component, number - 1)) % 256
        if 0 < ahead < MAX_SEQUENCE_LEAD:
            self.lost += ahead - 1
            self._latest[component] = number
