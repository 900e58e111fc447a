"""What is found out from the packets of a link: its statistics, and whether two vehicles use the same system id.

Two vehicles that send at the same time use every sequence number twice, with different contents, each going on where
it was, and report two times. Packets that are repeated, late or out of order do neither; a vehicle that restarts uses
numbers again, but does not go on with the former ones. Copies of packets, however late, are no evidence.

Another sender with the ids of the vehicle is the vehicle itself from another port, a second vehicle, or a source of
copies of its packets. A single packet of it says nothing, and a copy of one already received never does.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final, Literal

from app.vehicles.mavlink.transports import Peer

NUMBERS: Final = 256
MAX_SEQUENCE_LEAD: Final = 128
"""A sequence number further ahead than this is an old one, because packets may overtake each other."""
WITHIN_S: Final = 2.0
PIECES: Final = 6
"""Pieces of evidence within `WITHIN_S` that make a duplicate certain."""
LASTS_S: Final = 0.12
"""Shorter evidence is of one stream that began fast, because its rate is not known yet."""
REMEMBERED_S: Final = 5.0
"""Time for which a duplicate stays certain after the evidence ends."""

_SAME_CLOCK_S: Final = 0.6
"""Two time stamps are of one clock if they differ from the elapsed time by less than this, the delay of packets."""
_RATE_OVER_S: Final = 1.0
_PEAK_OVER_S: Final = 10.0
_AT_ONCE: Final = 16
_LATE: Final = 100
"""An unused number less than this behind the latest is of a delayed packet."""
_OF_A_ROUND: Final = 0.9
"""Share of a cycle of sequence numbers after which one may be used again."""
_LOST: Final = 32
"""A sequence of numbers goes on with one less than this ahead of its last."""
_SEQUENCES: Final = 8
_REMEMBERED_FRAMES_S: Final = 5.0
"""Longer than a copy is late, shorter than the same frame takes to be sent again."""

INTERVAL_S: Final = 0.2
"""Interval at which a datagram of another peer is parsed while the vehicle is received, so that a flood of them costs
nothing."""
GONE_AFTER_S: Final = 1.5
"""A peer that has sent nothing for this long may have moved to another port of the same host."""
MOVED_AFTER_S: Final = 0.3
"""The same, if the numbers of its packets go on at that port."""
_MOST_PEERS: Final = 32
"""Greatest number of other peers of which a datagram is parsed in the interval."""
_PEERS_PACKETS: Final = 3
"""Packets of another peer that are evidence of a second vehicle."""
_PEERS_WITHIN_S: Final = 3.0
"""A peer that has sent no such packet for this long is forgotten, and counted from one again."""
_PEERS_LOST: Final = 64
"""The numbers of a vehicle's packets go on at another port if fewer than this are missing."""

Verdict = Literal["", "moved", "duplicate"]
"""What a packet of another peer shows: nothing yet, that the vehicle has moved there, or that there is a second one."""


@dataclass(slots=True)
class LinkHealth:
    """Statistics of a link; times in seconds of the link's clock."""

    received: int = 0
    """Messages of the vehicle that the dialect knows."""
    lost: int = 0
    """Messages missing by the vehicle's sequence numbers."""
    foreign: int = 0
    """Datagrams of other senders and messages of other systems, all dropped."""
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
        ahead = (number - self._latest.get(component, number - 1)) % NUMBERS
        if 0 < ahead < MAX_SEQUENCE_LEAD:
            self.lost += ahead - 1
            self._latest[component] = number


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
        self._others = {each: other for each, other in self._others.items() if now_s - other.last_s < _PEERS_WITHIN_S}
        other = self._others.setdefault(peer, _Other(now_s, now_s, sequence))
        other.last_s, other.packets = now_s, other.packets + 1
        if other.first_s > last_s:
            goes_on = 0 < (other.number - last_number) % NUMBERS < _PEERS_LOST
            return "moved" if goes_on and other.packets > 1 and now_s - last_s > MOVED_AFTER_S else ""
        return "duplicate" if other.packets >= _PEERS_PACKETS else ""


@dataclass(slots=True)
class _Used:
    at_s: float
    count: int


class DuplicateDetector:
    """Detector for the messages of one component, in the order of receipt."""

    def __init__(self) -> None:
        self._used: dict[int, _Used] = {}
        self._frames: dict[bytes, float] = {}
        self._sequences = _Sequences()
        self._rate = _Rate()
        self._count = 0
        self._at_instant = (float("-inf"), 0)
        self._burst_s = float("-inf")
        self._latest = -1
        self._clocks: dict[int, tuple[float, float]] = {}
        self._clock = 0
        self._repeated_numbers: deque[float] = deque()
        self._clock_changes: deque[float] = deque()
        self._certain_s: float | None = None
        self._why = ""

    def add(self, frame: bytes, number: int, now_s: float, boot_s: float | None, *, is_counted: bool = True) -> bool:
        """Add a message by its whole frame and sequence number, which counts unless the message has another counter;
        `boot_s` is its time stamp, if it has one. Return whether it is a copy."""
        while self._frames and now_s - self._frames[oldest := next(iter(self._frames))] > _REMEMBERED_FRAMES_S:
            del self._frames[oldest]
        is_copy = self._frames.pop(frame, None) is not None
        self._frames[frame] = now_s
        if is_copy:
            return True
        if is_counted and self._add_number(number, now_s) and boot_s is not None:
            self._add_clock(boot_s - now_s, now_s)
        return False

    def has_seen(self, frame: bytes) -> bool:
        """Whether a message is a copy of a recent one."""
        return frame in self._frames

    def reason(self, now_s: float) -> str:
        """Return the evidence for two vehicles; empty without evidence."""
        if self._is_certain(self._repeated_numbers, now_s):
            self._certain_s, self._why = now_s, "Its sequence numbers are repeated with different contents."
        elif self._is_certain(self._clock_changes, now_s):
            self._certain_s, self._why = now_s, "Its messages alternate between two clocks."
        is_recent = self._certain_s is not None and now_s - self._certain_s < REMEMBERED_S
        return self._why if is_recent else ""

    def _is_certain(self, evidence: deque[float], now_s: float) -> bool:
        while evidence and now_s - evidence[0] >= WITHIN_S:
            evidence.popleft()
        return len(evidence) >= PIECES and evidence[-1] - evidence[0] >= LASTS_S

    def _add_number(self, number: int, now_s: float) -> bool:
        """Process a sequence number; return whether the packet is in order, not late."""
        self._count += 1
        self._note_burst(now_s)
        used = self._used.get(number)
        is_taken = used is not None and self._is_of_this_round(used, now_s)
        is_return = self._sequences.is_return(number, now_s)
        ahead = (number - self._latest) % NUMBERS
        if ahead < NUMBERS // 2:
            self._latest = number
            self._rate.pass_on(ahead, now_s)
        behind = NUMBERS - ahead
        is_late = behind <= _LATE and not is_taken
        late = behind if is_late else 0
        self._used[number] = _Used(now_s - late / self._rate.number_hz, self._count - late)
        if is_taken and is_return:
            self._repeated_numbers.append(now_s)
        return not is_late

    def _note_burst(self, now_s: float) -> None:
        """Note when more packets arrive at one instant than are sent at once: it is not known when they were sent."""
        last_s, packets = self._at_instant
        self._at_instant = (now_s, packets + 1 if now_s == last_s else 1)
        self._burst_s = now_s if self._at_instant[1] > _AT_ONCE else self._burst_s

    def _is_of_this_round(self, used: _Used, now_s: float) -> bool:
        """Whether the sequence numbers cannot have completed a cycle since this one was used."""
        if used.at_s <= self._burst_s:
            return False
        round_s = _OF_A_ROUND * NUMBERS / self._rate.number_hz
        return self._count - used.count < _OF_A_ROUND * NUMBERS and now_s - used.at_s < round_s

    def _add_clock(self, offset_s: float, now_s: float) -> None:
        """Process a clock offset; evidence is a return from another clock to a recent one."""
        for clock, (known_s, at_s) in self._clocks.items():
            if abs(offset_s - known_s) < _SAME_CLOCK_S and now_s - at_s < WITHIN_S:
                if clock != self._clock:
                    self._clock_changes.append(now_s)
                    self._clock = clock
                self._clocks[clock] = (offset_s, now_s)
                return
        self._clock = max(self._clocks, default=0) + 1
        recent = {clock: known for clock, known in self._clocks.items() if now_s - known[1] < WITHIN_S}
        self._clocks = {**recent, self._clock: (offset_s, now_s)}


class _Sequences:
    """Last numbers of the recent sequences, in the order of use, the latest first."""

    def __init__(self) -> None:
        self._last: list[tuple[int, float]] = []

    def is_return(self, number: int, now_s: float) -> bool:
        """Assign a number to the nearest sequence; return whether that is not the one that the number before was of."""
        self._last = [(last, at_s) for last, at_s in self._last if now_s - at_s < WITHIN_S][:_SEQUENCES]
        ahead = [(number - last - 1) % NUMBERS for last, _ in self._last]
        nearest = min(range(len(ahead)), key=ahead.__getitem__, default=None)
        is_new = nearest is None or ahead[nearest] >= _LOST
        if nearest is not None and not is_new:
            del self._last[nearest]
        self._last.insert(0, (number, now_s))
        return not is_new and nearest != 0


class _Rate:
    """Greatest recent rate at which sequence numbers are used, including those of lost packets."""

    def __init__(self) -> None:
        self._passed: deque[tuple[float, int]] = deque()
        self._sum = 0
        self._peak = self._former_peak = 1
        self._since_s = float("-inf")

    @property
    def number_hz(self) -> float:
        return max(self._peak, self._former_peak) / _RATE_OVER_S

    def pass_on(self, numbers: int, now_s: float) -> None:
        """Count numbers; of packets that arrive at one instant only some, because they were delayed and sent before."""
        at_once = self._passed[-1][1] if self._passed and self._passed[-1][0] == now_s else 0
        counted = min(numbers, _AT_ONCE - at_once)
        if at_once:
            self._passed[-1] = (now_s, at_once + counted)
        else:
            self._passed.append((now_s, counted))
        self._sum += counted
        while now_s - self._passed[0][0] > _RATE_OVER_S:
            self._sum -= self._passed.popleft()[1]
        if now_s - self._since_s > _PEAK_OVER_S:
            self._since_s, self._former_peak, self._peak = now_s, self._peak, 1
        self._peak = max(self._peak, self._sum)
