"""The battery: its voltage, and since when it is low."""

from dataclasses import dataclass
from typing import Final

from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.states import replace

_LOW_S: Final = 1.0
_UNKNOWN_S: Final = 10.0


@dataclass(frozen=True, kw_only=True)
class BatteryMonitor:
    """`heard_s` is the time of the last voltage."""

    heard_s: float
    voltage_v: float | None = None
    low_since_s: float | None = None

    def update(self, voltage_v: float, now_s: float, plan: Plan) -> "BatteryMonitor":
        since_s = self.low_since_s if self.low_since_s is not None else now_s
        is_low = voltage_v < plan.min_battery_v
        return replace(self, heard_s=now_s, voltage_v=voltage_v, low_since_s=since_s if is_low else None)

    def find(self, now_s: float) -> Finding | None:
        if self.low_since_s is not None and now_s - self.low_since_s > _LOW_S:
            return Finding(Failure.BATTERY, f"The battery voltage was low: {self.voltage_v:.1f} V.")
        if now_s - self.heard_s > _UNKNOWN_S:
            return Finding(Failure.BATTERY, f"No battery voltage was received for {_UNKNOWN_S:g} s.")
        return None
