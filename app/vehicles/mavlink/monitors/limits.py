"""Limits of a flight: the link, altitude, speed, place, oscillation and lean, the vehicle's own fence, its battery."""

import math
from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Position
from app.vehicles.base import ALTITUDE_LIMIT_M
from app.vehicles.mavlink.failures import HEARTBEATS_MISSED, Failure, Finding
from app.vehicles.mavlink.monitors.clock import since
from app.vehicles.mavlink.plan import Plan

SILENT_S: Final = 1.0
_CLIMB_RATE_M_S: Final = 4.0
_CROSSING_M: Final = 0.3
_CROSSINGS: Final = 4
_LEAN_RAD: Final = math.radians(20.0)
_LEANING_OVER_S: Final = 1.5
_LONGEST_LEAN_S: Final = 0.5
"""Longest time for which one report of its attitude counts."""
_LEANING: Final = 0.5
_LOW_VOLTAGE_S: Final = 1.0
_UNKNOWN_VOLTAGE_S: Final = 10.0


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


@dataclass(frozen=True, kw_only=True)
class EnvelopeMonitor:
    """`origin` is the position from which distances count; `side` on which of the set point it was last, +1 above;
    `may_overshoot`: its next crossing is the overshoot after a change of the set point, which does not count.
    `leaning` is the recent share of time in which it has leaned by more than 20°, at `attitude_s` last; `breached` the
    limit of its own fence that it has crossed, empty if none."""

    origin: Position
    side: int = -1
    crossings: int = 0
    may_overshoot: bool = False
    leaning: float = 0.0
    attitude_s: float | None = None
    breached: str = ""

    def add_position(self, position: Position, plan: Plan) -> "EnvelopeMonitor":
        above_m = position.altitude_m - plan.set_point_m
        side = self.side if abs(above_m) <= _CROSSING_M else (1 if above_m > 0.0 else -1)
        if side == self.side:
            return self
        return replace(self, side=side, crossings=self.crossings + (not self.may_overshoot), may_overshoot=False)

    def add_attitude(self, lean_rad: float, now_s: float) -> "EnvelopeMonitor":
        passed_s = 0.0 if self.attitude_s is None else min(now_s - self.attitude_s, _LONGEST_LEAN_S)
        weight = -math.expm1(-passed_s / _LEANING_OVER_S)
        leaning = self.leaning + weight * ((abs(lean_rad) > _LEAN_RAD) - self.leaning)
        return replace(self, leaning=leaning, attitude_s=now_s)

    def find(self, plan: Plan, last: Position, *, settling: bool) -> Finding | None:
        """Find a limit that the vehicle has exceeded; crossings of the set point count while it is `settling` there."""
        why, height_m, away_m = "", last.altitude_m - plan.ground_m, last.away_m(self.origin)
        if self.breached:
            why = f"The vehicle's own fence was crossed: {self.breached}."
        elif height_m > ALTITUDE_LIMIT_M:
            why = f"It was {height_m:.2f} m above the ground; the limit is {ALTITUDE_LIMIT_M:g} m."
        elif abs(last.climb_rate_m_s) > _CLIMB_RATE_M_S:
            why = f"Its climb rate was {last.climb_rate_m_s:+.1f} m/s; the limit is ±{_CLIMB_RATE_M_S:g} m/s."
        elif away_m > plan.radius_m:
            why = f"It was {away_m:.1f} m from its start; the limit is {plan.radius_m:g} m."
        elif settling and self.crossings >= _CROSSINGS:
            why = f"It crossed its set point {self.crossings} times by more than ±{_CROSSING_M:g} m."
        return Finding(Failure.ENVELOPE, why) if why else self.find_oscillation()

    def find_oscillation(self) -> Finding | None:
        why = "It leaned by more than 20° most of the time: its attitude oscillates. Tune its attitude first."
        return Finding(Failure.ENVELOPE, why) if self.leaning > _LEANING else None


@dataclass(frozen=True, kw_only=True)
class BatteryMonitor:
    """`heard_s` is the time of the last voltage."""

    heard_s: float
    voltage_v: float | None = None
    low_since_s: float | None = None

    def update(self, voltage_v: float, now_s: float, plan: Plan) -> "BatteryMonitor":
        low_since_s = since(self.low_since_s, now_s, holds=voltage_v < plan.min_battery_v)
        return replace(self, heard_s=now_s, voltage_v=voltage_v, low_since_s=low_since_s)

    def find(self, now_s: float) -> Finding | None:
        if self.low_since_s is not None and now_s - self.low_since_s > _LOW_VOLTAGE_S:
            return Finding(Failure.BATTERY, f"The battery voltage was low: {self.voltage_v:.1f} V.")
        if now_s - self.heard_s > _UNKNOWN_VOLTAGE_S:
            return Finding(Failure.BATTERY, f"No battery voltage was received for {_UNKNOWN_VOLTAGE_S:g} s.")
        return None
