"""PX4's trajectory of altitude in its auto modes: limited in speed, acceleration and jerk.

Each step advances the motion along the last plan, then plans anew the three intervals of jerk that bring the speed to
that from which the way to the target suffices to stop. Altitude and its derivatives are positive up, SI.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of speed, m/s, acceleration, m/s², and jerk, m/s³; all positive."""

    speed_m_s: float
    acceleration_m_s2: float
    jerk_m_s3: float

    def approach_speed(self, left_m: float) -> float:
        """Speed from which the distance `left_m`, with its sign, suffices to stop."""
        reserve = self._reserve_m_s
        speed = 0.5 * (math.sqrt(reserve * reserve + 8.0 * self.acceleration_m_s2 * abs(left_m)) - reserve)
        return math.copysign(min(speed, self.speed_m_s), left_m)

    def stopping_distance(self, speed_m_s: float) -> float:
        """Distance, with the sign of the speed, for which `approach_speed` gives this speed."""
        return speed_m_s * (abs(speed_m_s) + self._reserve_m_s) / (2.0 * self.acceleration_m_s2)

    @property
    def _reserve_m_s(self) -> float:
        return 4.0 * self.acceleration_m_s2**2 / self.jerk_m_s3


class Trajectory:
    """Altitude, climb rate and acceleration of the reference motion."""

    def __init__(self) -> None:
        self.start(0.0, 0.0)

    def start(self, altitude_m: float, climb_m_s: float) -> None:
        """Begin unaccelerated."""
        self.altitude_m, self.climb_m_s, self.acceleration_m_s2 = altitude_m, climb_m_s, 0.0
        self._plan: tuple[tuple[float, float], ...] = ()
        """Durations, s, each with its jerk."""

    def step(self, climb_m_s: float, limits: Limits, dt_s: float) -> None:
        """Advance by `dt_s` along the last plan, then plan for this climb rate."""
        left_s = dt_s
        for duration_s, jerk in self._plan:
            t = min(left_s, duration_s)
            self.altitude_m += t * (self.climb_m_s + t * (0.5 * self.acceleration_m_s2 + t * jerk / 6.0))
            self.climb_m_s += t * (self.acceleration_m_s2 + 0.5 * t * jerk)
            self.acceleration_m_s2 += t * jerk
            left_s -= t
        if left_s > 0.0:
            self.acceleration_m_s2 = 0.0
            self.altitude_m += left_s * self.climb_m_s
        self._plan = _plan(self.climb_m_s, self.acceleration_m_s2, climb_m_s, limits)


def _plan(v: float, a: float, wanted: float, limits: Limits) -> tuple[tuple[float, float], ...]:
    """Plan the change of speed from `v`, with acceleration `a`, to `wanted`: jerk, none, opposite jerk."""
    change = wanted - v - 0.5 * a * abs(a) / limits.jerk_m_s3
    if change == 0.0 and a == 0.0:
        return ()
    jerk = math.copysign(limits.jerk_m_s3, change or a)
    first_s = _first_interval(a, wanted - v, jerk)
    most = limits.acceleration_m_s2
    if abs(a + jerk * first_s) > most:
        first_s = max((math.copysign(most, a + jerk * first_s) - a) / jerk, 0.0)
    peak = a + jerk * first_s
    last_s = max(peak / jerk, 0.0)
    gained = first_s * (a + 0.5 * jerk * first_s) + last_s * (peak - 0.5 * jerk * last_s)
    middle_s = max((wanted - v - gained) / peak, 0.0) if peak != 0.0 else 0.0
    return (first_s, jerk), (middle_s, 0.0), (last_s, -jerk)


def _first_interval(a: float, change: float, jerk: float) -> float:
    """Time with `jerk` after which the opposite jerk completes the change of speed, without a limit on acceleration."""
    root = 0.5 * math.sqrt(max(2.0 * a * a + 4.0 * jerk * change, 0.0))
    candidates = ((root - a) / jerk, (-root - a) / jerk)
    return next((t for t in candidates if t >= 0.0 and a / jerk + t >= 0.0), 0.0)
