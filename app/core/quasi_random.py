"""Points that fill a box evenly, the same every time."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

_PRIMES: Final = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)


def halton(dimensions: int, count: int) -> NDArray[np.float64]:
    """The first points of the Halton sequence in the unit cube, shape (count, dimensions), of up to 16 dimensions.

    Coordinate d of point i holds the digits of i in base p, the d-th prime, in reverse order behind the point (Halton,
    1960). The same numbers as `scipy.stats.qmc.Halton(dimensions, scramble=False)`, whose package takes longer to
    import than a proposal takes to compute.
    """
    points = np.zeros((count, dimensions))
    for dimension, base in zip(range(dimensions), _PRIMES[:dimensions], strict=True):
        remaining, digit_value = np.arange(count), 1.0 / base
        while remaining.any():
            remaining, digit = np.divmod(remaining, base)
            points[:, dimension] += digit * digit_value
            digit_value /= base
    return points
