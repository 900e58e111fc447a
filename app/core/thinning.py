"""Reduction of samples for plotting.

Records keep their peaks and shape (MinMaxLTTB, Van Der Donckt et al., 2023); smooth curves keep the samples at which
they bend (Ramer, 1972; Douglas and Peucker, 1973).
"""

import numpy as np
from numpy.typing import NDArray

from app.core.trajectory import Samples

Indices = NDArray[np.uint64]


def select_samples(time_s: Samples, values: Samples, points: int) -> Indices:
    """Indices of at most `points` samples, shape (k,), in order, including the first and the last."""
    if len(time_s) <= points:
        return np.arange(len(time_s), dtype=np.uint64)
    from tsdownsample import MinMaxLTTBDownsampler

    downsampler = MinMaxLTTBDownsampler()  # type: ignore[no-untyped-call]  # the library has no types
    chosen: Indices = downsampler.downsample(np.ascontiguousarray(time_s), np.ascontiguousarray(values), n_out=points)
    return chosen


def select_bends(time_s: Samples, values: Samples, tolerance: float) -> Indices:
    """Indices of samples, shape (k,), in order, whose polyline passes every other sample within `tolerance`.

    `tolerance` is in the unit of the values. The first and the last sample are included. The times must increase.
    """
    if len(time_s) < 3:
        return np.arange(len(time_s), dtype=np.uint64)
    needed = {0, len(time_s) - 1}
    spans = [(0, len(time_s) - 1)]
    while spans:
        first, last = spans.pop()
        ends = [first, last]
        off = np.abs(values[first:last] - np.interp(time_s[first:last], time_s[ends], values[ends]))
        furthest = first + int(np.argmax(off))
        if off[furthest - first] > tolerance:
            needed.add(furthest)
            spans += [(first, furthest), (furthest, last)]
    return np.array(sorted(needed), dtype=np.uint64)
