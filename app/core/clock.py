"""Clocks for waiting: vehicle time, which may run faster than real time in simulation, and this computer's time."""

import math
import time
from typing import Final, Protocol

from app.core.errors import InputError, Problem


class Clock(Protocol):
    """A source of time whose seconds need not be wall-clock seconds. All waits and time-outs are in its seconds."""

    def now_s(self) -> float:
        """Monotonic seconds from an arbitrary origin."""

    def wait_s(self, seconds: float) -> None:
        """Return after `seconds`; at once when they are not above 0."""

    def wall_s(self, seconds: float) -> float:
        """Convert `seconds` to wall-clock seconds, for waiting on sockets and locks."""


class ScaledClock:
    """Vehicle time at `speed` times the wall clock; 1.0 for a real vehicle."""

    def __init__(self, speed: float = 1.0) -> None:
        """Raises InputError unless `speed` is positive and finite."""
        if not (math.isfinite(speed) and speed > 0.0):
            raise InputError(
                "Invalid clock speed.",
                problems=(Problem("clock_speed", f"must be above 0 and finite, got {speed:g}"),),
                hint="Use 1 for a real vehicle; for a simulation, the speed at which it runs, such as 10.",
            )
        self._speed = speed

    def now_s(self) -> float:
        return time.monotonic() * self._speed

    def wait_s(self, seconds: float) -> None:
        if seconds > 0.0:
            time.sleep(self.wall_s(seconds))

    def wall_s(self, seconds: float) -> float:
        return seconds / self._speed


REAL_TIME: Final = ScaledClock()
"""This computer's clock."""
