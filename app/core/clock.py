"""Time as whoever waits is given it: of a vehicle, whose simulation may run faster than life, or of this computer."""

import math
import time
from typing import Final, Protocol

from app.core.errors import InputError, Problem


class Clock(Protocol):
    """Seconds that need not be those on the wall: every wait and every time-out is in seconds of one of these."""

    def now_s(self) -> float:
        """Monotonic seconds from an arbitrary origin."""
        ...

    def wait_s(self, seconds: float) -> None:
        """Return once `seconds` have passed; at once when they are not above 0."""
        ...

    def wall_s(self, seconds: float) -> float:
        """How long `seconds` take on the wall, for waiting on sockets and locks."""
        ...


class ScaledClock:
    """Vehicle time that runs `speed` times as fast as the wall clock; 1.0 is a real vehicle's."""

    def __init__(self, speed: float = 1.0) -> None:
        """Raises InputError unless `speed` is positive and finite."""
        if not (math.isfinite(speed) and speed > 0.0):
            raise InputError(
                "This clock cannot run.",
                problems=(Problem("clock_speed", f"must be above 0 and finite, got {speed:g}"),),
                hint="1 is a real vehicle's; give a simulation the speed that it runs at, such as 10.",
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
"""This computer's own."""
