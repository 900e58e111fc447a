"""Time alignment of two altitude sources with separate clocks, and the difference between them.

The correlation uses the change of each altitude within 0.2 s, not the altitude itself. Otherwise a slow drift between
the two sources, or a scale error, would look like a delay.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples

RANGE_S: Final = 1.0
"""Largest delay searched for, in either direction."""
STEP_S: Final = 0.005

_REACH: Final = 20
"""Half width of the interval over which the change of altitude is taken, in steps."""
_LEAST_MOTION_M: Final = 0.3
_LEAST_CORRELATION: Final = 0.8
_SHORTEST_S: Final = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Delay and offset of the other source.

    `delay_s` is how much later the other source shows the same motion; `datum_m` is how much higher it reads at rest.
    """

    delay_s: float
    datum_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """Difference between two aligned sources: the largest, when it occurred, and the root mean square."""

    largest_m: float
    at_s: float
    rms_m: float


def find_delay(time_s: Samples, altitude_m: Samples, other_time_s: Samples, other_m: Samples) -> float:
    """Return the delay of the other source, s, to a fraction of 5 ms, within ±1 s; positive when it lags.

    Times, shapes (n,) and (k,), must increase strictly; the clocks must already agree within 1 s. Raises
    TrajectoryError when the records overlap too little, contain too little motion, or are not correlated.
    """
    start_s = max(time_s[0], other_time_s[0] + RANGE_S) if len(time_s) and len(other_time_s) else 0.0
    end_s = min(time_s[-1], other_time_s[-1] - RANGE_S) if len(time_s) and len(other_time_s) else 0.0
    if end_s - start_s < _SHORTEST_S:
        raise _unalignable(f"overlap by less than {_SHORTEST_S:g} s with a margin of {RANGE_S:g} s on either side")
    grid_s = np.arange(start_s, end_s, STEP_S)
    lags = round(RANGE_S / STEP_S)
    wide_s = grid_s[0] + STEP_S * np.arange(-lags, len(grid_s) + lags)
    altitude, other = np.interp(grid_s, time_s, altitude_m), np.interp(wide_s, other_time_s, other_m)
    if min(np.ptp(altitude), np.ptp(other)) < _LEAST_MOTION_M:
        raise _unalignable(f"moved by less than {_LEAST_MOTION_M:g} m")
    likeness = _correlations(_changes(altitude), _changes(other))
    best = int(np.argmax(likeness))
    if likeness[best] < _LEAST_CORRELATION:
        raise _unalignable(
            f"are not correlated enough ({likeness[best]:.2f}, at least {_LEAST_CORRELATION:g} is required)"
        )
    if best in {0, len(likeness) - 1}:
        raise _unalignable(f"are more than {RANGE_S:g} s apart")
    return float(best - lags + _vertex(*likeness[best - 1 : best + 2])) * STEP_S


def align(
    time_s: Samples, altitude_m: Samples, other_time_s: Samples, other_m: Samples, *, rest_until_s: float
) -> Alignment:
    """Return the delay, and the offset while both were at rest, before `rest_until_s`.

    Raises TrajectoryError as `find_delay` does, and when the record has no samples before `rest_until_s`.
    """
    delay_s = find_delay(time_s, altitude_m, other_time_s, other_m)
    apart_m = np.interp(time_s + delay_s, other_time_s, other_m) - altitude_m
    rested = time_s < rest_until_s
    if not rested.any():
        raise _unalignable("have no common time at rest")
    return Alignment(delay_s=delay_s, datum_m=float(np.median(apart_m[rested])))


def resample(time_s: Samples, other_time_s: Samples, other_m: Samples, alignment: Alignment) -> Samples:
    """Resample the other source at the times of the first, with the offset removed: shape (n,).

    Before its first and after its last sample, the nearest value holds.
    """
    return np.interp(time_s + alignment.delay_s, other_time_s, other_m) - alignment.datum_m


def compare(time_s: Samples, altitude_m: Samples, other_m: Samples) -> Disagreement:
    """Compare two channels of one record, each of shape (n,), n > 0."""
    apart_m = np.abs(other_m - altitude_m)
    worst = int(np.argmax(apart_m))
    rms_m = float(np.sqrt(np.mean(apart_m**2)))
    return Disagreement(largest_m=float(apart_m[worst]), at_s=float(time_s[worst]), rms_m=rms_m)


def _changes(altitude_m: Samples) -> Samples:
    """Change of altitude within 0.2 s around each step, shape (n − 40,)."""
    return altitude_m[2 * _REACH :] - altitude_m[: -2 * _REACH]


def _correlations(first: Samples, wide: Samples) -> Samples:
    """Pearson correlation of `first`, shape (n,), with every window of its length in `wide`.

    `wide` has shape (n + m,), the result (m + 1,); 0 for a window without motion.
    """
    stretches = sliding_window_view(wide, len(first))
    centred = first - first.mean()
    spread = np.sqrt((centred**2).sum()) * np.sqrt(len(first)) * stretches.std(axis=1)
    likeness = np.zeros(len(stretches))
    np.divide(stretches @ centred, spread, out=likeness, where=spread > 0.0)
    return likeness


def _vertex(before: float, top: float, after: float) -> float:
    """Maximum of the parabola through three values one step apart, in steps from the middle one."""
    curvature = before - 2.0 * top + after
    return 0.5 * (before - after) / curvature if curvature < 0.0 else 0.0


def _unalignable(reason: str) -> TrajectoryError:
    return TrajectoryError(
        "The two sources of altitude cannot be aligned in time.",
        problems=(Problem("altitude_2_m", f"the two {reason}"),),
        hint="Check that both measure the same vehicle, from before the takeoff until after it.",
    )
