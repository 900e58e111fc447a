"""The link: packets and heartbeats, and their absence."""

from dataclasses import dataclass

from app.vehicles.mavlink.failures import HEARTBEATS_MISSED, Failure, Finding, Limits


@dataclass(frozen=True, kw_only=True)
class LinkMonitor:
    """`received_s` is the time of the last packet."""

    received_s: float

    def find(self, limits: Limits, heartbeat_s: float, now_s: float) -> Finding | None:
        """Find a lost link; `heartbeat_s` is the time of the last heartbeat."""
        if now_s - self.received_s > limits.silent_s:
            return Finding(Failure.LINK, f"Nothing was received for more than {limits.silent_s:g} s.")
        if now_s - heartbeat_s > HEARTBEATS_MISSED * limits.heartbeat_s:
            return Finding(Failure.LINK, "Three heartbeats were missed.")
        return None
