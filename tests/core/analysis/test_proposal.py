"""The search: what it proposes is allowed, and better than everything that it began with."""

from dataclasses import replace

import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.core.analysis.margin import REQUIRED_MARGIN, RINGING_DAMPING, gain_margin, least_damping
from app.core.analysis.prediction import FlightModel
from app.core.analysis.proposal import LARGEST_ACTIVITY, propose
from app.core.analysis.vehicle_fit import fit_copter
from bench.copters.simulation import SimulatedCopter
from tests.core.analysis.flights import GUSTY, QUIET, recorded_steps, simulated_flight
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only

DEFAULTS = {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0}
STIFF = {"PSC_POSZ_P": 3.0, "PSC_VELZ_P": 8.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 3.0}


@pytest.mark.parametrize(
    "copter",
    [
        GUSTY,
        pytest.param(replace(GUSTY, motor_lag_s=0.12), marks=pytest.mark.complete),
        pytest.param(replace(GUSTY, hover_throttle=0.17), marks=pytest.mark.complete),
    ],
)
def test_a_proposal_is_allowed_and_better_than_what_it_began_with(copter: SimulatedCopter) -> None:
    flight = simulated_flight(copter)
    estimate = fit_copter(flight)
    gains = propose(flight, estimate.few, [DEFAULTS, STIFF])
    assert gains is not None
    assert all(low <= gains[name] <= high for name, (low, high) in flight.loop.space.bounds.items())
    assert gains["PSC_ACCZ_I"] >= gains["PSC_ACCZ_P"]
    model = FlightModel(flight, [estimate.mean])
    loop = flight.loop.with_gains(gains)
    error_m, activity = model.fly(loop)
    usual_m, usual_activity = model.fly(flight.loop)
    assert error_m < 0.6 * usual_m
    assert activity <= LARGEST_ACTIVITY * usual_activity * 1.001
    assert gain_margin(loop, estimate.mean) >= REQUIRED_MARGIN
    for each in estimate.few:
        assert least_damping(loop.with_fast_gains(REQUIRED_MARGIN), each) >= RINGING_DAMPING


@pytest.mark.complete
def test_slow_motors_get_less_gain() -> None:
    """With 0.12 s in place of 0.03 s the stiff set rings, and the search stays below it."""
    nimble, slow = (
        propose(flight, fit_copter(flight).few, [DEFAULTS, STIFF])
        for flight in (simulated_flight(replace(QUIET, motor_lag_s=lag_s)) for lag_s in (0.03, 0.12))
    )
    assert nimble is not None
    assert slow is not None
    assert slow["PSC_VELZ_P"] * slow["PSC_ACCZ_P"] < 0.8 * nimble["PSC_VELZ_P"] * nimble["PSC_ACCZ_P"]


@pytest.mark.complete
def test_proposed_gains_have_three_digits() -> None:
    flight = recorded_steps()
    gains = propose(flight, fit_copter(flight).few, [DEFAULTS])
    assert gains is not None
    assert gains == {name: float(f"{value:.3g}") for name, value in gains.items()}


@pytest.mark.complete
def test_nothing_is_proposed_where_every_start_rings() -> None:
    """Motors so strong that they hover at 3 % of the throttle."""
    flight = simulated_flight(QUIET)
    strong = [replace(each, hover_throttle=0.03) for each in fit_copter(flight).few]
    assert propose(flight, strong, [DEFAULTS, STIFF]) is None


def test_other_gains_replace_those_of_the_same_name_only() -> None:
    loop = simulated_flight(QUIET).loop
    assert isinstance(loop, ArduPilotLoop)
    changed = loop.with_gains({"PSC_ACCZ_P": 0.7})
    assert changed.parameters == replace(loop.parameters, acceleration_p=0.7)
