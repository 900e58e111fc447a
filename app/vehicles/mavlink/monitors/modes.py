"""Who flies the vehicle and how, by its heartbeats and the blocks of its flight plan, and whether it is still the same
one: whether two vehicles answer, or it has rebooted."""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Heartbeat, Position
from app.vehicles.base import ALTITUDE_LIMIT_M
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan

_IN_TURN: Final = 0.8
"""Minimum interval of one vehicle's heartbeats, in periods; closer ones are of two vehicles."""
_OWN_CEILING_M: Final = 0.5
"""Maximum distance of a vehicle's own ceiling below ours."""


@dataclass(frozen=True, kw_only=True)
class IdentityMonitor:
    """`duplicate_reason` is the evidence that two vehicles use its system id; empty without evidence."""

    duplicate_reason: str = ""
    rebooted: bool = False

    def find_duplicate(self) -> Finding | None:
        return Finding(Failure.DUPLICATE, self.duplicate_reason) if self.duplicate_reason else None

    def find_reboot(self) -> Finding | None:
        return Finding(Failure.UNEXPECTED, "The vehicle rebooted.") if self.rebooted else None


@dataclass(frozen=True, kw_only=True)
class ModeMonitor:
    """`armed` and `mode` are from the last heartbeat, `armed_since_s` and `mode_since_s` since when all heartbeats
    agree with it; `heartbeat_gap_s` is the time between the last two. `is_disarmed`: it is disarmed by at least two
    heartbeats with none between them that contradicts; `agreed` is the mode in which as many agree, empty while they do
    not. `block` is the last block that it entered."""

    heartbeat_s: float
    heartbeat_gap_s: float = 0.0
    armed: bool = False
    armed_since_s: float = 0.0
    is_disarmed: bool = True
    mode: str = ""
    mode_since_s: float = 0.0
    agreed: str = ""
    block: str = ""
    block_s: float = 0.0

    def update(self, heartbeat: Heartbeat, now_s: float, plan: Plan) -> "ModeMonitor":
        armed_since_s = self.armed_since_s if heartbeat.armed == self.armed else now_s
        mode_since_s = self.mode_since_s if heartbeat.mode == self.mode else now_s
        return replace(
            self,
            heartbeat_s=now_s,
            heartbeat_gap_s=now_s - self.heartbeat_s,
            armed=heartbeat.armed,
            armed_since_s=armed_since_s,
            is_disarmed=not heartbeat.armed and now_s - armed_since_s >= plan.confirmation_s,
            mode=heartbeat.mode,
            mode_since_s=mode_since_s,
            agreed=heartbeat.mode if now_s - mode_since_s >= plan.confirmation_s else "",
        )

    def find_taken_over(self, plan: Plan) -> Finding | None:
        """Find that a pilot flies the vehicle now."""
        if not self.armed or not plan.is_manual(self.agreed):
            return None
        return Finding(Failure.TAKEN_OVER, f"The vehicle entered mode {plan.named(self.agreed)}.")

    def find_interruption(self, before: "ModeMonitor", plan: Plan) -> Finding | None:
        """Find a manual mode that only the last heartbeat of the state `before` reported and the next one did not,
        unless it arrived between two heartbeats of the vehicle."""
        was_by_hand = before.armed and plan.is_manual(before.mode)
        is_in_turn = min(before.heartbeat_gap_s, self.heartbeat_gap_s) >= _IN_TURN * plan.heartbeat_s
        if not (was_by_hand and is_in_turn) or plan.is_manual(self.mode):
            return None
        return Finding(Failure.INTERRUPTED, f"One heartbeat reported mode {plan.named(before.mode)}.")

    def find_disarming(self) -> Finding | None:
        return Finding(Failure.UNEXPECTED, "The vehicle disarmed itself in the air.") if self.is_disarmed else None

    def find_unexpected(self, plan: Plan, modes: frozenset[str], blocks: frozenset[str]) -> Finding | None:
        """Find a mode or block other than the allowed `modes` and `blocks`, empty if any is."""
        why = ""
        if modes and self.agreed and self.agreed not in modes:
            why = f"The vehicle entered mode {plan.named(self.agreed)}."
        elif blocks and self.block and self.block not in blocks:
            why = f"Its flight plan entered the block “{self.block}”."
        return Finding(Failure.UNEXPECTED, why) if why else None

    def find_own_landing(self, plan: Plan, last: Position, *, mode_known: bool) -> Finding | None:
        """Find a landing of a vehicle that should fly. `mode_known`: its mode is not the one before the command. Close
        below our ceiling, the vehicle's own ceiling is the cause, and the failure is that of the envelope."""
        why, autopilot = "", plan.autopilot
        if mode_known and self.agreed in autopilot.landing_modes - autopilot.flying_modes:
            why = f"It entered mode {plan.named(self.agreed)}."
        elif self.block in autopilot.landing_blocks:
            why = f"Its flight plan entered the block “{self.block}”."
        if not why:
            return None
        if (height_m := last.altitude_m - plan.ground_m) > ALTITUDE_LIMIT_M - _OWN_CEILING_M:
            return Finding(Failure.ENVELOPE, f"It was {height_m:.2f} m above the ground. {why}")
        return Finding(Failure.OWN_LANDING, why)
