"""Simulated time held back to the speed of life, or a multiple of it."""

import math
import time

from app.core.errors import InputError, Problem


class Pacer:
    """Lets vehicle time pass `speed` times as fast as wall time, never faster; None does not hold it back at all.

    Time is counted from the start: a computation that fell behind catches up.
    """

    def __init__(self, speed: float | None) -> None:
        """Raises InputError unless `speed` is a positive finite number or None."""
        if speed is not None and not (math.isfinite(speed) and speed > 0.0):
            raise InputError(
                "This flight cannot be paced.",
                problems=(Problem("speed", f"must be above 0 and finite, got {speed:g}"),),
                hint="Give simulated time over wall time, such as 10; nothing means as fast as possible.",
            )
        self._speed = speed
        self._start_s = time.monotonic()

    def wait_until(self, vehicle_time_s: float) -> None:
        """Return once `vehicle_time_s` seconds of the flight may have passed."""
        if self._speed is None:
            return
        early_s = self._start_s + vehicle_time_s / self._speed - time.monotonic()
        if early_s > 0.0:
            time.sleep(early_s)
