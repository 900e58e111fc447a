"""Other senders with the vehicle's ids: the vehicle itself from another port, a second vehicle, or copies of packets.

A single packet says nothing, and a copy of one already received never does.
"""

from dataclasses import dataclass
from typing import Final, Literal

from app.vehicles.mavlink.transports import Peer

INTERVAL_S: Final = 0.2
"""Interval at which a datagram of another peer is parsed while the vehicle is received, so that a flood of them costs
nothing."""
GONE_AFTER_S: Final = 1.5
"""A peer that has sent nothing for this long may have moved to another port of the same host."""
MOVED_AFTER_S: Final = 0.3
"""The same, if the numbers of its packets go on at that port."""
_MOST_PEERS: Final = 32
"""Greatest number of other peers of which a datagram is parsed in the interval."""
_PACKETS: Final = 3
"""Packets of another peer that are evidence of a second vehicle."""
_WITHIN_S: Final = 3.0
_LOST: Final = 64
"""The numbers of a vehicle's packets go on if fewer than this are missing."""

Verdict = Literal["", "moved", "duplicate"]


@dataclass(slots=True)
class _Other:
    first_s: float
    last_s: float
    number: int
    packets: int = 0


class OtherPeers:
    """Peers other than the vehicle's whose datagrams were parsed."""

    def __init__(self) -> None:
        self._checked_s: dict[Peer, float] = {}
        self._others: dict[Peer, _Other] = {}

    def may_check(self, peer: Peer, now_s: float) -> bool:
        """Whether to parse a datagram of another peer now. Each has its own interval, so that one does not hide
        another."""
        recent_s = {each: at_s for each, at_s in self._checked_s.items() if now_s - at_s < INTERVAL_S}
        if peer in recent_s or len(recent_s) >= _MOST_PEERS:
            return False
        self._checked_s = {**recent_s, peer: now_s}
        return True

    def add(self, peer: Peer, sequence: int, now_s: float, *, last_number: int, last_s: float) -> Verdict:
        """Add a packet with the vehicle's ids that is no copy; `last_number` and `last_s` are of the vehicle's last."""
        self._others = {each: other for each, other in self._others.items() if now_s - other.last_s < _WITHIN_S}
        other = self._others.setdefault(peer, _Other(now_s, now_s, sequence))
        other.last_s, other.packets = now_s, other.packets + 1
        if other.first_s > last_s:
            goes_on = 0 < (other.number - last_number) % 256 < _LOST
            return "moved" if goes_on and other.packets > 1 and now_s - last_s > MOVED_AFTER_S else ""
        return "duplicate" if other.packets >= _PACKETS else ""
