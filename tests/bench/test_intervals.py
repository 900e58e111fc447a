"""What the bench of intervals calls true, and its arithmetic; what it counts is measured by the bench itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from app.core.control.vertical_guidance import STEP_S
from bench.copters.made_logs import truth_of
from bench.intervals import KINDS, Estimated, estimate, judge, shares
from bench.targets.made_takeoffs import ground_log
from tests.core.analysis.flights import QUIET
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only
RATE_M_S = np.array([1.5, -1.5, 1.5])


def test_a_vehicle_of_the_models_own_kind_has_its_own_parameters() -> None:
    found = truth_of(QUIET, lasts_s=17.0, climb_rate_m_s=RATE_M_S, step_s=0.0025)
    own = {"hover_throttle": 0.4, "thrust_slope": 1.0, "motor_lag_s": 0.05, "drag_1_s": 0.3}
    assert found == pytest.approx(own, rel=1e-3)


def test_what_the_model_lacks_counts_for_what_it_does() -> None:
    """Dead time late by whole steps, drag that grows with the speed as at the speed flown, a battery as it is in the
    middle of the flight: 33 s take a tenth of the thrust, the middle of 2 … 20 s a thirtieth."""
    copter = replace(QUIET, quadratic=0.5, dead_time_s=0.01, drag_1_m=0.1, sag=0.1)
    found = truth_of(copter, lasts_s=20.0, climb_rate_m_s=RATE_M_S, step_s=0.0025)
    thrust = 0.5 * 0.4 + 0.5 * 0.4**2
    hover = -0.5 + math.sqrt(0.25 + 2.0 * thrust / (1.0 - 0.1 / 3.0))
    assert found["hover_throttle"] == pytest.approx(hover, rel=1e-6)
    assert found["thrust_slope"] == pytest.approx((0.5 + hover) / (0.5 + 0.5 * hover), rel=1e-3)
    assert found["drag_1_s"] == pytest.approx(0.3 + 0.1 * 1.5)
    assert found["motor_lag_s"] == pytest.approx(0.06, rel=1e-3)


def test_an_interval_of_nine_in_ten() -> None:
    assert Estimated(truth=1.0, value=1.16, deviation=0.1).is_inside
    assert not Estimated(truth=1.0, value=1.17, deviation=0.1).is_inside
    assert Estimated(truth=1.0, value=2.0, deviation=0.1).width == pytest.approx(0.329)


def test_shares_are_of_the_vehicles_and_by_parameter() -> None:
    inside, outside = Estimated(1.0, 1.0, 0.1), Estimated(1.0, 2.0, 0.1)
    assert shares([{"a": inside, "b": outside}, {"a": inside, "b": inside}]) == {"a": 1.0, "b": 0.5}


@pytest.mark.complete
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "Paparazzi's .data"])
def test_a_log_of_each_kind_tells_the_parameters_of_its_vehicle(kind: str) -> None:
    """Of 16 parameters of four vehicles 14.4 are expected inside; fewer than 11 are in one of 60 such runs."""
    judged = [judge(number, kind=kind) for number in range(4)]
    assert sum(each.is_inside for found in judged if found for each in found.values()) >= 11


@pytest.mark.complete
def test_a_takeoff_tells_the_parameters_of_its_vehicle() -> None:
    log = ground_log(1)
    assert 0.0 < log.truth["start_latency_s"] <= 26 * STEP_S
    found = estimate(log)
    assert found.keys() == log.truth.keys()
    assert abs(found["hover_throttle"][0] - log.truth["hover_throttle"]) < 4.0 * found["hover_throttle"][1]
