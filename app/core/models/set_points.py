"""The altitude set points of a flight under the vertical loop: one, or several that follow each other."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_guidance import POSITION_BITS, RATE_HZ, fix
from app.core.records.flight_events import FlightEvent
from app.core.records.trajectory import Samples


@dataclass(frozen=True, slots=True)
class SetPoints:
    """Set points `altitudes_m` (m, up), each from its time in `times_s` until the next; the last one holds.

    Times are seconds since the command, increase, and are multiples of the loop's step; the first is 0. With
    `accelerations_m_s2` (up), as many, an acceleration is fed forward beside each; without, none is.
    """

    times_s: tuple[float, ...]
    altitudes_m: tuple[float, ...]
    accelerations_m_s2: tuple[float, ...] = ()

    @property
    def steps(self) -> tuple[int, ...]:
        """The loop's steps at which each is commanded."""
        return tuple(round(time_s * RATE_HZ) for time_s in self.times_s)

    def at(self, time_s: Samples) -> Samples:
        """Set point at each time, same shape; zero before the command."""
        return np.array((0.0, *self.altitudes_m))[np.searchsorted(self.times_s, time_s, side="right")]

    def acceleration_of(self, number: int) -> float:
        """What is fed forward beside the set point at this place, m/s² up."""
        return self.accelerations_m_s2[number] if self.accelerations_m_s2 else 0.0

    def acceleration_at(self, time_s: Samples) -> Samples:
        """What is fed forward at each time, m/s² up, same shape; zero before the command."""
        given = (0.0, *map(self.acceleration_of, range(len(self.times_s))))
        return np.array(given)[np.searchsorted(self.times_s, time_s, side="right")]

    @property
    def pushes(self) -> tuple[FlightEvent, ...]:
        """Where a feed-forward begins, and where it ends."""
        given = [self.acceleration_of(number) for number in range(len(self.times_s))]
        return tuple(
            FlightEvent(time_s, "Push" if after else "End of push")
            for time_s, (before, after) in zip(self.times_s[1:], pairwise(given), strict=True)
            if before != after
        )

    @property
    def targets(self) -> NDArray[np.int64]:
        """The loop's target in each step until the last change, shape (n,), 8 fractional bits; the last one holds."""
        return _targets(self)


@lru_cache(maxsize=64)
def _targets(set_points: SetPoints) -> NDArray[np.int64]:
    targets = np.empty(set_points.steps[-1] + 1, dtype=np.int64)
    for step, altitude_m in zip(set_points.steps, set_points.altitudes_m, strict=True):
        targets[step:] = fix(altitude_m, POSITION_BITS)
    return targets


def on_step(time_s: float) -> float:
    """The time of the loop's nearest step, s."""
    return round(time_s * RATE_HZ) / RATE_HZ
