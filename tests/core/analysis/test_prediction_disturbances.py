"""Disturbances of a flight, and of others in the same weather."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.analysis.prediction import disturbances_of, in_other_weather
from app.core.analysis.segment import interpolated
from app.core.records.trajectory import Samples
from bench.copters.simulation import SimulatedCopter, loop_of
from tests.core.analysis.flights import GUSTY, QUIET, parameters_of, simulated_flight
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


def found(copter: SimulatedCopter) -> Samples:
    flight = simulated_flight(copter)
    (segment,) = flight.segments
    return disturbances_of(flight.loop, segment, interpolated(segment, flight.loop.step_s), copter.linear)


def test_a_vehicle_of_the_models_own_kind_in_still_air_has_hardly_any() -> None:
    assert np.abs(found(QUIET)[:, 0]).max() < 0.06


@pytest.mark.parametrize(("gust_m_s2", "gust_s", "noise_m_s2"), [(0.2, 0.5, 0.1), (0.6, 0.04, 0.02)])
def test_a_gust_moves_the_vehicle_and_noise_does_not(gust_m_s2: float, gust_s: float, noise_m_s2: float) -> None:
    """A gust is known as its mean over a row of 0.1 s; what is left of it within the row is beside the noise. In the
    second case, as in ArduPilot's turbulence, gusts are shorter than a row: once they were taken for noise."""
    disturbances = found(
        replace(QUIET, gust_m_s2=gust_m_s2, gust_s=gust_s, noise_m_s2=noise_m_s2, wander_m=0.0, wander_m_s=0.0)
    )
    share = 2.0 * (gust_s / 0.1) * (1.0 - (gust_s / 0.1) * (1.0 - np.exp(-0.1 / gust_s)))
    assert disturbances[:, 0].std() == pytest.approx(gust_m_s2 * np.sqrt(share), rel=0.15)
    assert disturbances[:, 2].std() == pytest.approx(np.hypot(noise_m_s2, gust_m_s2 * np.sqrt(1.0 - share)), rel=0.25)


def test_noise_has_no_mean_over_a_row() -> None:
    """Of a mean, the climb rate would have changed."""
    disturbances = found(replace(QUIET, noise_m_s2=0.3))
    means = disturbances[: len(disturbances) // 40 * 40, 2].reshape(-1, 40).mean(axis=1)
    assert means == pytest.approx(0.0, abs=1e-9)


def test_a_gust_known_as_means_over_rows_explains_the_climb_rate_by_itself() -> None:
    """The change of the climb rate is a mean over its row: taken as a sample at the end of it, a third of the gusts
    would be left to the estimator."""
    flight = simulated_flight(replace(GUSTY, noise_m_s2=0.0, wander_m=0.0, wander_m_s=0.0))
    (sensed,) = flight.segments
    changes = np.diff(sensed.v_m_s) / np.diff(sensed.time_s)
    segment = replace(sensed, a_m_s2=np.append(changes[0], changes))
    loop = replace(loop_of(parameters_of(flight)), row_s=0.1)
    disturbances = disturbances_of(loop, segment, interpolated(segment, loop.step_s), GUSTY.linear)
    assert disturbances[:, 0].std() == pytest.approx(0.2, rel=0.15)
    assert disturbances[:, 2].std() < 0.1 * disturbances[:, 0].std()


def test_noise_alone_is_no_gust() -> None:
    disturbances = found(replace(QUIET, noise_m_s2=0.3))
    assert disturbances[:, 2].std() == pytest.approx(0.3, rel=0.25)
    assert disturbances[:, 0].std() < 0.1


def test_an_altitude_that_wanders_is_found_beyond_the_climb_rate() -> None:
    disturbances = found(replace(QUIET, wander_m=0.02))
    still = found(QUIET)
    assert disturbances[:, 1].std() > 3 * still[:, 1].std()


def test_other_weather_is_as_strong_on_average_and_has_the_same_mean() -> None:
    disturbances = found(GUSTY)
    random = np.random.default_rng(1)
    others = [in_other_weather(disturbances - disturbances.mean(axis=0), random) for _ in range(300)]
    strengths = np.mean([each.var(axis=0) for each in others], axis=0)
    assert strengths == pytest.approx(disturbances.var(axis=0), rel=0.2)
    assert np.corrcoef(others[0][:, 0], others[1][:, 0])[0, 1] < 0.5


def test_a_step_of_the_loop_at_the_time_of_the_last_row_is_one_of_the_last_interval() -> None:
    """Seen: with this offset, rounding puts the last step right behind the last row."""
    flight = simulated_flight(QUIET)
    (segment,) = flight.segments
    moved = replace(segment, time_s=segment.time_s + 16.002)
    steps = interpolated(moved, flight.loop.step_s)
    assert steps.time_s[-1] >= moved.time_s[-1]
    moving = disturbances_of(flight.loop, moved, steps, QUIET.linear)
    assert np.abs(moving[:, 0]).max() < 0.2
