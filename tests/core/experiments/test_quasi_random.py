"""The Halton sequence against scipy's and against its definition."""

import numpy as np
import pytest
from scipy.stats import qmc

from app.core.experiments.base import halton


@pytest.mark.parametrize("dimensions", [1, 3, 8, 27])
@pytest.mark.parametrize("count", [0, 1, 64, 1025])
def test_points_are_those_of_scipy_bit_for_bit(dimensions: int, count: int) -> None:
    expected = np.zeros((0, dimensions)) if count == 0 else qmc.Halton(dimensions, scramble=False).random(count)
    assert np.array_equal(halton(dimensions, count), expected)


def test_the_first_points_are_digits_in_reverse() -> None:
    assert halton(2, 4).tolist() == [[0.0, 0.0], [1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9]]
