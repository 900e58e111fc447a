"""The vehicle's clock, its time since boot: another one that goes on by itself is the sign of a restart.

Packets may be late, repeated, in any order, or corrupted: a single one by another clock says nothing.
"""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots.measurements import Position

AHEAD_S: Final = 2.0
"""Greatest gain of the vehicle's clock on ours between two packets, because their latencies may differ."""
EARLY_S: Final = 0.1
"""Most by which a position may be ahead of the vehicle's clock as it is known by those before it."""
STEPPED_S: Final = 0.1
"""Time for which positions that are ahead go on alone before their clock is the vehicle's."""
BACK_S: Final = 1.0
"""If the clock goes back by less than this, the packet was late."""
RESTARTED_S: Final = 0.4
"""Time for which another clock goes on alone before it is the vehicle's."""
BEHIND_S: Final = 20.0
"""A clock that fell behind ours by more than this was not only late: the vehicle may have restarted while nothing was
heard."""
KNOWN_BY: Final = 10
"""Positions by a clock before it is known to be the vehicle's. Fewer may be a stranger's, heard before the vehicle's
own positions were requested."""
WRAP_S: Final = 2.0**32 / 1000.0
"""After this time, 49.7 days, `time_boot_ms` begins at 0 again."""
_DRIFT: Final = 0.1
_SAME_CLOCK_S: Final = 0.5
_NEAR_WRAP_S: Final = 60.0


def unwrapped(position: Position, newest: Position | None) -> Position:
    """Return the position with a time that continues that of the newest one beyond WRAP_S."""
    near_wrap = newest is not None and newest.time_boot_s > WRAP_S - _NEAR_WRAP_S
    is_wrapped = near_wrap and position.time_boot_s < _NEAR_WRAP_S
    return replace(position, time_boot_s=position.time_boot_s + WRAP_S) if is_wrapped else position


def may_have_begun(time_boot_s: float, passed_s: float) -> bool:
    """Whether a clock with this time can have begun in the `passed_s` since the vehicle was last heard."""
    return time_boot_s <= (1.0 + _DRIFT) * passed_s + AHEAD_S


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherClock:
    """Positions by a clock other than the vehicle's so far: the first at `first_s` by our clock, the last at
    `last_s`."""

    first_s: float
    last_s: float
    last: Position

    @property
    def advances(self) -> bool:
        """Whether more than one position is by this clock."""
        return self.last_s > self.first_s

    def goes_on(self, position: Position, now_s: float) -> bool:
        """Whether the position is by this clock."""
        gained_s = position.time_boot_s - self.last.time_boot_s
        return gained_s > 0.0 and abs(gained_s - (now_s - self.last_s)) < _SAME_CLOCK_S


class RestartCounter:
    """Counts the restarts of a vehicle on the ground by its positions.

    A clock that jumps ahead counts, too: while this computer slept, the vehicle may have restarted.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self._last: Position | None = None
        self._last_s = 0.0
        self._heard = 0
        self._other: OtherClock | None = None

    def take(self, position: Position, now_s: float) -> None:
        """Process a position received at `now_s` by our clock."""
        position = unwrapped(position, self._last)
        if self._last is None or self._is_expected(self._last, position, now_s):
            self._last, self._last_s, self._other = position, now_s, None
            self._heard += 1
        elif not -BACK_S <= position.time_boot_s - self._last.time_boot_s <= 0.0:  # otherwise it is late or repeated
            self._take_other(position, now_s)

    def _is_expected(self, last: Position, position: Position, now_s: float) -> bool:
        """Whether the position is by the same clock. One that fell behind may be that of a simulation that stood still,
        unless it can have begun since the last position."""
        gained_s, passed_s = position.time_boot_s - last.time_boot_s, now_s - self._last_s
        is_behind = gained_s < (1.0 - _DRIFT) * passed_s - BEHIND_S
        return 0.0 < gained_s <= passed_s + AHEAD_S and not (
            is_behind and may_have_begun(position.time_boot_s, passed_s)
        )

    def _take_other(self, position: Position, now_s: float) -> None:
        other = self._other
        first_s = other.first_s if other is not None and other.goes_on(position, now_s) else now_s
        if now_s - first_s < RESTARTED_S:
            self._other = OtherClock(first_s=first_s, last_s=now_s, last=position)
        else:
            self.restarts += self._heard >= KNOWN_BY
            self._last, self._last_s, self._other, self._heard = position, now_s, None, 1
