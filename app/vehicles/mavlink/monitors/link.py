"""The link: packets and heartbeats, and their absence."""

from dataclasses import dataclass
from typing import Final

from app.vehicles.mavlink.failures import HEARTBEATS_MISSED, Failure, Finding
from app.vehicles.mavlink.plan import Plan

SILENT_S: Final = 1.0


@dataclass(frozen=True, kw_only=True)
class LinkMonitor:
    """`received_s` is the time of the last packet."""

    received_s: float

    def find(self, plan: Plan, heartbeat_s: float, now_s: float) -> Finding | None:
        """Find a lost link; `heartbeat_s` is the time of the last heartbeat."""
        silent_s = SILENT_S * plan.timeout_factor
        if now_s - self.received_s > silent_s:
            return Finding(Failure.LINK, f"Nothing was received for more than {silent_s:g} s.")
        if now_s - heartbeat_s > HEARTBEATS_MISSED * plan.heartbeat_s:
            return Finding(Failure.LINK, "Three heartbeats were missed.")
        return None
