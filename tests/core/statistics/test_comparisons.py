"""Statistics of repeated flights, against scipy's own tests and the paper's figures."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

from app.autopilots.px4.experiments import EXPERIMENTS
from app.core.definition import Flight
from app.core.experiments.base import Scatter
from app.core.statistics.comparisons import (
    FlightsToDecide,
    Group,
    PooledScatter,
    compare,
    drift_of,
    groups_of,
    optimism,
    pool_scatter,
    select_winner,
    smallest_difference,
    trend_of,
)
from tests.core.tuning.bowl import fly

PAPER_SIGMA = 0.0141
"""Fig. 12, default gains."""
KNOWN = PooledScatter(sigma=PAPER_SIGMA, degrees_of_freedom=1e6)
ERRORS = st.lists(st.floats(0.05, 1.0), min_size=2, max_size=6)


def group(*errors: float, a: float = 1.0, first: int = 1) -> Group:
    return Group(gains={"a": a}, numbers=tuple(range(first, first + len(errors))), errors=errors)


def known(number: float | None) -> float:
    """A number of a comparison whose scatter is known."""
    assert number is not None
    return number


def test_the_papers_run_3_beats_run_2_by_1_4_standard_errors_only() -> None:
    """Table 2: 0.2537 and 0.2265 m; 5 % of the latter is 0.57 of a standard error of a difference (Fig. 12: 0.0141)."""
    said = compare(group(0.2265), group(0.2537), KNOWN, 0.95)
    assert said.difference / known(said.standard_error) == pytest.approx(-1.4, abs=0.05)
    five_percent = 0.05 * 0.2265
    assert five_percent == pytest.approx(0.011, abs=0.0005)
    assert five_percent / known(said.standard_error) == pytest.approx(0.57, abs=0.005)
    assert said.verdict == "unresolved"
    assert said.confidence == pytest.approx(stats.norm.cdf(1.364), abs=1e-3)


def test_without_a_prior_the_comparison_is_the_pooled_t_test() -> None:
    first, second = (0.21, 0.24, 0.22), (0.26, 0.25, 0.28, 0.27)
    groups = (group(*first), group(*second, a=2.0))
    said = compare(*groups, pool_scatter(groups, Scatter(sd=0.0, degrees_of_freedom=0.0)), 0.9)
    expected = stats.ttest_ind(first, second, alternative="less")
    assert said.confidence == pytest.approx(1.0 - expected.pvalue, abs=1e-12)
    assert said.difference / known(said.standard_error) == pytest.approx(expected.statistic, abs=1e-12)
    assert said.verdict == "better"


@given(ERRORS, ERRORS)
def test_pooling_and_comparing_agree_with_scipy(first: list[float], second: list[float]) -> None:
    groups = (group(*first), group(*second, a=2.0))
    scatter = pool_scatter(groups, Scatter(sd=0.01, degrees_of_freedom=4.0))
    squares = 4.0 * 0.01**2 + np.var(first) * len(first) + np.var(second) * len(second)
    freedom = 4 + len(first) + len(second) - 2
    assert scatter.degrees_of_freedom == freedom
    assert scatter.sigma == pytest.approx(np.sqrt(squares / freedom), rel=1e-9)
    said = compare(*groups, scatter, 0.9)
    t = said.difference / (scatter.sigma * np.sqrt(1 / len(first) + 1 / len(second)))
    assert said.confidence == pytest.approx(stats.t.cdf(abs(t), freedom), abs=1e-9)
    assert compare(groups[1], groups[0], scatter, 0.9).confidence == pytest.approx(said.confidence, abs=1e-12)


def test_a_difference_is_worse_when_it_goes_the_other_way() -> None:
    assert compare(group(0.30), group(0.20), KNOWN, 0.9).verdict == "worse"
    assert compare(group(0.30), group(0.20), KNOWN, 0.9).further is None


def test_the_best_of_many_gets_no_credit_for_having_been_chosen() -> None:
    """Bonferroni: five candidates count the chance of a mistake five times; the k-th look k(k + 1) times."""
    once = compare(group(0.20), group(0.23), KNOWN, 0.9)
    chosen = compare(group(0.20), group(0.23), KNOWN, 0.9, candidates=5)
    looked = compare(group(0.20), group(0.23), KNOWN, 0.9, looks=2)
    assert once.verdict == "better"
    assert chosen.verdict == "unresolved"
    assert 1.0 - known(chosen.confidence) == pytest.approx(5.0 * (1.0 - known(once.confidence)))
    assert 1.0 - known(looked.confidence) == pytest.approx(6.0 * (1.0 - known(once.confidence)))
    assert compare(group(0.2), group(0.2), KNOWN, 0.9, candidates=5).confidence == 0.0


def test_the_flights_said_to_decide_do_decide_if_the_difference_stays() -> None:
    scatter = PooledScatter(sigma=0.01, degrees_of_freedom=6.0)
    said = compare(group(0.195), group(0.205), scatter, 0.9)
    assert said.verdict == "unresolved"
    assert said.further is not None
    more = said.further
    assert abs(more.first - more.second) <= 1
    known = PooledScatter(sigma=0.01, degrees_of_freedom=6.0 + more.total)
    after = compare(group(*[0.195] * (1 + more.first)), group(*[0.205] * (1 + more.second)), known, 0.9)
    assert after.verdict == "better"
    fewer = PooledScatter(sigma=0.01, degrees_of_freedom=6.0 + more.total - 1)
    sizes = (more.first, 1 + more.second) if more.first > more.second else (1 + more.first, more.second)
    before = compare(group(*[0.195] * sizes[0]), group(*[0.205] * sizes[1]), fewer, 0.9)
    assert before.verdict == "unresolved"


def test_the_policy_with_fewer_flights_is_flown_first() -> None:
    said = compare(group(0.192, 0.192, 0.192), group(0.205), PooledScatter(sigma=0.01, degrees_of_freedom=8.0), 0.9)
    assert said.further == FlightsToDecide(first=0, second=1)


def test_what_a_hundred_flights_would_not_decide_is_not_promised() -> None:
    assert compare(group(0.2), group(0.2), KNOWN, 0.9).further is None


def test_without_any_scatter_every_difference_is_real() -> None:
    exact = PooledScatter(sigma=0.0, degrees_of_freedom=4.0)
    assert compare(group(0.2), group(0.2001), exact, 0.99).verdict == "better"
    assert compare(group(0.2), group(0.2), exact, 0.99).confidence == 0.0
    assert optimism([0.2, 0.3], [0.0, 0.0]) == 0.0


@pytest.mark.parametrize(("count", "expected"), [(1, 0.0), (2, 0.5642), (3, 0.8463), (5, 1.1630), (10, 1.5388)])
def test_the_optimism_of_equals_is_the_expected_extreme_of_normal_errors(count: int, expected: float) -> None:
    """Tables of normal order statistics (Harter 1961)."""
    assert optimism([0.3] * count, [0.01] * count) == pytest.approx(0.01 * expected, abs=2e-6)


def test_means_far_above_add_no_optimism_and_near_ones_some() -> None:
    """Against 2 million draws."""
    means, errors = np.array([0.20, 0.21, 0.23, 0.60]), np.array([0.010, 0.007, 0.014, 0.014])
    drawn = means + errors * np.random.default_rng(1).standard_normal((2_000_000, 4))
    chosen = drawn.argmin(axis=1)
    simulated = float(np.mean(means[chosen] - drawn.min(axis=1)))
    assert optimism(means.tolist(), errors.tolist()) == pytest.approx(simulated, abs=3e-5)
    assert optimism([0.2, 0.6], [0.01, 0.01]) == pytest.approx(0.0, abs=1e-9)


def test_groups_are_the_valid_flights_of_one_policy_in_their_order() -> None:
    flights = [fly(1, 10, 10), fly(2, 20, 20), fly(3, 10, 10)]
    aborted = Flight(number=4, gains=flights[0].gains, trajectory=flights[0].trajectory, error=None, outcome="aborted")
    first, second = groups_of([*flights, aborted])
    assert (first.gains, first.numbers) == ({"a": 10, "b": 10}, (1, 3))
    assert second.numbers == (2,)
    assert first.mean == pytest.approx(np.mean(first.errors))
    assert groups_of([]) == ()


def test_a_single_lucky_flight_does_not_overtake_what_was_shown_twice() -> None:
    scatter = PooledScatter(sigma=0.01, degrees_of_freedom=8.0)
    proven, lucky = group(0.200, 0.202), group(0.199, a=2.0, first=3)
    assert select_winner((proven, lucky), scatter) is proven
    clearly = group(0.190, a=2.0, first=3)
    assert select_winner((proven, clearly), scatter) is clearly


def test_the_drift_of_one_policy_is_its_slope_from_the_first_flight_to_the_last() -> None:
    assert drift_of([group(0.2), group(0.3, a=2.0, first=2)], KNOWN) is None
    found = drift_of([group(0.20, 0.25, 0.2141)], KNOWN)
    assert found is not None
    assert (found.first_number, found.last_number) == (1, 3)
    assert found.difference == pytest.approx(PAPER_SIGMA)
    assert found.standard_error == pytest.approx(PAPER_SIGMA * np.sqrt(2.0))
    assert found.confidence == pytest.approx(2.0 * stats.norm.cdf(np.sqrt(0.5)) - 1.0, abs=1e-4)


def test_the_drift_of_several_policies_is_the_slope_of_a_regression_with_a_level_for_each() -> None:
    """Least squares on the number and one indicator for each policy, solved by numpy."""
    first, second = (Group({"a": 1.0}, (1, 4, 6), (0.55, 0.50, 0.46)), Group({"a": 2.0}, (3, 5, 7), (0.15, 0.14, 0.12)))
    found = drift_of([first, Group({"a": 3.0}, (2,), (0.3,)), second], KNOWN)
    assert found is not None
    design = np.array(
        [[n, is_first, 1 - is_first] for ns, is_first in ((first.numbers, 1), (second.numbers, 0)) for n in ns]
    )
    slope = np.linalg.lstsq(design, np.array(first.errors + second.errors), rcond=None)[0][0]
    variance = np.linalg.inv(design.T @ design)[0, 0]
    assert (found.first_number, found.last_number) == (1, 7)
    assert found.difference == pytest.approx(6.0 * slope)
    assert found.standard_error == pytest.approx(6.0 * PAPER_SIGMA * np.sqrt(variance))


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(9.0, 12.6), st.floats(0.1, 0.6)), min_size=3, max_size=20))
@example([(9.75, 0.5625), (9.8125, 0.25), (9.8125, 0.25)])
def test_the_trend_is_scipys_regression(points: list[tuple[float, float]]) -> None:
    """The paper's Fig. 12: error against battery voltage."""
    volts, errors = [point[0] for point in points], [point[1] for point in points]
    found = trend_of(volts, errors, 0.9)
    if np.ptp(volts) < 1e-3 or np.ptp(errors) < 1e-9:  # scipy has no standard error for a line without scatter
        return
    assert found is not None
    expected = stats.linregress(volts, errors)
    assert found.slope == pytest.approx(expected.slope, rel=1e-6, abs=1e-9)
    # scipy takes it from 1 − r²: for points on one line that is rounding alone, of which the root is taken
    rounding = 1e-7 * max(abs(expected.slope), 1.0)
    assert found.standard_error == pytest.approx(expected.stderr, rel=1e-5, abs=rounding)
    half = stats.t.ppf(0.95, len(points) - 2) * expected.stderr
    assert (found.upper - found.lower) / 2 == pytest.approx(half, rel=1e-5, abs=1e-6)


def test_a_trend_needs_three_points_that_differ() -> None:
    assert trend_of([1.0, 2.0], [0.1, 0.2]) is None
    assert trend_of([1.0, 1.0, 1.0], [0.1, 0.2, 0.3]) is None
    rising = trend_of([1.0, 2.0, 3.0, 4.0], [0.1, 0.21, 0.29, 0.4])
    flat = trend_of([1.0, 2.0, 3.0, 4.0], [0.1, 0.3, 0.1, 0.3])
    assert rising is not None
    assert flat is not None
    assert (rising.is_resolved, flat.is_resolved) == (True, False)


def test_the_smallest_difference_shrinks_with_the_flights_that_are_left() -> None:
    scatter = PooledScatter(sigma=0.01, degrees_of_freedom=4.0)
    told = [smallest_difference(scatter, 1, left, 0.9) for left in range(5)]
    assert told[0] == np.inf
    assert told[1] == pytest.approx(stats.t.ppf(0.9, 4) * 0.01 * np.sqrt(2.0))
    assert told == sorted(told, reverse=True)


def test_an_interval_of_a_number_is_students() -> None:
    half = PooledScatter(sigma=0.01, degrees_of_freedom=4.0).half_width(2.0, 0.9)
    assert half == pytest.approx(stats.t.ppf(0.95, 4) * 0.01 * np.sqrt(2.0))


def test_the_standard_error_of_a_group_shrinks_with_the_root_of_its_size() -> None:
    assert group(0.1, 0.1, 0.1, 0.1).standard_error(KNOWN) == pytest.approx(PAPER_SIGMA / 2.0)


def test_a_pair_that_another_drones_scatter_would_tell_apart_is_not_known_yet_until_something_is_repeated() -> None:
    """Two flights under PX4, which scatter by 0.032 m, were "better, 93.9 %" by the 0.0105 m of the paper's drone."""
    first, second = group(0.541), group(0.6175)
    by_another = Scatter(sd=0.0105, degrees_of_freedom=1.0)
    assert compare(first, second, pool_scatter((first, second), by_another), 0.9).confidence == pytest.approx(
        0.939, abs=1e-3
    )
    said = compare(first, second, pool_scatter((first, second), EXPERIMENTS[0].scatter), 0.9)
    assert (said.verdict, said.confidence, said.standard_error, said.further) == ("not known yet", None, None, None)
    assert first.known_error(pool_scatter((first,), EXPERIMENTS[0].scatter)) is None
    again = group(0.541, 0.541 + 0.032 * 2**0.5)
    own = pool_scatter((again, second), EXPERIMENTS[0].scatter)
    assert (own.known, own.degrees_of_freedom) == (True, 1.0)
    assert own.sigma == pytest.approx(0.032)
    assert compare(again, second, own, 0.9).verdict == "unresolved"
