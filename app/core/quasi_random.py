"""Deterministic points that fill a box evenly."""

from itertools import count as numbers_from
from itertools import islice

import numpy as np
from numpy.typing import NDArray


def halton(dimensions: int, count: int) -> NDArray[np.float64]:
    """The first points of the Halton sequence in the unit cube, shape (count, dimensions).

    Coordinate d of point i is the radical inverse of i in base p, the d-th prime: its digits reversed behind the point
    (Halton, 1960). The same numbers as `scipy.stats.qmc.Halton(dimensions, scramble=False)`, a package that takes
    longer to import than a proposal takes to compute.
    """
    points = np.zeros((count, dimensions))
    for dimension, base in enumerate(_primes(dimensions)):
        remaining, digit_value = np.arange(count), 1.0 / base
        while remaining.any():
            remaining, digit = np.divmod(remaining, base)
            points[:, dimension] += digit * digit_value
            digit_value /= base
    return points


def _primes(count: int) -> list[int]:
    """The first prime numbers."""
    return list(islice((n for n in numbers_from(2) if all(n % divisor for divisor in range(2, n))), count))
