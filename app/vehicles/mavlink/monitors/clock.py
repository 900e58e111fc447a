"""The vehicle's clock: whether it advances, steps or restarts, and how late its positions arrive."""

from dataclasses import dataclass
from typing import Final

from app.autopilots.measurements import Position
from app.vehicles.mavlink.boot_clock import (
    AHEAD_S,
    BACK_S,
    EARLY_S,
    RESTARTED_S,
    STEPPED_S,
    OtherClock,
    may_have_begun,
)
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.states import replace

FRESH_S: Final = 0.5
"""Greatest age of a sample, since it was sent, that counts as the current position."""
ATTENDED_S: Final = 0.1
"""Longest time before a packet or a sample that it accounts for: delayed by a stall, they may arrive at once, in any
order."""
_DRIFT: Final = 0.1
"""Share by which the vehicle's clock may be slower than ours."""
STUCK_S: Final = 0.25
LOST_S: Final = 0.5
_LONGEST_STEP_S: Final = 0.3
"""A greater step of the clock is not one of the latency."""


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
        return position.time_boot_s > newest.time_boot_s and self._early_s(position, newest, now_s) <= EARLY_S

    def advance(self, position: Position, now_s: float) -> "ClockMonitor":
        """Note a position that continues the clock: the least latency, and since when positions are late."""
        offset_s, least_s, late_since_s = now_s - position.time_boot_s, self.least_offset_s, None
        if least_s is None:
            least_s = offset_s
        else:
            least_s = min(offset_s, least_s + _DRIFT * (now_s - self.advanced_s))
            if offset_s - least_s >= FRESH_S:
                late_since_s = self.late_since_s if self.late_since_s is not None else now_s
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
        if EARLY_S < early_s <= AHEAD_S and now_s - first_s >= STEPPED_S:
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

    def find_frozen(self, plan: Plan, last: Position | None, accepted_s: float) -> Finding | None:
        """Find a clock that stands still or jumps; `last` is the last plausible position, of the time `accepted_s`."""
        why, other, stuck_s = "", self.other, STUCK_S * plan.timeout_factor
        if self.stuck_s > stuck_s and other is not None and other.advances and last is not None:
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
