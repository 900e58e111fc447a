"""The fitted vehicle, against the real binary's and against simulated ones."""

from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.replica.parameters import Parameters
from app.core.analysis.vehicle_fit import fit_copter
from bench.copters.simulation import fly_steps, sample
from tests.core.analysis.flights import GUSTY, QUIET, recorded_steps, simulated_flight
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


def test_the_vehicle_of_the_real_binary_is_found() -> None:
    """SITL's quadrotor: thrust in proportion to throttle, drag 0.30 1/s, no lag; hover throttle 0.3645 in the log."""
    estimate = fit_copter(recorded_steps())
    assert estimate.mean.thrust_slope == pytest.approx(1.0, abs=0.01)
    assert estimate.mean.drag_1_s == pytest.approx(0.30, abs=0.02)
    assert estimate.mean.motor_lag_s == pytest.approx(0.0, abs=0.005)
    assert estimate.mean.hover_throttle == pytest.approx(0.3645, abs=0.001)
    assert estimate.residual_m_s2 < 0.02


def test_a_vehicle_of_the_models_own_kind_is_found_in_still_air() -> None:
    estimate = fit_copter(simulated_flight(QUIET))
    assert estimate.mean.thrust_slope == pytest.approx(1.0, abs=0.012)
    assert estimate.mean.motor_lag_s == pytest.approx(0.05, abs=0.006)
    assert estimate.mean.drag_1_s == pytest.approx(0.3, abs=0.02)
    assert estimate.mean.hover_throttle == pytest.approx(0.4, rel=0.002)


def test_gusts_widen_the_uncertainty() -> None:
    quiet, gusty = fit_copter(simulated_flight(QUIET)), fit_copter(simulated_flight(GUSTY))
    assert gusty.deviation.thrust_slope > 3 * quiet.deviation.thrust_slope
    assert gusty.deviation.motor_lag_s > 2 * quiet.deviation.motor_lag_s


def test_random_vehicles_lie_within_their_uncertainty() -> None:
    """Of twelve, with more physics than the model has: the slope in hover, with its lag, within three deviations, and
    without a bias beyond the error of their mean."""
    apart = []
    for number in range(12):
        copter = sample(np.random.default_rng((7, number)))
        flight = fly_steps(copter, Parameters(hover_throttle=copter.assumed_hover_throttle), seed=number).log
        estimate = fit_copter(flight)
        apart.append((estimate.mean.thrust_slope - copter.thrust_slope) / estimate.deviation.thrust_slope)
        assert estimate.mean.hover_throttle == pytest.approx(copter.hover_throttle, rel=0.06)
    assert np.abs(apart).max() < 3.0
    assert abs(np.mean(apart)) < 1.0


def test_a_drag_that_gusts_hide_is_uncertain_instead_of_none() -> None:
    """As the regression alone has it, more than half of the copters would be driven by their drag."""
    found = fit_copter(simulated_flight(replace(GUSTY, gust_m_s2=0.35, noise_m_s2=0.05, drag_1_s=0.2), seed=30))
    assert min(each.drag_1_s for each in found.draws) > 0.0
    assert found.deviation.drag_1_s > 0.5 * found.mean.drag_1_s


@pytest.mark.complete
def test_the_stated_uncertainties_are_those_of_many_flights() -> None:
    """Of 24 flights of one vehicle in gusts, with 10 rows a second: the deviation of (slope − 1)/stated is within 30 %
    of 1, twice the error of 24. That of drag and hover throttle is at most as much above it: with rows that are as many
    as make the slope right, it is 1.43 and 1.33."""
    copter = replace(GUSTY, gust_m_s2=0.25, noise_m_s2=0.2)
    estimates = [fit_copter(simulated_flight(copter, seed=seed)) for seed in range(24)]

    def apart(name: str) -> np.ndarray:
        truth = getattr(copter.linear, name)
        return np.array([(getattr(each.mean, name) - truth) / getattr(each.deviation, name) for each in estimates])

    assert np.std(apart("thrust_slope")) == pytest.approx(1.0, abs=0.3)
    assert abs(np.mean(apart("thrust_slope"))) < 0.6
    for name in ("drag_1_s", "hover_throttle"):
        assert np.sqrt(np.mean(apart(name) ** 2)) < 1.3


def test_the_draws_have_the_stated_mean_and_deviation() -> None:
    estimate = fit_copter(simulated_flight(GUSTY))
    slopes = [each.thrust_slope for each in estimate.draws]
    assert (np.mean(slopes), np.std(slopes)) == pytest.approx(
        (estimate.mean.thrust_slope, estimate.deviation.thrust_slope)
    )
    assert list(estimate.few) == [estimate.mean, *estimate.draws[:5]]


def test_the_same_flight_gives_the_same_vehicle() -> None:
    assert fit_copter(simulated_flight(GUSTY)) == fit_copter(simulated_flight(GUSTY))


def test_a_jump_of_the_throttle_between_two_rows_moves_both_by_half_of_it() -> None:
    (rows,) = simulated_flight(QUIET).segments
    found = replace(rows, throttle_filtered=np.where(rows.time_s < 8.0, 0.4, 0.5)).jumps
    after = int(np.searchsorted(rows.time_s, 8.0))
    assert found[after - 1 : after + 1] == pytest.approx([-0.05, 0.05])
    assert np.abs(np.delete(found, [after - 1, after])).max() < 1e-9
