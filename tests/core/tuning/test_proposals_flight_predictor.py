"""Predictions of any gains: the proposal's own model, asked again."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.definition import Definition, Donor, Flight, Start, StopRule
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.tuning.calibration import MAX_FLIGHTS
from app.core.tuning.proposals import FlightPredictor
from app.core.tuning.strategy import Proposal
from tests.core.tuning.defined import fitted_predictor, modelled_flights, next_proposal, predict_repeat
from tests.core.tuning.flying import TAKEOFF, TWIN, compiled_only, fly

pytestmark = compiled_only

START: dict[str, float] = {"kp": 283, "ki": 13, "kd": 82}
BETTER: dict[str, float] = {"kp": 900, "ki": 120, "kd": 150}
STEPS = StopRule(kind="budget", max_flights=9)


def predictor_of(definition: Definition, flights: list[Flight], donor: Flight | None = None) -> FlightPredictor:
    found = fitted_predictor(definition, flights, donor)
    assert found is not None
    return found


def predicts_the_same(one: Proposal, other: Proposal, output: str = "altitude_m") -> bool:
    assert one.predicted is not None
    assert other.predicted is not None
    return (one.predicted_error, one.interval, set(one.predicted.channels)) == (
        other.predicted_error,
        other.interval,
        set(other.predicted.channels),
    ) and one.predicted[output].tobytes() == other.predicted[output].tobytes()


@pytest.mark.parametrize("strategy", ["calibrated", "gradient", "simplex", "manual"])
@pytest.mark.parametrize("flown", [0, 1, 2])
def test_the_proposed_gains_are_predicted_as_in_the_proposal(strategy: str, flown: int) -> None:
    definition = Definition(strategy=strategy, stop=STEPS)
    flights = [fly(number, gains) for number, gains in enumerate((START, BETTER)[:flown], start=1)]
    proposal = next_proposal(definition, flights)
    assert predicts_the_same(predictor_of(definition, flights).predict(proposal.gains), proposal)


def test_the_gradients_model_may_be_corrected_inside_the_loop() -> None:
    definition = Definition(strategy="gradient", options={"bias": "inside"}, stop=STEPS)
    proposal = next_proposal(definition, [fly(1, START)])
    assert predicts_the_same(predictor_of(definition, [fly(1, START)]).predict(proposal.gains), proposal)


def test_a_warm_start_predicts_with_the_other_vehicles_model() -> None:
    donor = fly(3, BETTER)
    named = Donor(campaign_id=1, trial_number=3, checksum="0" * 64)
    definition = Definition(strategy="calibrated", start=Start(kind="campaign", gains=BETTER, donor=named), stop=STEPS)
    for flights in ([], [fly(1, BETTER)]):
        proposal = next_proposal(definition, flights, donor)
        assert predicts_the_same(predictor_of(definition, flights, donor).predict(proposal.gains), proposal)


@pytest.mark.complete
@pytest.mark.parametrize("recorded", [True, False])
def test_the_identified_model_predicts_as_in_the_proposal(recorded: bool) -> None:
    experiment = PitchTracking()
    gains = experiment.space.mapping(experiment.space.default)
    record = experiment.simulate(experiment.space.default, experiment.nominal_model).as_stored()
    channels = record.channels if recorded else {experiment.output: record[experiment.output]}
    flown = Flight(
        number=1,
        gains=gains,
        trajectory=type(record)(record.time_s, channels, record.source, record.clock),
        error=experiment.error(record),
        outcome="valid",
    )
    definition = Definition(experiment="pitch-tracking", strategy="identified", stop=STEPS)
    proposal = next_proposal(definition, [flown])
    again = predictor_of(definition, [flown]).predict(proposal.gains)
    assert predicts_the_same(again, proposal, experiment.output)


def test_gains_far_from_the_flights_are_predicted_with_a_wider_interval() -> None:
    predictor = predictor_of(Definition(strategy="calibrated"), [fly(1, START), fly(2, BETTER)])
    near, far = (predictor.predict(gains).interval for gains in (BETTER, {"kp": 3800, "ki": 1000, "kd": 60}))
    assert near is not None
    assert far is not None
    assert far.upper - far.lower > 2.0 * (near.upper - near.lower)


def test_a_repeat_is_predicted_by_the_mean_of_its_flights() -> None:
    flights = [fly(1, START), fly(2, BETTER), fly(3, BETTER)]
    predicted = predict_repeat(Definition(), flights, BETTER)
    assert predicted is not None
    assert predicted.predicted is not None
    assert predicted.predicted_error == pytest.approx(flights[1].error)
    assert predicted.interval is None, "two flights with the same error show no scatter"
    np.testing.assert_allclose(
        predicted.predicted["altitude_m"][::512],
        np.interp(TAKEOFF.grid_s[::512], flights[1].trajectory.time_s, flights[1].trajectory["altitude_m"]),
        atol=1e-6,
    )


def test_the_interval_of_a_repeat_is_that_of_its_flights() -> None:
    flights = [fly(1, START), fly(2, BETTER), fly(3, BETTER, [1.02 * each for each in TWIN])]
    predicted = predict_repeat(Definition(), flights, BETTER)
    assert predicted is not None
    errors = [flight.error for flight in flights[1:] if flight.error is not None]
    mean = sum(errors) / 2.0
    assert predicted.predicted_error == pytest.approx(mean)
    assert predicted.interval is not None
    assert (predicted.interval.lower + predicted.interval.upper) / 2.0 == pytest.approx(mean)
    assert predicted.interval.lower < min(errors)


def test_gains_that_were_not_flown_are_no_repeat() -> None:
    assert predict_repeat(Definition(), [fly(1, START)], BETTER) is None


def test_without_a_model_there_is_no_predictor() -> None:
    assert fitted_predictor(Definition(experiment="takeoff-px4", strategy="manual"), []) is None


def test_only_the_first_flight_and_those_of_the_fit_need_their_records() -> None:
    flights = [replace(fly(number, START), error=0.5 - 0.01 * number) for number in range(1, MAX_FLIGHTS + 4)]
    last = flights[-1].number
    assert modelled_flights(Definition(), flights) == {1, *range(last - MAX_FLIGHTS + 1, last + 1)}
    assert modelled_flights(Definition(), [replace(flights[0], outcome="aborted")]) == frozenset()
    every = {flight.number for flight in flights}
    assert modelled_flights(Definition(experiment="pitch-tracking", strategy="identified"), flights) == every
