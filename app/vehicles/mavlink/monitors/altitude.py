"""The vehicle's positions: which of them are plausible, what the newest plausible one shows, and whether a second
source of altitude, such as motion capture, agrees.

A position that cannot follow from the previous one is doubted until more of the same kind have arrived and none of the
previous kind.
"""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Position
from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import DRIFT_M, GROUND_M, Failure, Finding
from app.vehicles.mavlink.monitors.clock import ATTENDED_S, FRESH_S, LOST_S, STUCK_S, since
from app.vehicles.mavlink.monitors.limits import SILENT_S
from app.vehicles.mavlink.plan import Plan

RESTING_M_S: Final = 0.1
_JUMP_M: Final = 0.3
_JUMP_M_S: Final = 6.0
_JUMP_ENDS_RECORD_M: Final = 0.5
"""A single false sample near the ground causes smaller jumps."""
_ACCELERATION_M_S2: Final = 20.0
_ACCELERATING_S: Final = 0.3
"""Longest time for which such an acceleration lasts in one direction."""
_UNSEEN_M_S: Final = 1.5
"""Further change of altitude per second of a longer gap, as in a landing. A faster one, unseen, is a jump."""
_MAX_GLITCHES: Final = 3
_DOUBTED_LIMIT: Final = 10.0
_DOUBT_DECAY_1_S: Final = 5.0
"""Tolerated doubted samples per second; with `_DOUBTED_LIMIT` more than that, the position is unreliable."""
_UNCHANGED_S: Final = 1.0
"""In recordings of all three autopilots, no three consecutive estimates are equal in altitude and climb rate."""
_IMPACT_M_S: Final = 2.0
_IMPACT_BELOW_M: Final = 0.5
MAX_DIFFERENCE_M: Final = 0.3
"""Greatest difference between the second source of altitude and the vehicle's own."""
_SECOND_MAX_AGE_S: Final = 0.5
_APART_S: Final = 0.3


@dataclass(frozen=True, kw_only=True)
class PositionMonitor:
    """`last` is the last plausible position, at first where the vehicle stood: received at `accepted_s`, and sent
    at `sent_s` if its latency above the least one is delay; `doubted` a later one in doubt. `jumped_m` is the greatest
    jump after which the altitude has continued from another value, `unchanged_s` the time by the vehicle's clock in
    which neither altitude nor climb rate has changed at all."""

    accepted_s: float
    sent_s: float
    last: Position
    doubted: Position | None = None
    glitches: int = 0
    doubt_level: float = 0.0
    jumped_m: float = 0.0
    unchanged_s: float = 0.0

    def update(
        self, position: Position, now_s: float, sent_s: float, quiet_s: float
    ) -> tuple["PositionMonitor", tuple[Position, ...]]:
        """Return the state after a position that continues the vehicle's clock, `quiet_s` after the previous one, and
        the positions that it confirms."""
        last, doubted, jumped_m = self.last, self.doubted, self.jumped_m
        follows = _follows(last, position)
        level = max(self.doubt_level - _DOUBT_DECAY_1_S * quiet_s, 0.0) + (not follows)
        glitches = self.glitches + (doubted is not None)
        confirmed: tuple[Position, ...] = (position,)
        if not follows:
            if doubted is None or not _follows(doubted, position):
                return replace(self, doubted=position, doubt_level=level, glitches=glitches), ()
            glitches, confirmed = self.glitches, (doubted, position)
            jumped_m = max(jumped_m, abs(_off_m(last, doubted)) if _jumps(last, doubted) else 0.0)
        accepted = replace(
            self,
            accepted_s=now_s,
            sent_s=sent_s,
            last=position,
            doubted=None,
            glitches=glitches,
            doubt_level=level,
            jumped_m=jumped_m,
            unchanged_s=self._unchanged_s(position),
        )
        return accepted, confirmed

    def restart(self, position: Position, now_s: float) -> "PositionMonitor":
        """Return the state of a vehicle that has rebooted, by its first position since."""
        return replace(self, last=position, doubted=None, accepted_s=now_s, sent_s=now_s)

    def _unchanged_s(self, position: Position) -> float:
        last = self.last
        if (last.altitude_m, last.climb_rate_m_s) != (position.altitude_m, position.climb_rate_m_s):
            return 0.0
        return self.unchanged_s + position.time_boot_s - last.time_boot_s

    # ---- what the newest plausible position shows

    def is_fresh(self, now_s: float) -> bool:
        return now_s - self.sent_s < FRESH_S

    def is_in_doubt(self, now_s: float) -> bool:
        """Whether a single sample jumps, which decides nothing."""
        return self.doubted is not None and self.is_fresh(now_s)

    def is_still(self, now_s: float, ground_m: float, *, within_m: float = DRIFT_M) -> bool:
        """Whether it neither climbs nor sinks within `within_m` of the ground, by a fresh sample."""
        is_low = self.height_m(ground_m) < within_m
        return is_low and self.is_fresh(now_s) and abs(self.last.climb_rate_m_s) < RESTING_M_S

    def is_grounded(self, now_s: float, ground_m: float) -> bool:
        """Whether it is on the ground by height and speed, by a fresh sample."""
        return self.doubted is None and self.is_still(now_s, ground_m, within_m=GROUND_M)

    def is_airborne(self, now_s: float, ground_m: float) -> bool:
        """Whether it is above the ground, by the altitude of a fresh sample."""
        return self.is_fresh(now_s) and self.height_m(ground_m) > GROUND_M

    def height_m(self, ground_m: float) -> float:
        return self.last.altitude_m - ground_m

    # ---- findings

    def find_glitches(self) -> Finding | None:
        why = f"{self.glitches} samples were dropped."
        return Finding(Failure.GLITCHES, why) if self.glitches > _MAX_GLITCHES else None

    def find_frozen(self) -> Finding | None:
        why = f"Its altitude stood still for more than {_UNCHANGED_S:g} s while its clock ran."
        return Finding(Failure.FROZEN, why) if self.unchanged_s > _UNCHANGED_S else None

    def find_implausible(self, plan: Plan, received_s: float, now_s: float) -> Finding | None:
        """Find that none is plausible; to be called after a lost link was looked for, because silence is one."""
        lost_s = LOST_S * plan.timeout_factor
        why = f"None of its positions was plausible for {lost_s:g} s."
        return Finding(Failure.LOST_POSITION, why) if min(now_s, received_s) - self.accepted_s > lost_s else None

    def find_unreliable(self) -> Finding | None:
        why = "Its position jumps back and forth."
        return Finding(Failure.LOST_POSITION, why) if self.doubt_level > _DOUBTED_LIMIT else None

    def find_jump(self) -> Finding | None:
        """Find a jump of the altitude in flight: it, or the earlier altitude, is not the vehicle's."""
        why = f"Its altitude jumped by {self.jumped_m:.1f} m."
        return Finding(Failure.LOST_POSITION, why) if self.jumped_m > _JUMP_ENDS_RECORD_M else None

    def find_departure(self, ground_m: float, *, stands: bool) -> Finding | None:
        """Find that a vehicle without a takeoff command may have left the ground, by its altitude, or that its altitude
        drifts while it reports that it `stands`."""
        away_m = self.height_m(ground_m)
        if abs(away_m) <= GROUND_M:
            return None
        what = "although it stood on the ground: wait until its estimate has settled"
        what = what if stands else "and it may have moved"
        why = f"Its altitude changed by {away_m:+.2f} m before the takeoff command, {what}."
        return Finding(Failure.LOST_POSITION, why)

    def find_drift(self, now_s: float, ground_m: float, *, has_landed: bool) -> Finding | None:
        """Find that the altitude of a flown vehicle has drifted: it is below the ground, or above it where the vehicle
        reports that it has landed."""
        off_m = self.height_m(ground_m)
        if self.doubted is not None or not self.is_fresh(now_s):
            return None
        if off_m >= -DRIFT_M and not (off_m > DRIFT_M and has_landed):
            return None
        return Finding(Failure.LOST_POSITION, f"Its altitude has drifted: it was {off_m:+.1f} m on the ground.")

    def find_fall(self, ground_m: float) -> Finding | None:
        """Find ground contact at a speed above that of any landing."""
        is_near, rate_m_s = self.height_m(ground_m) < _IMPACT_BELOW_M, self.last.climb_rate_m_s
        if self.doubted is not None or not is_near or rate_m_s >= -_IMPACT_M_S:
            return None
        return Finding(Failure.FALL, f"It hit the ground at {-rate_m_s:.1f} m/s.")


def _follows(one: Position, other: Position) -> bool:
    """Whether a vehicle can have moved from one sample to the other."""
    sudden = abs(other.climb_rate_m_s) > _JUMP_M_S >= abs(one.climb_rate_m_s)
    return not (sudden or _jumps(one, other))


def _jumps(one: Position, other: Position) -> bool:
    """Whether the altitudes differ by more than the climb rates and possible accelerations between them explain."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    brief_s = min(elapsed_s, _ACCELERATING_S)
    possible_m = 0.5 * _ACCELERATION_M_S2 * brief_s**2 + _UNSEEN_M_S * (elapsed_s - brief_s)
    return abs(_off_m(one, other)) > _JUMP_M + possible_m


def _off_m(one: Position, other: Position) -> float:
    """Return how far the other altitude is above the one that the mean of both climb rates leads to, m."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    return other.altitude_m - one.altitude_m - 0.5 * (one.climb_rate_m_s + other.climb_rate_m_s) * elapsed_s


@dataclass(frozen=True, kw_only=True)
class SecondSourceMonitor:
    """`received_s` and `altitude_m` are None before the first sample, and the first valid one; `blind_s` is the time
    for which its samples have not been new."""

    received_s: float | None = None
    altitude_m: float | None = None
    blind_s: float = 0.0
    apart_m: float = 0.0
    apart_since_s: float | None = None

    def update(self, sample: SecondaryAltitudeReceived, vehicle_m: float | None) -> "SecondSourceMonitor":
        """Return the state after a sample, with the vehicle's own altitude `vehicle_m` (None: unknown)."""
        now_s, before_s = sample.now_s, sample.now_s if self.received_s is None else self.received_s
        second = replace(self, received_s=max(now_s, before_s))
        if not sample.is_new:
            return replace(second, blind_s=self.blind_s + min(max(now_s - before_s, 0.0), ATTENDED_S))
        apart_m = 0.0 if vehicle_m is None else abs(sample.altitude_m - vehicle_m)
        return replace(
            second,
            altitude_m=sample.altitude_m,
            blind_s=0.0,
            apart_m=apart_m,
            apart_since_s=since(self.apart_since_s, now_s, holds=apart_m > MAX_DIFFERENCE_M),
        )

    def altitude_at(self, now_s: float) -> float | None:
        """Return the source's altitude; None while its samples are not new, or none arrive."""
        is_old = self.received_s is None or now_s - self.received_s > _SECOND_MAX_AGE_S
        return None if is_old or self.blind_s > 0.0 else self.altitude_m

    def find_blind(self, plan: Plan, now_s: float) -> Finding | None:
        """Find a source whose samples have not been new for long, or that sends none."""
        why, stuck_s, silent_s = "", STUCK_S * plan.timeout_factor, SILENT_S * plan.timeout_factor
        if self.blind_s > stuck_s:
            why = f"The second source of altitude did not track it for more than {stuck_s:g} s."
        elif self.received_s is not None and now_s - self.received_s > silent_s:
            why = f"Nothing was received from the second source of altitude for {silent_s:g} s."
        return Finding(Failure.FROZEN, why) if why else None

    def find_disagreement(self) -> Finding | None:
        if self.received_s is None or self.apart_since_s is None or self.received_s - self.apart_since_s <= _APART_S:
            return None
        allowed = f"more than {MAX_DIFFERENCE_M:g} m for {_APART_S:g} s is not allowed"
        return Finding(Failure.DISAGREEMENT, f"They were {self.apart_m:.2f} m apart; {allowed}.")

    def find_disagreement_on_ground(self, altitude_m: float, ground_shift_m: float, now_s: float) -> Finding | None:
        """Find a disagreement between the vehicle's altitude on the ground and the source's last one before a shift."""
        second_m = self.altitude_at(now_s)
        apart_m = 0.0 if second_m is None else abs(second_m + ground_shift_m - altitude_m)
        why = f"They were {apart_m:.2f} m apart before the takeoff command."
        return Finding(Failure.DISAGREEMENT, why) if apart_m > MAX_DIFFERENCE_M else None
