"""Warm start: vehicle B begins with what vehicle A's campaign found, where the two are alike."""

from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.registry import get_experiment
from app.core.definition import Definition, Donor, Flight, Start, StopRule
from app.core.experiments.base import ModelledExperiment
from app.core.formatting import percent
from app.core.tuning.calibration import calibrate
from app.core.tuning.campaign_models import as_flown
from app.core.tuning.corrected_model import correct_by_bias
from app.core.tuning.transfer import transfer
from tests.core.tuning import bowl
from tests.core.tuning.defined import evidence, next_proposal
from tests.core.tuning.flying import TAKEOFF, TWIN, compiled_only, fly

TUNED: dict[str, float] = {"kp": 1600, "ki": 900, "kd": 150}
ALIKE = (0.615, 0.2, 0.04, 0.02)
"""Another vehicle of the twin's kind."""
UNLIKE = (0.66, 0.0, 0.0, 0.0)
"""One that deviates from the data sheet the other way."""
WARM = Definition(
    start=Start(kind="campaign", gains=TUNED, donor=Donor(campaign_id=1, trial_number=5, checksum="0")),
    stop=StopRule(kind="budget"),
)


def model(*leading: float) -> list[float]:
    """The takeoff's model with its leading parameters given."""
    return [*leading, *TAKEOFF.nominal_model[len(leading) :].tolist()]


def donor() -> Flight:
    return fly(5, TUNED, model(*TWIN))


@compiled_only
def test_the_first_flight_is_the_others_best_and_is_expected_to_score_as_there() -> None:
    start = next_proposal(WARM, [], donor())
    assert (start.kind, start.gains) == ("start", TUNED)
    assert start.predicted_error == pytest.approx(donor().error, abs=1e-9)
    assert start.interval is not None
    assert start.predicted_error is not None
    assert start.predicted_error in start.interval
    assert "the best gains of the campaign that this one starts from" in start.explanation.summary


@compiled_only
def test_an_alike_vehicle_takes_the_others_fitted_model_over_and_a_shorter_first_step() -> None:
    first = fly(1, TUNED, model(*ALIKE))
    found = transfer(evidence(WARM, TAKEOFF, [first], donor=donor()))
    agreement = found.evidence.definition.step_fraction / WARM.step_fraction
    assert 0.5 < agreement < 1.0
    assert found.evidence.experiment.nominal_model.tolist() == calibrate(TAKEOFF, [donor()]).model.tolist()
    assert "replaces the data sheet" in found.sentence
    assert f"agreement {percent(agreement)}" in found.sentence
    notes = next_proposal(WARM, [first], donor()).explanation.notes
    assert found.sentence in notes


@compiled_only
def test_the_step_is_shortened_for_the_second_flight_only() -> None:
    flights = [fly(1, TUNED, model(*ALIKE)), fly(2, {**TUNED, "kp": 1700}, model(*ALIKE))]
    found = transfer(evidence(WARM, TAKEOFF, flights, donor=donor()))
    assert found.evidence.definition.step_fraction == WARM.step_fraction
    assert "first step" not in found.sentence


@compiled_only
def test_an_unlike_vehicle_takes_nothing_over() -> None:
    first = fly(1, TUNED, model(*UNLIKE))
    found = transfer(evidence(WARM, TAKEOFF, [first], donor=donor()))
    assert found.evidence.experiment is TAKEOFF
    assert found.evidence.definition.step_fraction == WARM.step_fraction
    assert found.sentence.startswith("Nothing is used from the other vehicle: ")
    plain = next_proposal(replace(WARM, start=Start(kind="given", gains=TUNED)), [first])
    warm = next_proposal(WARM, [first], donor())
    assert (warm.gains, warm.predicted_error) == (plain.gains, plain.predicted_error)


def test_before_the_first_valid_flight_nothing_is_decided() -> None:
    flight = bowl.fly(1, 50, 50)
    aborted = Flight(number=1, gains=flight.gains, trajectory=flight.trajectory, error=None, outcome="aborted")
    found = transfer(evidence(WARM, bowl.QuadraticExperiment(), [aborted], donor=flight))
    assert (found.sentence, found.evidence.definition.step_fraction) == ("", WARM.step_fraction)


def test_the_agreement_is_the_share_of_the_deviation_that_the_other_vehicle_explains() -> None:
    """Offsets 0.4 (A) and 0.5 (B), scatter 0.01: 1 − (0.1² − 2·0.01²)/0.5²."""
    found = transfer(
        evidence(WARM, bowl.QuadraticExperiment(), [bowl.fly(1, 50, 50, 0.5)], donor=bowl.fly(3, 50, 50, 0.4))
    )
    share = found.evidence.definition.step_fraction / WARM.step_fraction
    assert share == pytest.approx(1.0 - (0.01 - 0.0002) / 0.25, abs=1e-5)
    assert "The other vehicle's best gains are used" in found.sentence


@pytest.mark.parametrize(("theirs", "ours", "agreement"), [(0.4, 0.41, 1.0), (0.0, 0.005, 1.0), (0.4, -0.1, 0.0)])
def test_scatter_is_no_disagreement_and_the_opposite_is_none_of_an_agreement(
    theirs: float, ours: float, agreement: float
) -> None:
    found = transfer(
        evidence(WARM, bowl.QuadraticExperiment(), [bowl.fly(1, 50, 50, ours)], donor=bowl.fly(3, 50, 50, theirs))
    )
    assert f"agreement {percent(agreement)}" in found.sentence


@compiled_only
def test_each_vehicle_is_modelled_under_the_parameters_that_it_flew_with() -> None:
    """The donor's slow filter explains how it differs; before the own first flight, the own vehicle has it too."""
    steps = get_experiment("altitude-steps-ardupilot", {"steps": 2, "step_window_s": 3.0})
    assert isinstance(steps, ModelledExperiment)
    slow = {"PSC_ACCZ_FLTE": 2.0, "telemetry_hz": 50.0}
    gains = steps.space.mapping(steps.space.default)
    record = steps.under(slow).simulate(steps.space.default, steps.nominal_model)
    theirs = Flight(number=5, gains=gains, trajectory=record, error=0.1, outcome="valid", parameters=slow)
    ours = replace(theirs, trajectory=steps.simulate(steps.space.default, steps.nominal_model), parameters={})
    assert np.abs(correct_by_bias(steps, theirs).bias).max() < 1e-6
    assert f"agreement {percent(1.0)}" in transfer(evidence(WARM, steps, [ours], donor=theirs)).sentence
    firmer = steps.space.vector({**gains, "PSC_ACCZ_P": 0.8})[np.newaxis]
    expected = steps.under(slow).outputs(firmer, steps.nominal_model)
    assert as_flown(steps, [theirs]).outputs(firmer, steps.nominal_model).tolist() == expected.tolist()
