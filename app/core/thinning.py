"""Fewer samples that look the same: MinMaxLTTB (Van Der Donckt et al., 2023) keeps a curve's peaks and its shape."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from tsdownsample import MinMaxLTTBDownsampler

from app.core.trajectory import Samples

Indices = NDArray[np.uint64]

_DOWNSAMPLER: Final = MinMaxLTTBDownsampler()  # type: ignore[no-untyped-call]  # the library has no types


def kept(time_s: Samples, values: Samples, points: int) -> Indices:
    """Indices of at most `points` samples, shape (k,), in their order, the first and the last among them."""
    if len(time_s) <= points:
        return np.arange(len(time_s), dtype=np.uint64)
    chosen: Indices = _DOWNSAMPLER.downsample(np.ascontiguousarray(time_s), np.ascontiguousarray(values), n_out=points)
    return chosen
