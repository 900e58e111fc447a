"""Simulated time held back to the speed of life, or a multiple of it."""

import math
from typing import Final

from app.core.clock import REAL_TIME, Clock
from app.core.errors import InputError, Problem
from app.vehicles.base import ShouldStop, StopRequest

LISTEN_EVERY_S: Final = 0.02
"""The longest that a flight held back is deaf to an abort."""


class Pacer:
    """Lets vehicle time pass `speed` times as fast as the clock's, never faster; None does not hold it back at all.

    Time is counted from the start: a computation that fell behind catches up.
    """

    def __init__(self, speed: float | None, clock: Clock = REAL_TIME) -> None:
        """Raises InputError unless `speed` is a positive finite number or None."""
        if speed is not None and not (math.isfinite(speed) and speed > 0.0):
            raise InputError(
                "This flight cannot be paced.",
                problems=(Problem("speed", f"must be above 0 and finite, got {speed:g}"),),
                hint="Give simulated time over wall time, such as 10; nothing means as fast as possible.",
            )
        self._speed = speed
        self._clock = clock
        self._start_s = clock.now_s()

    def wait_until(self, vehicle_time_s: float, should_stop: ShouldStop) -> StopRequest | None:
        """Return None once `vehicle_time_s` seconds of the flight may have passed, or at once what ends it early.

        `should_stop` is asked at least once, every 20 ms of the clock, and last when the time has come.
        """
        while True:
            early_s = self._early_s(vehicle_time_s)
            if early_s > 0.0:
                self._clock.wait_s(min(early_s, LISTEN_EVERY_S))
            if (stop := should_stop()) is not None:
                return stop
            if early_s <= LISTEN_EVERY_S:
                return None

    def _early_s(self, vehicle_time_s: float) -> float:
        if self._speed is None:
            return 0.0
        return self._start_s + vehicle_time_s / self._speed - self._clock.now_s()
