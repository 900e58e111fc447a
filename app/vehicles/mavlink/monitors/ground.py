"""The ground: since when every source shows the vehicle there, what it reports of its landing, and how high it has
climbed, by its altitude and by its climb rate."""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Position
from app.vehicles.mavlink.failures import GROUND_M, Failure, Finding
from app.vehicles.mavlink.monitors.altitude import RESTING_M_S
from app.vehicles.mavlink.monitors.clock import FRESH_S, since
from app.vehicles.mavlink.plan import Plan

AGREED_S: Final = 1.0
"""Time for which every source must show the vehicle on the ground before its motors may be stopped."""
STANDS_S: Final = 3.0
"""Time for which the landed state of a vehicle that was not commanded to take off is believed."""
_CONTRADICTED_S: Final = 8.0
"""Longer than an autopilot takes to detect its landing."""
BEHIND_M: Final = 0.5
"""An altitude that has fallen behind the integrated climb rate by more than this does not follow it."""
_SINKING_M_S: Final = 0.3
"""A vehicle that is faster than this swings."""
_WITHIN_M: Final = 1.0
"""PX4 hovers from 0.8 m below its set point on (NAV_MC_ALT_RAD)."""


@dataclass(frozen=True, kw_only=True)
class GroundMonitor:
    """`landed` is its landed state, reported at `landed_s`, and the same since `landed_since_s`; None if it reports
    none. `grounded_since_s`: since when every source shows it on the ground; `contradicted_since_s`: since when it
    reports that it flies while its position is on the ground."""

    landed: bool | None = None
    landed_s: float = 0.0
    landed_since_s: float = 0.0
    grounded_since_s: float | None = None
    contradicted_since_s: float | None = None

    def update(self, landed: bool, now_s: float) -> "GroundMonitor":
        since_s = self.landed_since_s if landed == self.landed else now_s
        return replace(self, landed=landed, landed_s=now_s, landed_since_s=since_s)

    def settle(self, now_s: float, *, grounded: bool, said_to_fly: bool) -> "GroundMonitor":
        """Note whether its position shows it on the ground, and whether something else shows it in the air."""
        grounded_s = since(self.grounded_since_s, now_s, holds=grounded and not said_to_fly)
        contradicts = grounded and self.reports(now_s, landed=False)
        contradicted_s = since(self.contradicted_since_s, now_s, holds=contradicts)
        if (grounded_s, contradicted_s) == (self.grounded_since_s, self.contradicted_since_s):
            return self
        return replace(self, grounded_since_s=grounded_s, contradicted_since_s=contradicted_s)

    def reports(self, now_s: float, *, landed: bool, within_s: float = AGREED_S) -> bool:
        """Whether its last landed state, of not long ago, is that it has `landed`, or that it flies."""
        return self.landed is landed and now_s - self.landed_s < within_s

    def has_reported_landing(self, now_s: float) -> bool:
        """Whether it has reported for a second that it is on the ground."""
        return self.reports(now_s, landed=True) and now_s - self.landed_since_s >= AGREED_S

    def find_contradiction(self, now_s: float) -> Finding | None:
        """Find that a vehicle has reported for long that it flies while its altitude shows the ground."""
        since_s = self.contradicted_since_s
        if since_s is None or now_s - since_s <= _CONTRADICTED_S:
            return None
        return Finding(Failure.LOST_POSITION, "It reports that it flies, but its altitude is the ground's.")


@dataclass(frozen=True, kw_only=True)
class ClimbMonitor:
    """`highest_m` is the greatest altitude since the takeoff command; `lifted`: it has been above the ground;
    `unseen_m` the altitude that it may have reached while no position of it was received, unless it has been above the
    ground since; `behind_m` how far its altitude is behind its integrated climb rate, until it is first above the
    ground."""

    highest_m: float = float("-inf")
    lifted: bool = False
    unseen_m: float | None = None
    behind_m: float = 0.0

    def update(self, last: Position, position: Position) -> "ClimbMonitor":
        """Return the state after a plausible position that follows `last`."""
        highest_m, unseen_m, behind_m = max(self.highest_m, position.altitude_m), self.unseen_m, self.behind_m
        passed_s = position.time_boot_s - last.time_boot_s
        if passed_s > FRESH_S:
            reached_m = last.altitude_m + max(last.climb_rate_m_s, 0.0) * passed_s
            unseen_m = reached_m if unseen_m is None else max(unseen_m, reached_m)
        if not (self.lifted or self.is_behind):
            mean_m_s = 0.5 * (last.climb_rate_m_s + position.climb_rate_m_s)
            climbed_m = (mean_m_s if abs(mean_m_s) > RESTING_M_S else 0.0) * passed_s
            behind_m = behind_m + climbed_m - (position.altitude_m - last.altitude_m)
        if (highest_m, unseen_m, behind_m) == (self.highest_m, self.unseen_m, self.behind_m):
            return self
        return replace(self, highest_m=highest_m, unseen_m=unseen_m, behind_m=behind_m)

    def settle(self, ground_m: float, *, airborne: bool) -> "ClimbMonitor":
        """Note whether it is now above the ground."""
        if self.unseen_m is None and self.lifted >= airborne:
            return self
        is_high = self.unseen_m is not None and self.unseen_m - ground_m > GROUND_M
        unseen_m = self.unseen_m if is_high and not airborne else None
        return replace(self, lifted=self.lifted or airborne, unseen_m=unseen_m)

    @property
    def is_behind(self) -> bool:
        """Whether its altitude does not follow its climb rate."""
        return self.behind_m > BEHIND_M

    def has_been_near(self, altitude_m: float) -> bool:
        return self.highest_m >= altitude_m - _WITHIN_M

    def find_interrupted(self, mode: str, plan: Plan) -> Finding | None:
        """Find a vehicle that hovers before it has been near its first set point: its failsafe or a person has stopped
        it."""
        if mode not in plan.autopilot.hovering_modes or self.has_been_near(plan.climb_to_m):
            return None
        return Finding(Failure.UNEXPECTED, f"The vehicle entered mode {plan.named(mode)} before it had climbed.")

    def find_behind(self) -> Finding | None:
        """Find that a vehicle commanded to climb is on the ground by its altitude but climbs by its climb rate."""
        why = f"According to its climb rate it rose {self.behind_m:.1f} m more than its altitude shows."
        return Finding(Failure.LOST_POSITION, why) if self.is_behind else None

    def find_incomplete(self, climb_to_m: float) -> Finding | None:
        """Find at the end of a record that the vehicle has never been near its first set point. Its gains may have kept
        it low, or a change of mode that no heartbeat reported."""
        why = (
            f"It did not come within {_WITHIN_M:g} m of its set point, because of its gains or of a change of mode "
            "that no heartbeat reported."
        )
        return None if self.has_been_near(climb_to_m) else Finding(Failure.INTERRUPTED, why)

    def find_sunken(self, last: Position, lowest_m: float, ground_m: float) -> Finding | None:
        """Find at the end of a record that the vehicle, or its altitude alone, has sunk to less than half of the lowest
        set point, where it had been near that."""
        height_m = last.altitude_m - ground_m
        swings = abs(last.climb_rate_m_s) > _SINKING_M_S
        if swings or not self.has_been_near(lowest_m) or height_m >= 0.5 * (lowest_m - ground_m):
            return None
        why = f"At the end of the record it was {height_m:.1f} m above the ground: it, or its altitude alone, has sunk."
        return Finding(Failure.LOST_POSITION, why)
