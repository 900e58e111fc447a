"""Settings that the vehicle must hold: its gains, and its mode where that is a parameter."""

import math
from dataclasses import dataclass

from app.autopilots.measurements import Parameter
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.states import replace


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
