"""What the vehicle was commanded to hold: its gains, its mode where that is a parameter, and the set points after the
takeoff's."""

import math
from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Heartbeat, Measurement, Parameter, Position, TargetAltitude
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan

_SAME_M: Final = 0.05
_ASTRAY_S: Final = 0.3
"""Time after which it is not a late report of the previous set point, and the next heartbeat is a later one."""


@dataclass(frozen=True, kw_only=True)
class SettingMonitor:
    """`suspects` are parameters that one message reported with a value other than the vehicle must have; `polled_s` is
    the time at which they were last requested."""

    suspects: frozenset[str] = frozenset()
    polled_s: float = 0.0

    def update(self, reported: Parameter, plan: Plan) -> tuple["SettingMonitor", Finding | None]:
        """Note a gain, or the mode, that the vehicle reports with another value than it must hold. A single report may
        be an old one, and is confirmed by a reply to a request."""
        name, value, suspects, mode = reported.name, reported.value, self.suspects, plan.autopilot.mode_parameter
        held = {setting.parameter: setting.value for setting in plan.trial_gains}
        if mode is not None and value in mode.modes:  # heartbeats show the others
            held[mode.name] = mode.flying
        if math.isclose(held.get(name, value), value, rel_tol=1e-6):
            return (replace(self, suspects=suspects - {name}) if name in suspects else self), None
        if name not in suspects:
            return replace(self, suspects=suspects | {name}), None
        if mode is not None and name == mode.name:
            return self, Finding(Failure.UNEXPECTED, f"The vehicle entered mode {plan.named(mode.modes[value])}.")
        return self, Finding(Failure.INTERRUPTED, f"{name} changed to {value:g} by a command that was not Gainline's.")

    def find_unconfirmed(self) -> Finding | None:
        names = ", ".join(sorted(self.suspects))
        why = f"{names} was reported with another value, and no reply confirmed which holds."
        return Finding(Failure.INTERRUPTED, why) if names else None


@dataclass(frozen=True, slots=True)
class SetPointChange:
    """A set point that the vehicle has confirmed, in the record's altitude. `times_s`, in s since the takeoff command
    by the vehicle's clock: when it took effect, if it was the first, second, … sending of the message that did."""

    altitude_m: float
    times_s: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class SetPointMonitor:
    """`changes` are the set points that it has confirmed; `is_changing`: it has not confirmed the newest; `settling`
    are the positions that show whether it is at rest before the first of them. `astray_since_s`: since when it has
    reported another set point than the one it confirmed. `withdrawn`: a heartbeat has reported a manual mode since the
    first of them was commanded, after which none is commanded any more."""

    changes: tuple[SetPointChange, ...] = ()
    is_changing: bool = False
    settling: tuple[Position, ...] = ()
    astray_since_s: float | None = None
    withdrawn: bool = False

    @property
    def has_begun(self) -> bool:
        """Whether a set point after the takeoff's has been commanded."""
        return bool(self.changes) or self.is_changing

    def confirm(self, change: SetPointChange) -> "SetPointMonitor":
        return replace(self, changes=(*self.changes, change), is_changing=False)

    def update(
        self, measurement: Measurement | None, now_s: float, plan: Plan
    ) -> tuple["SetPointMonitor", Finding | None]:
        """Find a vehicle that follows another set point than the one it has confirmed, once a heartbeat reports that it
        still follows set points: a pilot's mode changes its set point too."""
        since_s = self.astray_since_s
        match measurement:
            case TargetAltitude(altitude_m=altitude_m):
                is_known = self.changes and not self.is_changing
                is_astray = is_known and abs(altitude_m - plan.set_point_m) > _SAME_M
                astray_s = (since_s or now_s) if is_astray else None
                return self if astray_s == since_s else replace(self, astray_since_s=astray_s), None
            case Heartbeat(mode=mode) if since_s is not None and now_s - since_s >= _ASTRAY_S:
                why = "Its set point was changed by a command that was not Gainline's."
                return self, Finding(Failure.INTERRUPTED, why) if mode in plan.autopilot.following_modes else None
            case _:
                return self, None
