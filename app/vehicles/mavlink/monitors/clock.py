"""The vehicle's clock, its time since boot: whether it advances, steps or restarts, and how late its positions arrive.

Packets may be late, repeated, in any order, or corrupted: a single one by another clock says nothing. Another clock
that goes on by itself is the sign of a restart.
"""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Position
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan

AHEAD_S: Final = 2.0
"""Greatest gain of the vehicle's clock on ours between two packets, because their latencies may differ."""
_EARLY_S: Final = 0.1
"""Most by which a position may be ahead of the vehicle's clock as it is known by those before it."""
_STEPPED_S: Final = 0.1
"""Time for which positions that are ahead go on alone before their clock is the vehicle's."""
BACK_S: Final = 1.0
"""If the clock goes back by less than this, the packet was late."""
RESTARTED_S: Final = 0.4
"""Time for which another clock goes on alone before it is the vehicle's."""
WRAP_S: Final = 2.0**32 / 1000.0
"""After this time, 49.7 days, `time_boot_ms` begins at 0 again."""
CLOCK_DRIFT: Final = 0.1
"""Share by which the vehicle's clock may be slower than ours."""
_SAME_CLOCK_S: Final = 0.5
_NEAR_WRAP_S: Final = 60.0
FRESH_S: Final = 0.5
"""Greatest age of a sample, since it was sent, that counts as the current position."""
ATTENDED_S: Final = 0.1
"""Longest time before a packet or a sample that it accounts for: delayed by a stall, they may arrive at once, in any
order."""
STUCK_S: Final = 0.25
LOST_S: Final = 0.5
_LONGEST_STEP_S: Final = 0.3
"""A greater step of the clock is not one of the latency."""


def since(before_s: float | None, now_s: float, *, holds: bool) -> float | None:
    """Return since when something `holds` that has held since `before_s`; None if it does not hold."""
    if not holds:
        return None
    return now_s if before_s is None else before_s


def unwrapped(position: Position, newest: Position | None) -> Position:
    """Return the position with a time that continues that of the newest one beyond WRAP_S."""
    near_wrap = newest is not None and newest.time_boot_s > WRAP_S - _NEAR_WRAP_S
    is_wrapped = near_wrap and position.time_boot_s < _NEAR_WRAP_S
    return replace(position, time_boot_s=position.time_boot_s + WRAP_S) if is_wrapped else position


def may_have_begun(time_boot_s: float, passed_s: float) -> bool:
    """Whether a clock with this time can have begun in the `passed_s` since the vehicle was last heard."""
    return time_boot_s <= (1.0 + CLOCK_DRIFT) * passed_s + AHEAD_S


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherClock:
    """Positions by a clock other than the vehicle's so far: the first at `first_s` by our clock, the last at
    `last_s`."""

    first_s: float
    last_s: float
    last: Position

    @property
    def advances(self) -> bool:
        """Whether more than one position is by this clock."""
        return self.last_s > self.first_s

    def goes_on(self, position: Position, now_s: float) -> bool:
        """Whether the position is by this clock."""
        gained_s = position.time_boot_s - self.last.time_boot_s
        return gained_s > 0.0 and abs(gained_s - (now_s - self.last_s)) < _SAME_CLOCK_S


@dataclass(frozen=True, kw_only=True)
class ClockMonitor:
    """`advanced_s` is the time of the last position with a new time stamp, `stuck_s` the time since then in which
    packets were received. `least_offset_s` is our clock less the vehicle's, by the position with the least latency;
    `late_since_s` since when all positions have been too late to be fresh. `other` is a clock by which positions go on
    instead, `stepped_s` the greatest step ahead."""

    advanced_s: float
    stuck_s: float = 0.0
    least_offset_s: float | None = None
    late_since_s: float | None = None
    other: OtherClock | None = None
    stepped_s: float = 0.0

    def continues(self, position: Position, newest: Position, now_s: float) -> bool:
        """Whether the position's time is neither late, repeated nor ahead, after the `newest` position."""
        return position.time_boot_s > newest.time_boot_s and self._early_s(position, newest, now_s) <= _EARLY_S

    def advance(self, position: Position, now_s: float) -> "ClockMonitor":
        """Note a position that continues the clock: the least latency, and since when positions are late."""
        offset_s = least_s = now_s - position.time_boot_s
        if self.least_offset_s is not None:
            least_s = min(offset_s, self.least_offset_s + CLOCK_DRIFT * (now_s - self.advanced_s))
        late_since_s = since(self.late_since_s, now_s, holds=offset_s - least_s >= FRESH_S)
        return replace(self, advanced_s=now_s, stuck_s=0.0, least_offset_s=least_s, late_since_s=late_since_s)

    def sent_s(self, position: Position) -> float:
        """Return when a position was sent, if its latency above the least one is delay."""
        return position.time_boot_s + (self.least_offset_s or 0.0)

    def add_other(self, position: Position, newest: Position, now_s: float) -> tuple["ClockMonitor", bool]:
        """Process a position whose time does not continue the clock; return also whether the vehicle has rebooted. Only
        if further ones continue from there, and no more by the previous clock arrive, has the vehicle's clock stepped
        ahead, or the vehicle rebooted."""
        other = self.other
        goes_on = other is not None and other.goes_on(position, now_s)
        first_s = other.first_s if other is not None and goes_on else now_s
        clock = replace(self, other=OtherClock(first_s=first_s, last_s=now_s, last=position))
        if not goes_on or self.advanced_s > first_s:
            return clock, False
        early_s = self._early_s(position, newest, now_s)
        if _EARLY_S < early_s <= AHEAD_S and now_s - first_s >= _STEPPED_S:
            step_s, offset_s = max(self.stepped_s, early_s), now_s - position.time_boot_s
            return replace(clock, stepped_s=step_s, least_offset_s=offset_s, advanced_s=now_s), False
        fell_back = position.time_boot_s < newest.time_boot_s - BACK_S
        if not (fell_back and may_have_begun(position.time_boot_s, first_s - self.advanced_s)):
            return clock, False
        if now_s - first_s < RESTARTED_S:
            return replace(clock, stuck_s=0.0), False
        return replace(clock, least_offset_s=None, advanced_s=now_s), True

    def _early_s(self, position: Position, newest: Position, now_s: float) -> float:
        """Return how far the position's time is ahead of the vehicle's clock: by how much it arrived before the least
        latency, or, while that is not known, beyond AHEAD_S what the clock can have gained."""
        if self.least_offset_s is None:
            return position.time_boot_s - newest.time_boot_s - (now_s - self.advanced_s) - AHEAD_S
        return self.least_offset_s - (now_s - position.time_boot_s)

    def find_frozen(self, plan: Plan, last: Position, accepted_s: float) -> Finding | None:
        """Find a clock that stands still or jumps; `last` is the last plausible position, of the time `accepted_s`."""
        why, other, stuck_s = "", self.other, STUCK_S * plan.timeout_factor
        if self.stuck_s > stuck_s and other is not None and other.advances:
            gained_s = other.last.time_boot_s - last.time_boot_s
            why = f"Its clock jumped by {gained_s - (other.last_s - accepted_s):+.1f} s."
        elif self.stuck_s > stuck_s:
            why = f"Its clock stood still for more than {stuck_s:g} s."
        elif self.stepped_s > _LONGEST_STEP_S:
            why = f"Its clock jumped ahead by {self.stepped_s:.1f} s."
        return Finding(Failure.FROZEN, why) if why else None

    def find_late(self, plan: Plan) -> Finding | None:
        """Find that positions arrive late, or that the clock is slower than it is said to be."""
        if self.late_since_s is None or self.advanced_s - self.late_since_s <= LOST_S * plan.timeout_factor:
            return None
        why = (
            f"Its positions arrive more than {FRESH_S:g} s late, or its clock is slower than the clock speed in its "
            "settings."
        )
        return Finding(Failure.LOST_POSITION, why)
