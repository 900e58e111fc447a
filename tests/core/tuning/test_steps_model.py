"""Campaigns of altitude steps under Paparazzi, on a vehicle with noise, gusts, two motor lags and a dead time, recorded
as over a link."""

from functools import cache
from typing import Final

import numpy as np
import pytest

from app.core.definition import Definition, Flight
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.policy import Box, Gains
from app.core.tuning.campaign_models import StepsModel
from app.core.tuning.gate import check_policy
from app.core.tuning.strategy import Proposal
from bench.copters.paparazzi_simulation import SteppedVehicle, fly, within_margin
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only

STEPS: Final = AltitudeSteps()
DEFINITION: Final = Definition(experiment=STEPS.name, strategy="calibrated")
DEFAULT: Final = STEPS.space.mapping(STEPS.space.default)
LARGEST: Final = STEPS.space.mapping(STEPS.space.upper)
NOISY: Final = SteppedVehicle(
    hover_throttle=0.6,
    quadratic=0.8,
    motor_lag_s=0.06,
    second_lag_s=0.01,
    dead_time_s=0.03,
    latency_s=0.2,
    drag_1_s=0.2,
    drag_1_m=0.05,
    sag=0.01,
    gust_m_s2=0.1,
    noise_m=0.005,
    noise_m_s=0.05,
)
"""Its hover throttle and lags are in the model, the rest is beyond it."""


def flight(number: int, gains: Gains) -> tuple[Flight, float]:
    record, activity = fly(STEPS, NOISY, gains, number)
    return Flight(
        number=number, gains=dict(gains), trajectory=record, error=STEPS.error(record), outcome="valid"
    ), activity


@cache
def first() -> tuple[Flight, float]:
    return flight(1, DEFAULT)


@cache
def proposal() -> Proposal:
    return next_proposal(DEFINITION, [first()[0]])


@pytest.mark.complete
def test_the_interval_holds_the_flights_of_the_proposal_in_other_weather() -> None:
    """With the gusts and the noise of the first flight, although its thrust command was not recorded: without them two
    of these were above it."""
    interval = proposal().interval
    assert interval is not None
    errors = [flight(number, proposal().gains)[0].error for number in (2, 3, 4, 5)]
    assert all(error is not None and error in interval for error in errors)
    assert max(filter(None, errors)) < 0.1 * (first()[0].error or 0.0)


@pytest.mark.complete
def test_the_throttle_moves_little_more_than_in_the_first_flight_and_no_vehicle_nearly_rings() -> None:
    """The largest gains move it 1.6 times as much, and ring with 30 ms more delay and twice the gains."""
    activity = [np.mean([flight(number, gains)[1] for number in (2, 3)]) for gains in (proposal().gains, LARGEST)]
    assert activity[0] < 1.5 * first()[1] < activity[1]
    assert within_margin(NOISY, LARGEST) < 0.0 < within_margin(NOISY, proposal().gains)
    moves, rings = proposal().explanation.notes[:2]
    assert "times as much as with the gains of the first flight; 1.5 times is allowed." in moves
    assert rings.startswith("With 30 ms more delay, the altitude begins to ring with ")
    gate = check_policy(evidence(DEFINITION, STEPS, [first()[0]]), proposal().gains, spread=proposal().spread)
    assert gate.passed
    refused = check_policy(evidence(DEFINITION, STEPS, [first()[0]]), LARGEST, spread=proposal().spread)
    assert [check.name for check in refused.refusals] == ["margin"]


def test_the_throttle_is_compared_with_the_first_flight_later_too() -> None:
    second, _ = flight(2, proposal().gains)
    model = StepsModel(STEPS, [first()[0], second])
    assert (model.base.number, model.first_gains.tolist()) == (2, [283.0, 13.0, 82.0])
    here = STEPS.space.vector(second.gains)
    assert not model.is_worth_a_flight(here, here)


def test_where_every_gain_set_lacks_the_margin_none_is_proposed() -> None:
    model = StepsModel(STEPS, [first()[0]])
    assert model.optimum(Box(STEPS.space.upper - 1.0, STEPS.space.upper)) is None
    pinned = np.array([400.0, 100.0, 100.0])
    assert model.optimum(Box(pinned, pinned)) is not None
