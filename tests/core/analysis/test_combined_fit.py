"""Logs of one vehicle fitted together from what is stored of each, against the fit of their rows together, against
numbers by hand, and against the truth."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pytest

from app.core.analysis.combined_fit import FITTED, LogFit, combine, log_fit
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.vehicle_fit import fit_copter
from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.core.analysis.px4_flights import simulated_px4
from tests.core.tuning.flying import compiled_only

USUAL = ((1.0, 0.25), (0.06, 0.04), (0.4, 0.25))


def told(
    slope: float, deviation: float, *, error: float = 0.0, hover: float = 0.4, usual: float = USUAL[0][1]
) -> LogFit:
    """A fit that holds the usual lag and drag, and whose flight alone tells the slope with this deviation."""
    variance = 1.0 / (deviation**-2 + usual**-2)
    mean = variance * (slope * deviation**-2 + USUAL[0][0] * usual**-2)
    return LogFit(
        mean=[hover, mean, USUAL[1][0], USUAL[2][0]],
        covariance=np.diag([1e-6, variance + error**2, USUAL[1][1] ** 2, USUAL[2][1] ** 2]).tolist(),
        usual=[(USUAL[0][0], usual), *USUAL[1:]],
        slope_error=error,
    )


def test_what_is_usual_counts_once() -> None:
    found = combine([told(1.2, 0.1), told(1.3, 0.2)])
    precision = 1.0 / 0.1**2 + 1.0 / 0.2**2 + 1.0 / 0.25**2
    assert found.mean["thrust_slope"] == pytest.approx((1.2 / 0.01 + 1.3 / 0.04 + 1.0 / 0.0625) / precision)
    assert (found.mean["motor_lag_s"], found.mean["drag_1_s"]) == pytest.approx((0.06, 0.4))
    assert (found.remaining["motor_lag_s"], found.remaining["drag_1_s"]) == pytest.approx((1.0, 1.0))


def test_one_log_together_with_none_is_itself() -> None:
    found = combine([told(1.2, 0.1, error=0.05)])
    assert found.deviation["thrust_slope"] ** 2 == pytest.approx(told(1.2, 0.1, error=0.05).covariance[1][1])
    assert list(found.remaining.values()) == pytest.approx([1.0, 1.0, 1.0])
    assert (found.contradiction, found.hover_spread) == (0.0, 0.0)


@pytest.mark.parametrize("logs", [2, 4])
def test_the_deviation_of_equal_logs_falls_with_their_root(logs: int) -> None:
    """But for the estimator's error, for the 0.45 of each deviation that is alike in all logs of a vehicle, and for
    what is usual, which is wide here."""
    found = combine([told(1.2, 0.1, error=0.06, usual=5.0)] * logs)
    alike, independent = 0.45**2 * 0.1**2, (1.0 - 0.45**2) * 0.1**2
    variance = independent / logs + alike + 0.06**2
    assert found.deviation["thrust_slope"] == pytest.approx(np.sqrt(variance), rel=0.01)
    assert found.remaining["thrust_slope"] == pytest.approx(np.sqrt(variance / (0.1**2 + 0.06**2)), rel=0.01)


def test_a_log_that_tells_less_than_is_usual_adds_nothing() -> None:
    """As draws may come out, by chance."""
    vague = replace(told(1.2, 0.1), covariance=np.diag([1e-6, 0.3**2, 0.05**2, 0.3**2]).tolist())
    found = combine([vague, told(1.2, 0.1)])
    assert found.deviation == pytest.approx(combine([told(1.2, 0.1)]).deviation)


def test_a_deviation_below_the_estimators_error_is_not_believed() -> None:
    sure = told(1.2, 0.01, error=0.06)
    found = combine([replace(sure, covariance=np.diag([1e-6, 1e-4, 1.6e-3, 0.0625]).tolist())] * 3)
    assert found.deviation["thrust_slope"] > 0.06


def test_a_vague_log_does_not_widen_what_a_good_one_tells() -> None:
    good, vague = told(1.2, 0.02), told(1.1, 0.15)
    alone, found = (combine(each).deviation["thrust_slope"] for each in ([good], [good, vague]))
    assert 0.9 * alone < found <= alone


def test_other_propellers_are_noticed() -> None:
    assert combine([told(1.2, 0.05), told(1.25, 0.05)]).is_one_vehicle
    changed = combine([told(0.9, 0.05), told(1.25, 0.05)])
    assert not changed.is_one_vehicle
    assert changed.contradiction > 0.999


def test_a_log_that_says_nothing_about_the_slope_does_not_tell_of_other_propellers() -> None:
    """Seen: certain, where the variance was that of vehicles in general."""
    vague = [replace(told(1.1, 0.1), covariance=np.diag([1e-6, each, 1e-4, 0.01]).tolist()) for each in (0.0615, 0.2)]
    for each in vague:
        assert combine([each, told(1.25, 0.05)]).contradiction == 0.0


def test_the_hover_throttle_stays_that_of_each_log() -> None:
    found = combine([told(1.2, 0.1, hover=each) for each in (0.38, 0.4, 0.42)])
    assert found.hover_throttles == [0.38, 0.4, 0.42]
    assert found.hover_spread == pytest.approx(0.02)


@compiled_only
@pytest.mark.parametrize(
    "fly", [lambda seed: simulated_flight(GUSTY, seed=seed), lambda seed: simulated_px4(seed=seed)]
)
def test_two_logs_tell_what_their_rows_together_tell(fly: Callable[[int], LoggedFlight]) -> None:
    flights = [fly(seed) for seed in (1, 2)]
    fits = [log_fit(fit_copter(each), each.loop) for each in flights]
    stored = [LogFit(**json.loads(json.dumps(asdict(each)))) for each in fits]
    assert combine(stored) == combine(fits)
    found, together = combine(fits), fit_copter(*flights)
    for name in FITTED[1:]:
        deviation = getattr(together.deviation, name)
        assert found.mean[name] == pytest.approx(getattr(together.mean, name), abs=deviation)
        assert 0.9 * deviation < found.deviation[name] < 1.25 * deviation
        assert 0.7 <= found.remaining[name] <= 1.0
