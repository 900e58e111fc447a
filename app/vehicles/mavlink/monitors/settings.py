"""Settings that the vehicle must hold: its gains, and its mode where that is a parameter."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from app.autopilots.autopilot import ModeParameter
from app.autopilots.commands import Setting
from app.autopilots.measurements import Parameter
from app.vehicles.mavlink.failures import Failure, Finding, Limits
from app.vehicles.mavlink.states import replace


@dataclass(frozen=True, kw_only=True)
class SettingMonitor:
    """`suspects` are parameters that one message reported with a value other than the vehicle must have; `polled_s` is
    the time at which they were last requested."""

    suspects: frozenset[str] = frozenset()
    polled_s: float = 0.0

    def update(
        self, reported: Parameter, gains: Sequence[Setting], mode: ModeParameter | None, limits: Limits
    ) -> tuple["SettingMonitor", Finding | None]:
        """Note a gain, or the mode, that the vehicle reports with another value than it must hold. A single report may
        be an old one, and is confirmed by a reply to a request."""
        name, value, suspects = reported.name, reported.value, self.suspects
        held = {setting.parameter: setting.value for setting in gains}
        if mode is not None and value in mode.modes:  # heartbeats show the others
            held[mode.name] = mode.flying
        if math.isclose(held.get(name, value), value, rel_tol=1e-6):
            return (replace(self, suspects=suspects - {name}) if name in suspects else self), None
        if name not in suspects:
            return replace(self, suspects=suspects | {name}), None
        if mode is not None and name == mode.name:
            return self, Finding(Failure.UNEXPECTED, f"The vehicle entered mode {limits.named(mode.modes[value])}.")
        return self, Finding(Failure.INTERRUPTED, f"{name} changed to {value:g} by a command that was not Gainline's.")

    def find_unconfirmed(self) -> Finding | None:
        names = ", ".join(sorted(self.suspects))
        why = f"{names} was reported with another value, and no reply confirmed which holds."
        return Finding(Failure.INTERRUPTED, why) if names else None
