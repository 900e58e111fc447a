"""Two clocks that watch one climb: synthetic takeoffs whose delay, drift and noise are known."""

import numpy as np
import pytest

from app.core.errors import TrajectoryError
from app.core.records.alignment import Alignment, align, compare, find_delay, resample
from app.core.records.trajectory import Samples

VEHICLE_S = np.arange(-1.0, 33.0, 1.0 / 51.2)
CAMERAS_S = np.arange(-2.0, 34.5, 0.01)


def climb_m(time_s: Samples) -> Samples:
    """From the ground to 3 m, with an overshoot."""
    flown = np.clip(time_s - 0.4, 0.0, None)
    return 3.0 * (1.0 - np.exp(-flown) * (np.cos(2.0 * flown) + 0.5 * np.sin(2.0 * flown)))


def seen_m(time_s: Samples, delay_s: float, *, noise_m: float = 0.0, seed: int = 1) -> Samples:
    return climb_m(time_s - delay_s) + noise_m * np.random.default_rng(seed).standard_normal(len(time_s))


@pytest.mark.parametrize("delay_s", [-0.93, -0.2, -0.0037, 0.0, 0.041, 0.5, 0.97])
def test_the_delay_between_two_noisy_sources_is_found_within_5_ms(delay_s: float) -> None:
    vehicle_m, cameras_m = seen_m(VEHICLE_S, 0.0, noise_m=0.01), seen_m(CAMERAS_S, delay_s, noise_m=0.002, seed=2)
    assert find_delay(VEHICLE_S, vehicle_m, CAMERAS_S, cameras_m) == pytest.approx(delay_s, abs=0.005)


def test_a_drift_and_an_error_of_scale_do_not_pass_for_a_delay() -> None:
    drifting_m = 1.03 * seen_m(CAMERAS_S, 0.04) + 0.01 * CAMERAS_S
    assert find_delay(VEHICLE_S, climb_m(VEHICLE_S), CAMERAS_S, drifting_m) == pytest.approx(0.04, abs=0.005)


def test_the_other_source_comes_back_on_the_record_s_times_and_datum() -> None:
    altitude_m, cameras_m = climb_m(VEHICLE_S), seen_m(CAMERAS_S, 0.06) + 0.12
    found = align(VEHICLE_S, altitude_m, CAMERAS_S, cameras_m, rest_until_s=0.0)
    assert found.datum_m == pytest.approx(0.12, abs=1e-6)
    other_m = resample(VEHICLE_S, CAMERAS_S, cameras_m, found)
    assert other_m.shape == VEHICLE_S.shape
    apart = compare(VEHICLE_S, altitude_m, other_m)
    assert apart.largest_m < 0.02
    assert apart.rms_m < 0.002


def test_a_drifting_source_is_reported_with_the_largest_difference_and_its_time() -> None:
    other_m = climb_m(VEHICLE_S) + np.interp(VEHICLE_S, (10.0, 20.0, 20.1), (0.0, -0.5, 0.0))
    apart = compare(VEHICLE_S, climb_m(VEHICLE_S), other_m)
    assert apart.largest_m == pytest.approx(0.5, abs=0.01)
    assert apart.at_s == pytest.approx(20.0, abs=0.02)
    assert apart.rms_m == pytest.approx(0.5 * np.sqrt(10.0 / 3.0 / 34.0), rel=0.02)


def test_where_the_other_source_is_silent_its_nearest_value_stands() -> None:
    short_s = np.array([0.0, 1.0, 2.0])
    held = resample(np.array([-1.0, 0.5, 5.0]), short_s, short_s * 2.0, Alignment(delay_s=0.25, datum_m=1.0))
    assert held.tolist() == [-1.0, 0.5, 3.0]


@pytest.mark.parametrize(
    ("other_s", "other_m", "reason"),
    [
        (CAMERAS_S, np.zeros_like(CAMERAS_S), "moved by less than 0.3 m"),
        (CAMERAS_S, seen_m(CAMERAS_S, 3.0), "are not correlated enough"),
        (CAMERAS_S, seen_m(CAMERAS_S, 1.05), "more than 1 s apart"),
        (CAMERAS_S[:250], climb_m(CAMERAS_S[:250]), "overlap by less than 1 s"),
        (np.array([]), np.array([]), "overlap by less than 1 s"),
    ],
    ids=["never left the ground", "another flight", "too late", "too short", "nothing"],
)
def test_sources_that_cannot_be_aligned_say_why(other_s: Samples, other_m: Samples, reason: str) -> None:
    with pytest.raises(TrajectoryError, match=reason):
        find_delay(VEHICLE_S, climb_m(VEHICLE_S), other_s, other_m)


def test_a_record_that_begins_in_the_air_has_no_datum() -> None:
    with pytest.raises(TrajectoryError, match="no common time at rest"):
        align(VEHICLE_S, climb_m(VEHICLE_S), CAMERAS_S, climb_m(CAMERAS_S), rest_until_s=-1.0)
