"""Fewer samples that look the same."""

import numpy as np

from app.core.records.trajectory import select_bends, select_samples


def test_a_short_record_is_kept_whole() -> None:
    time_s = np.linspace(0.0, 1.0, 100)
    assert select_samples(time_s, np.sin(time_s), 100).tolist() == list(range(100))


def test_a_long_one_keeps_its_ends_and_a_single_samples_peak() -> None:
    time_s = np.linspace(0.0, 32.6, 16_700)
    altitude_m = np.minimum(time_s, 3.0)
    altitude_m[9_000] = 3.8
    indices = select_samples(time_s, altitude_m, 200)
    assert len(indices) <= 200
    assert (np.diff(indices.astype(int)) > 0).all()
    assert {0, 9_000, 16_699} <= set(indices.tolist())


def test_a_step_needs_its_corners_only() -> None:
    time_s = np.linspace(0.0, 32.6, 16_700)
    set_point_m = np.where(time_s < 10.0, 0.0, 3.0)
    after = int(np.searchsorted(time_s, 10.0))
    assert select_bends(time_s, set_point_m, 1e-3).tolist() == [0, after - 1, after, 16_699]


def test_a_smooth_climb_is_passed_within_the_tolerance_everywhere() -> None:
    time_s = np.linspace(0.0, 32.6, 16_700)
    altitude_m = 3.0 - 3.0 * np.exp(-1.5 * time_s) * (1.0 + 1.5 * time_s)
    chosen = select_bends(time_s, altitude_m, 1e-3)
    assert len(chosen) < 60
    np.testing.assert_allclose(np.interp(time_s, time_s[chosen], altitude_m[chosen]), altitude_m, rtol=0, atol=1e-3)


def test_of_two_samples_both_are_needed_and_of_none_none() -> None:
    assert select_bends(np.array([0.0, 1.0]), np.array([2.0, 3.0]), 1.0).tolist() == [0, 1]
    assert select_bends(np.array([]), np.array([]), 1.0).tolist() == []
