"""Fewer samples that look the same."""

import numpy as np

from app.core.thinning import kept


def test_a_short_record_is_kept_whole() -> None:
    time_s = np.linspace(0.0, 1.0, 100)
    assert kept(time_s, np.sin(time_s), 100).tolist() == list(range(100))


def test_a_long_one_keeps_its_ends_and_a_single_samples_peak() -> None:
    time_s = np.linspace(0.0, 32.6, 16_700)
    altitude_m = np.minimum(time_s, 3.0)
    altitude_m[9_000] = 3.8
    indices = kept(time_s, altitude_m, 200)
    assert len(indices) <= 200
    assert (np.diff(indices.astype(int)) > 0).all()
    assert {0, 9_000, 16_699} <= set(indices.tolist())
