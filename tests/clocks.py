"""Clocks that tests own."""

import time


class ManualClock:
    """Stands where the test has put it; whoever waits looks again soon."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def now_s(self) -> float:
        return self.time_s

    def wait_s(self, seconds: float) -> None:
        time.sleep(self.wall_s(seconds))

    def wall_s(self, seconds: float) -> float:
        return min(seconds, 0.001)


class SimulatedClock:
    """Time passes as soon as somebody waits for it, and only then."""

    def __init__(self) -> None:
        self._time_s = 0.0

    def now_s(self) -> float:
        return self._time_s

    def wait_s(self, seconds: float) -> None:
        self._time_s += max(seconds, 0.0)

    def wall_s(self, seconds: float) -> float:
        self.wait_s(seconds)
        return 0.0
