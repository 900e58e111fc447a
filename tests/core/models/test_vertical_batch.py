"""Takeoffs flown side by side, against the same takeoffs flown one by one."""

import numpy as np
import pytest

from app.core.control.vertical_guidance import RATE_HZ
from app.core.experiments.base import Matrix, ParameterDistribution
from app.core.experiments.takeoff import Takeoff
from app.core.models.set_points import SetPoints
from app.core.models.vertical import (
    BATTERY_SAG,
    MEASUREMENT_DELAY_S,
    START_LATENCY_S,
    Counts,
    decay,
    fly_each,
)
from app.core.models.vertical_batch import BATCH_WIDTH, are_exact, fly_batch

SET_POINTS = SetPoints((0.0,), (3.0,))
SAMPLES = 2000
"""Past the second in which the loop finds out that it flies."""


def models(count: int) -> Matrix:
    """Every parameter at work."""
    parameters = Takeoff().model_parameters
    covariance = np.diag([parameter.prior_sd**2 for parameter in parameters])
    spread = ParameterDistribution(
        mean=tuple(parameter.prior_mean + 0.5 * parameter.prior_sd for parameter in parameters),
        covariance=tuple(tuple(row) for row in covariance.tolist()),
        origin="",
    )
    return spread.models(Takeoff(), np.random.default_rng(1).random((count, len(spread.mean))))


def gain_sets(count: int) -> Counts:
    return np.random.default_rng(2).integers((100, 0, 30), (4000, 1073, 409), size=(count, 3))


def one_by_one(gains: Counts, each: Matrix) -> Matrix:
    return fly_each(gains, each, SET_POINTS, SAMPLES)


def test_side_by_side_is_bit_for_bit_one_by_one() -> None:
    gains, each = gain_sets(BATCH_WIDTH + 2), models(BATCH_WIDTH + 2)
    assert np.array_equal(fly_batch(gains, each, SET_POINTS, SAMPLES), one_by_one(gains, each))


def test_gains_whose_products_wrap_fly_as_the_autopilot_wraps_them() -> None:
    gains, each = gain_sets(3), models(3)
    gains[1] = (1600, 1023, 3000)
    assert are_exact(gains).tolist() == [True, False, True]
    assert np.array_equal(fly_batch(gains, each, SET_POINTS, SAMPLES), one_by_one(gains, each))


def test_a_measurement_delay_beyond_what_lanes_remember_is_flown_alone() -> None:
    gains, each = gain_sets(2), models(2)
    each[1, MEASUREMENT_DELAY_S] = 0.2
    assert np.array_equal(fly_batch(gains, each, SET_POINTS, SAMPLES), one_by_one(gains, each))


def test_later_set_points_are_flown_side_by_side_as_one_by_one() -> None:
    gains, each = gain_sets(3), models(3)
    steps = SetPoints((0.0, 1.0, 2.5), (2.0, 1.5, 2.25))
    assert np.array_equal(fly_batch(gains, each, steps, SAMPLES), fly_each(gains, each, steps, SAMPLES))


def test_a_latency_shifts_the_climb_and_leaves_later_set_points_at_their_times() -> None:
    """Half a step of latency: between the samples until the first change, which comes when it is commanded."""
    gains, on_time = gain_sets(1), models(1)
    on_time[0, [START_LATENCY_S, BATTERY_SAG]] = 0.0
    late = on_time.copy()
    late[0, START_LATENCY_S] = 0.5 / RATE_HZ
    steps, change = SetPoints((0.0, 2.0), (2.0, 1.5)), 2 * RATE_HZ
    (prompt,), (shifted,) = (fly_each(gains, each, steps, SAMPLES) for each in (on_time, late))
    assert shifted[1:change] == pytest.approx((prompt[: change - 1] + prompt[1:change]) / 2, abs=1e-12)
    assert np.array_equal(shifted[change:], prompt[change:])


def test_targets_change_at_the_loops_step_and_the_last_one_holds() -> None:
    steps = SetPoints((0.0, 1.0, 2.0), (3.0, 2.7, 3.0))
    assert steps.targets[[0, 511, 512, 1023, 1024]].tolist() == [768, 768, 691, 691, 768]
    assert len(steps.targets) == 1025
    assert steps.at(np.array([-0.1, 0.0, 0.999, 1.0, 2.0, 9.0])).tolist() == [0.0, 3.0, 3.0, 2.7, 3.0, 3.0]


def test_the_decay_with_height_is_the_exponential_function() -> None:
    distances = np.linspace(0.0, 80.0, 400)
    assert np.allclose([decay(x) for x in distances.tolist()], np.exp(-distances), rtol=0.0, atol=1e-13)
