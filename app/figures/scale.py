"""Axis ranges that are robust against outliers, and thinned data for drawing."""

from collections.abc import Sequence
from statistics import median_low
from typing import Final

import numpy as np

from app.core.records.trajectory import Samples, select_bends, select_samples
from app.figures.data import Curve, Range

Points = tuple[list[float], list[float]]
"""Times and values to be drawn."""
MARGIN = 0.06
SMOOTH: Final = 1e-3
"""Allowed deviation of a drawn line from a smooth curve, as a share of its span: about a third of a pixel."""
SMOOTH_POINTS: Final = 1000
"""Number of samples among which the bends of a smooth curve are found."""


def robust_top(peaks: Sequence[float], *, low: float, high: float, spread: float = 5.0) -> tuple[float, list[int]]:
    """The upper end of an axis from `low` on that covers `high` and every peak that is not an outlier, and the indices
    of the outliers.

    A peak is an outlier if it exceeds `high` by more than half of the range `low` … `high`, and the (low) median of the
    peaks by more than `spread` times their median absolute deviation.
    """
    middle = median_low(peaks) if peaks else high
    deviation = median_low([abs(peak - middle) for peak in peaks]) if peaks else 0.0
    limit = max(high + 0.5 * (high - low), middle + spread * deviation)
    top = max([high, *(peak for peak in peaks if peak <= limit)])
    return top + MARGIN * (top - low), [index for index, peak in enumerate(peaks) if peak > limit]


RobustSpan = tuple[float, float, tuple[int, ...]]


def robust_span(curves: Sequence[Samples], *, low: float, high: float) -> RobustSpan:
    """A two-sided range for whole curves: low, high, and the curves that leave it on either side."""
    if not curves:
        curves = [np.array([low, high])]
    top, above = robust_top([float(values.max()) for values in curves], low=low, high=high)
    bottom, below = robust_top([-float(values.min()) for values in curves], low=-high, high=-low)
    return -bottom, top, tuple(sorted({*above, *below}))


def span_around(goal: Samples, curves: Sequence[Samples], *, headroom: float = 1.0) -> RobustSpan:
    """The range from the ground to the goal, with room above it, and of the curves around it; if the goal is zero, that
    of the first curve."""
    low, high = min(0.0, float(goal.min())), headroom * max(0.0, float(goal.max()))
    if low == high and curves:
        low, high = min(low, float(curves[0].min())), max(high, float(curves[0].max()))
    return robust_span(curves, low=low, high=high)


def thinned(curve: Curve, points: int, window: Range | None = None) -> Points:
    """At most `points` samples that preserve the curve's shape and extremes.

    Times are rounded to 0.1 ms, values to four decimals, or five if the curve stays below 1. With a `window` of
    seconds, as many again inside it, up to its edges and just past them.
    """
    chosen = select_samples(curve.time_s, curve.values, points)
    if window is not None:
        first, end = window.slice_of(curve.time_s)
        seen = curve.part(slice(first, end))
        inside = first + select_samples(seen.time_s, seen.values, points).astype(np.int64)
        chosen = np.concatenate([chosen[chosen < first], inside.astype(np.uint64), chosen[chosen >= end]])
    return _short(curve.part(chosen))


def thin_by_bends(curve: Curve) -> Points:
    """The samples at which a smooth curve bends, for a line without hover text."""
    near = curve.part(select_samples(curve.time_s, curve.values, SMOOTH_POINTS))
    tolerance = SMOOTH * float(np.ptp(near.values)) if near else 0.0
    return _short(near.part(select_bends(near.time_s, near.values, tolerance)))


def _short(curve: Curve) -> Points:
    digits = 4 if not curve or float(np.abs(curve.values).max()) >= 1.0 else 5
    return [round(t, 4) for t in curve.time_s.tolist()], [round(v, digits) for v in curve.values.tolist()]
