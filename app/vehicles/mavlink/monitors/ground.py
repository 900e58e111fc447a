"""The ground: what the vehicle itself reports of its landing, and since when every source shows it there."""

from dataclasses import dataclass
from typing import Final

from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.states import replace

AGREED_S: Final = 1.0
"""Time for which every source must show the vehicle on the ground before its motors may be stopped."""
_STANDS_S: Final = 3.0
"""Time for which the landed state of a vehicle that was not commanded to take off is believed."""
_CONTRADICTED_S: Final = 8.0
"""Longer than an autopilot takes to detect its landing."""


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
        grounded_s, contradicted_s = self.grounded_since_s, self.contradicted_since_s
        grounded_s = (now_s if grounded_s is None else grounded_s) if grounded and not said_to_fly else None
        contradicts = grounded and self.reports_flight(now_s)
        contradicted_s = (now_s if contradicted_s is None else contradicted_s) if contradicts else None
        if (grounded_s, contradicted_s) == (self.grounded_since_s, self.contradicted_since_s):
            return self
        return replace(self, grounded_since_s=grounded_s, contradicted_since_s=contradicted_s)

    def reports_flight(self, now_s: float) -> bool:
        return self.landed is False and now_s - self.landed_s < AGREED_S

    def reports_landing(self, now_s: float) -> bool:
        """Whether it now reports that it is on the ground."""
        return self.landed is True and now_s - self.landed_s < AGREED_S

    def has_reported_landing(self, now_s: float) -> bool:
        """Whether it has reported for a second that it is on the ground."""
        return self.reports_landing(now_s) and now_s - self.landed_since_s >= AGREED_S

    def reported_standing(self, now_s: float) -> bool:
        """Whether it has reported not long ago that it is on the ground."""
        return self.landed is True and now_s - self.landed_s < _STANDS_S

    def has_stood_since(self, since_s: float) -> bool:
        """Whether its landed state has always been that it stands since then."""
        return self.landed is True and self.landed_since_s <= since_s

    def find_contradiction(self, now_s: float) -> Finding | None:
        """Find that a vehicle has reported for long that it flies while its altitude shows the ground."""
        since_s = self.contradicted_since_s
        if since_s is None or now_s - since_s <= _CONTRADICTED_S:
            return None
        return Finding(Failure.LOST_POSITION, "It reports that it flies, but its altitude is the ground's.")
