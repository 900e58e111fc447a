"""The second source of altitude, such as motion capture."""

from dataclasses import dataclass
from typing import Final

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.monitors.clock import ATTENDED_S, STUCK_S
from app.vehicles.mavlink.monitors.link import SILENT_S
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.states import replace

MAX_DIFFERENCE_M: Final = 0.3
"""Greatest difference between the second source of altitude and the vehicle's own."""
_MAX_AGE_S: Final = 0.5
_APART_S: Final = 0.3


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
        since_s = self.apart_since_s if self.apart_since_s is not None else now_s
        return replace(
            second,
            altitude_m=sample.altitude_m,
            blind_s=0.0,
            apart_m=apart_m,
            apart_since_s=since_s if apart_m > MAX_DIFFERENCE_M else None,
        )

    def altitude_at(self, now_s: float) -> float | None:
        """Return the source's altitude; None while its samples are not new, or none arrive."""
        is_old = self.received_s is None or now_s - self.received_s > _MAX_AGE_S
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
        if apart_m <= MAX_DIFFERENCE_M:
            return None
        return Finding(Failure.DISAGREEMENT, f"They were {apart_m:.2f} m apart before the takeoff command.")
