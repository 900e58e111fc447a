"""Modes: who flies the vehicle and how, by its heartbeats and the blocks of its flight plan."""

from dataclasses import dataclass
from typing import Final

from app.vehicles.mavlink.events import Heartbeat
from app.vehicles.mavlink.failures import Failure, Finding, Limits
from app.vehicles.mavlink.states import replace

_IN_TURN: Final = 0.8
"""Minimum interval of one vehicle's heartbeats, in periods; closer ones are of two vehicles."""
_OWN_CEILING_M: Final = 0.5
"""Maximum distance of a vehicle's own ceiling below ours."""


@dataclass(frozen=True, kw_only=True)
class ModeMonitor:
    """`armed` and `mode` are from the last heartbeat, `armed_since_s` and `mode_since_s` since when all heartbeats
    agree with it; `heartbeat_gap_s` is the time between the last two. `block` is the last block that it entered."""

    heartbeat_s: float
    heartbeat_gap_s: float = 0.0
    armed: bool = False
    armed_since_s: float = 0.0
    mode: str = ""
    mode_since_s: float = 0.0
    block: str = ""
    block_s: float = 0.0

    def update(self, heartbeat: Heartbeat, now_s: float) -> "ModeMonitor":
        return replace(
            self,
            heartbeat_s=now_s,
            heartbeat_gap_s=now_s - self.heartbeat_s,
            armed=heartbeat.armed,
            armed_since_s=self.armed_since_s if heartbeat.armed == self.armed else now_s,
            mode=heartbeat.mode,
            mode_since_s=self.mode_since_s if heartbeat.mode == self.mode else now_s,
        )

    def is_disarmed(self, limits: Limits) -> bool:
        """Whether it is disarmed by at least two heartbeats with none between them that contradicts."""
        return not self.armed and self.heartbeat_s - self.armed_since_s >= limits.confirmation_s

    def agreed(self, limits: Limits) -> str:
        """Return the mode in which heartbeats agree; empty while they do not."""
        return self.mode if self.heartbeat_s - self.mode_since_s >= limits.confirmation_s else ""

    def find_taken_over(self, limits: Limits) -> Finding | None:
        """Find that a pilot flies the vehicle now."""
        mode = self.agreed(limits)
        if not self.armed or not limits.is_manual(mode):
            return None
        return Finding(failure=Failure.TAKEN_OVER, why=f"The vehicle entered mode {limits.named(mode)}.")

    def find_interruption(self, before: "ModeMonitor", limits: Limits) -> Finding | None:
        """Find a manual mode that only the last heartbeat of the state `before` reported and the next one did not,
        unless it arrived between two heartbeats of the vehicle."""
        was_by_hand = before.armed and limits.is_manual(before.mode)
        is_in_turn = min(before.heartbeat_gap_s, self.heartbeat_gap_s) >= _IN_TURN * limits.heartbeat_s
        if not (was_by_hand and is_in_turn) or limits.is_manual(self.mode):
            return None
        return Finding(failure=Failure.INTERRUPTED, why=f"One heartbeat reported mode {limits.named(before.mode)}.")

    def find_disarming(self, limits: Limits) -> Finding | None:
        why = "The vehicle disarmed itself in the air."
        return Finding(failure=Failure.UNEXPECTED, why=why) if self.is_disarmed(limits) else None

    def find_unexpected(self, limits: Limits, modes: frozenset[str], blocks: frozenset[str]) -> Finding | None:
        """Find a mode or block other than the allowed `modes` and `blocks`, empty if any is."""
        why, mode = "", self.agreed(limits)
        if modes and mode and mode not in modes:
            why = f"The vehicle entered mode {limits.named(mode)}."
        elif blocks and self.block and self.block not in blocks:
            why = f"Its flight plan entered the block “{self.block}”."
        return Finding(failure=Failure.UNEXPECTED, why=why) if why else None

    def find_interrupted_climb(self, limits: Limits, *, has_climbed: bool) -> Finding | None:
        """Find a vehicle that hovers before it has been near its first set point: its failsafe or a person has stopped
        it."""
        if has_climbed or (mode := self.agreed(limits)) not in limits.hovering_modes:
            return None
        why = f"The vehicle entered mode {limits.named(mode)} before it had climbed."
        return Finding(failure=Failure.UNEXPECTED, why=why)

    def find_own_landing(self, limits: Limits, height_m: float | None, *, mode_known: bool) -> Finding | None:
        """Find a landing of a vehicle that should fly. `mode_known`: its mode is not the one before the command. Close
        below our ceiling, the vehicle's own ceiling is the cause, and the failure is that of the envelope."""
        why = ""
        if mode_known and (mode := self.agreed(limits)) in limits.landing_modes - limits.flying_modes:
            why = f"It entered mode {limits.named(mode)}."
        elif self.block in limits.landing_blocks:
            why = f"Its flight plan entered the block “{self.block}”."
        if not why or height_m is None:
            return None
        if height_m > limits.ceiling_m - _OWN_CEILING_M:
            return Finding(failure=Failure.ENVELOPE, why=f"It was {height_m:.2f} m above the ground. {why}")
        return Finding(failure=Failure.OWN_LANDING, why=why)
