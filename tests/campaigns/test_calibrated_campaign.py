"""Whole campaigns of the calibrated strategy on simulated vehicles, from the default gains."""

import pytest

from app.campaigns.headless import CampaignListener, HeadlessTrial, fly_campaign
from app.core.definition import Definition, StopRule
from bench.targets.vehicles import noise_free_error, population
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only


def two_flights(vehicle: str, seed: int) -> tuple[HeadlessTrial, ...]:
    definition = Definition(strategy="calibrated", stop=StopRule(kind="budget", max_flights=2), seed=seed)
    return tuple(fly_campaign(definition, vehicle, {}, CampaignListener()).trials)


def test_the_second_flight_of_the_simulated_ardrone_is_at_its_optimum() -> None:
    """At most 0.0945 m; the best gains that are known fly 0.0919 m, the paper's seventh flight scored 0.0940 m."""
    first, second = two_flights("jsbsim", seed=1)
    assert first.error == pytest.approx(0.3267, abs=0.003)
    assert second.error is not None
    assert second.error <= 0.0945


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_the_second_flight_of_the_twin_has_gains_within_5_percent_of_its_optimum(seed: int) -> None:
    """0.1181 m without scatter, measured once with the original loop."""
    second = two_flights("twin", seed)[1]
    (twin,) = population("twin", 1, seed)
    assert noise_free_error(twin, second.gains) <= 1.05 * 0.1181
    assert second.outcome == "valid"
