"""Campaigns of altitude steps under ArduCopter and PX4: the model from flights over a link, and what it proposes."""

import pickle
import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np
import pytest

from app.core.definition import Definition, Flight, StopRule
from app.core.errors import TrajectoryError
from app.core.experiments.base import prior_distribution
from app.core.policy import Box, Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.campaign_models import changed_parameters, known_distribution
from app.core.tuning.copter_model import CopterModel
from app.core.tuning.gate import check_policy
from app.core.tuning.strategy import Proposal
from bench.copters.campaign_flights import RIGS, CampaignRig
from tests.core.analysis.px4_flights import CALM
from tests.core.tuning.defined import evidence, fitted_predictor, modelled_flights, next_proposal
from tests.core.tuning.flying import compiled_only

AS_GOOD: Final = {
    "ArduCopter": {"2, 7, 1, 2": False, "3, 8, 0.5, 3": True},
    "PX4": {"PX4's default gains": False, "1.5, 8, 3, 0": True, "1.5, 6, 3, 0.3": True},
}
"""Whether a set that needs no model is as good as the proposal, by what it flies on this vehicle."""
OPTIONS: Final = {"steps": 2, "step_window_s": 3.0}


def definition_of(rig: CampaignRig) -> Definition:
    return Definition(experiment=rig.experiment.name, experiment_options=dict(OPTIONS), strategy="calibrated")


def fly(rig: CampaignRig, number: int, gains: Gains, changed: Mapping[str, float] = MappingProxyType({})) -> Flight:
    steps = rig.experiment.configured(OPTIONS)
    parameters = {**rig.parameters(CALM), **gains, **changed}
    record = rig.fly(steps, CALM, parameters, number)
    return Flight(
        number=number,
        gains=dict(gains),
        trajectory=record,
        error=steps.error(record),
        outcome="valid",
        parameters=parameters,
    )


@cache
def flown(autopilot: str) -> tuple[Flight, Proposal]:
    """The first flight of a campaign and the proposal that follows."""
    rig = RIGS[autopilot]
    first = fly(rig, 1, next_proposal(definition_of(rig), []).gains)
    return first, next_proposal(definition_of(rig), [first])


@compiled_only
@pytest.mark.parametrize("autopilot", ["PX4", pytest.param("ArduCopter", marks=pytest.mark.complete)])
def test_the_second_flight_is_better_and_where_it_was_predicted(autopilot: str) -> None:
    rig, (first, proposal) = RIGS[autopilot], flown(autopilot)
    steps = rig.experiment.configured(OPTIONS)
    second = fly(rig, 2, proposal.gains)
    assert proposal.kind == "step"
    assert check_policy(evidence(definition_of(rig), steps, [first]), proposal.gains).passed
    assert first.error is not None
    assert second.error is not None
    assert proposal.interval is not None
    assert second.error < 0.85 * first.error
    assert proposal.interval.lower < second.error < 1.2 * proposal.interval.upper
    assert proposal.predicted is not None
    assert {"altitude_m_lower", "altitude_m_upper"} <= proposal.predicted.channels.keys()
    explanation = proposal.explanation
    fitted = {each.name: each for each in explanation.fitted}
    assert fitted["hover_throttle"].value == pytest.approx(CALM.hover_throttle, rel=0.05)
    assert "times as much as with the gains of the first flight; 1.5 times is allowed." in explanation.notes[0]
    assert "2 times is required" in explanation.notes[1]
    assert explanation.notes[2].startswith("For comparison, the model predicts ")
    assert f" m with {autopilot}'s default gains; " in explanation.notes[2]
    as_good = [gains for gains, is_as_good in AS_GOOD[autopilot].items() if is_as_good]
    for gains in AS_GOOD[autopilot]:
        said = f" m with {gains}, which is predicted as good" in explanation.notes[2]
        errors = re.findall(rf"([\d.]+) m with {re.escape(gains)}", explanation.notes[2])
        assert (said, [float(each) <= proposal.interval.upper for each in errors]) == (gains in as_good, [said])


@compiled_only
def test_a_flight_with_a_push_is_fitted_and_predicted() -> None:
    rig = RIGS["PX4"]
    steps = rig.experiment.configured({**OPTIONS, "push_m_s2": 2.0})

    def flight(gains: Gains, seed: int) -> tuple[Trajectory, Mapping[str, float]]:
        parameters = {**rig.parameters(CALM), **gains}
        return rig.fly(steps, CALM, parameters, seed), parameters

    gains = steps.space.mapping(steps.space.default)
    record, parameters = flight(gains, 1)
    first = Flight(
        number=1, gains=gains, trajectory=record, error=steps.error(record), outcome="valid", parameters=parameters
    )
    model = CopterModel(steps, [first])
    assert {each.name: each.value for each in model.fitted}["hover_throttle"] == pytest.approx(0.4, rel=0.05)
    stiff = {"MPC_Z_P": 1.5, "MPC_Z_VEL_P_ACC": 6.0, "MPC_Z_VEL_I_ACC": 3.0, "MPC_Z_VEL_D_ACC": 0.3}
    predicted = model.predict(steps.space.vector(stiff))
    flown = steps.error(flight(stiff, 2)[0])
    assert predicted.error == pytest.approx(flown, rel=0.15)
    assert flown < 0.8 * steps.error(record)


@compiled_only
def test_several_flights_are_fitted_together_and_the_throttle_is_still_compared_with_the_first() -> None:
    rig, (first, proposal) = RIGS["PX4"], flown("PX4")
    flights = [first, fly(rig, 2, proposal.gains)]
    steps = rig.experiment.configured(OPTIONS)
    alone, both = (CopterModel(steps, some) for some in (flights[:1], flights))
    assert (both.numbers, both.base.number) == ((1, 2), 2)
    assert both.fitted[1].standard_error < alone.fitted[1].standard_error
    assert both.spread.origin == "the fit to 2 flights"
    assert not both.is_worth_a_flight(*[steps.space.vector(proposal.gains)] * 2)
    predictor = fitted_predictor(definition_of(rig), flights)
    assert predictor is not None
    again = predictor.predict(proposal.gains)
    assert again.predicted_error == pytest.approx(flights[1].error, rel=0.1)
    assert modelled_flights(definition_of(rig), flights) == {1, 2}


@compiled_only
def test_gains_outside_what_is_searched_and_pinned_ones_are_kept() -> None:
    rig, (first, _) = RIGS["ArduCopter"], flown("ArduCopter")
    model = CopterModel(rig.experiment.configured(OPTIONS), [first])
    space = rig.experiment.space
    low, high = space.vector(first.gains), space.vector(first.gains)
    high[space.names.index("PSC_ACCZ_I")] = 2.0
    optimum = model.optimum(Box(low, high))
    assert optimum is not None
    assert model.optimum(Box(low, low)) == pytest.approx(low)
    kept = {name: value for name, value in space.mapping(optimum).items() if name != "PSC_ACCZ_I"}
    assert kept == {name: value for name, value in first.gains.items() if name != "PSC_ACCZ_I"}
    assert space.mapping(optimum)["PSC_ACCZ_I"] > 1.2


@compiled_only
def test_where_every_gain_set_rings_on_a_likely_vehicle_no_step_is_proposed() -> None:
    """Bounds that leave a stiff loop alone."""
    rig, (first, _) = RIGS["ArduCopter"], flown("ArduCopter")
    stiff = {"PSC_ACCZ_P": (1.9, 2.0), "PSC_ACCZ_I": (3.9, 4.0)}
    definition = replace(definition_of(rig), bounds=stiff, stop=StopRule(kind="budget"))
    proposal = next_proposal(definition, [first])
    assert proposal.explanation.notes[0].startswith("No gains that may be flown next keep the margin from ringing")
    assert proposal.kind == "none"


@compiled_only
def test_a_flight_that_the_model_does_not_fly_is_refused() -> None:
    """One with other gains than it is said to have, one in a storm, and one with a filter that the replica lacks."""
    rig, (first, _) = RIGS["ArduCopter"], flown("ArduCopter")
    steps = rig.experiment.configured(OPTIONS)
    other = replace(first, gains={**first.gains, "PSC_ACCZ_P": 1.5, "PSC_ACCZ_I": 3.0})
    with pytest.raises(TrajectoryError, match="Flight 1 cannot be modelled") as refused:
        next_proposal(definition_of(rig), [other])
    assert "it flew with other gains or parameters" in refused.value.problems[0].reason
    noise = np.random.default_rng(1).normal(0.0, 0.3, len(first.trajectory.time_s))
    channels = {**first.trajectory.channels, "climb_rate_m_s": first.trajectory["climb_rate_m_s"] + noise}
    stormy = replace(first, trajectory=replace(first.trajectory, channels=channels))
    with pytest.raises(TrajectoryError) as refused:
        CopterModel(steps, [replace(first, number=2), replace(stormy, number=3)])
    assert refused.value.message == "Flight 3 cannot be modelled."
    assert "that the throttle does not explain" in refused.value.problems[0].reason
    filtered = replace(first, parameters={**first.parameters, "PSC_ACCZ_NTF": 1.0})
    with pytest.raises(TrajectoryError, match=r"Flight 1 cannot be fitted\. PSC_ACCZ_NTF: must be 0"):
        CopterModel(steps, [filtered])
    assert known_distribution(evidence(Definition(), steps, [filtered])) == prior_distribution(steps)


@compiled_only
def test_a_proposal_says_that_other_parameters_changed_between_the_flights() -> None:
    """By the names and in the units of another release too; gains and the last digits do not count."""
    rig, (first, _) = RIGS["ArduCopter"], flown("ArduCopter")
    before = {**first.parameters, "MOT_THST_HOVER": 0.35, "WPNAV_SPEED_UP": 250.0}
    after = {**before, "MOT_THST_HOVER": 0.31, "WP_SPD_UP": 2.5001, "PSC_ACCZ_P": 0.7}
    del after["WPNAV_SPEED_UP"]
    flights = [replace(first, parameters=before), replace(first, number=2, parameters=after)]
    notes = next_proposal(replace(definition_of(rig), strategy="manual"), flights).explanation.notes
    said = "The errors are compared as if only the gains had changed, but MOT_THST_HOVER was 0.35 in flight 1 and "
    assert [note for note in notes if "gains had changed" in note] == [f"{said}0.31 in flight 2."]
    for few in (flights[:1], []):
        assert changed_parameters(evidence(Definition(), rig.experiment, few)) == ""


@pytest.mark.complete
@compiled_only
def test_a_hover_throttle_outside_what_px4_finds_is_told_until_the_parameter_is_set() -> None:
    """The vehicle hovers at 0.40; with MPC_THR_HOVER 0.65 the estimate stops at 0.45."""
    rig, definition = RIGS["PX4"], definition_of(RIGS["PX4"])
    steps = rig.experiment.configured(OPTIONS)
    gains = steps.space.mapping(steps.space.default)
    first = fly(rig, 1, gains, {"MPC_THR_HOVER": 0.65})
    proposal = next_proposal(definition, [first])
    said = proposal.explanation.notes[0]
    assert "outside MPC_THR_HOVER ± HTE_THR_RANGE (0.450 … 0.850): the estimate in flight stops at 0.450" in said
    assert float(said.removesuffix(".").rpartition(" ")[2]) == pytest.approx(0.40, abs=0.01)
    checks = check_policy(evidence(definition, steps, [first]), proposal.gains, spread=proposal.spread).checks
    (told,) = (check for check in checks if check.name == "hover throttle")
    assert told.passed
    assert told.limit == pytest.approx(0.45)
    assert told.sentence == f"{said} Do this before the flight."
    unknown = {name: value for name, value in first.parameters.items() if name != "MPC_THR_HOVER"}
    silent = CopterModel(steps.under(unknown), [replace(first, parameters=unknown)])
    assert "MPC_THR_HOVER" not in silent.notes(steps.space.default)[0]
    later = [first, replace(first, number=2, parameters={**first.parameters, "MPC_THR_HOVER": 0.4})]
    assert all("MPC_THR_HOVER ±" not in note for note in next_proposal(definition, later).explanation.notes)


@compiled_only
@pytest.mark.parametrize("autopilot", list(RIGS))
def test_an_error_landscape_can_be_computed_in_another_process(autopilot: str) -> None:
    rig, (first, _) = RIGS[autopilot], flown(autopilot)
    steps = rig.experiment.configured(OPTIONS)
    gains = np.stack((steps.space.default, 0.9 * steps.space.default))
    predict_errors = CopterModel(steps, [first]).errors
    assert pickle.loads(pickle.dumps(predict_errors))(gains).tolist() == predict_errors(gains).tolist()


def test_a_record_without_the_throttle_is_refused_and_tells_nothing_of_the_vehicle() -> None:
    rig = RIGS["PX4"]
    steps = rig.experiment.configured(OPTIONS)
    flight = fly(rig, 1, steps.space.mapping(steps.space.default))
    channels = {name: each for name, each in flight.trajectory.channels.items() if name != "throttle"}
    bare = replace(flight, trajectory=replace(flight.trajectory, channels=channels))
    assert known_distribution(evidence(Definition(), steps, [bare])) == prior_distribution(steps)
    with pytest.raises(TrajectoryError, match="Flight 1 cannot be fitted"):
        next_proposal(definition_of(rig), [bare])
    assert np.isfinite(flight.error or np.nan)
