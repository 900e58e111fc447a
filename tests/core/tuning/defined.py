"""The core's functions of a definition, with the experiment that it names."""

from collections.abc import Sequence
from dataclasses import replace

from app.autopilots.registry import EXPERIMENTS, experiment_of
from app.core.definition import Definition, Flight
from app.core.errors import Problem
from app.core.experiments.base import ModelledExperiment
from app.core.policy import Gains, PolicySpace
from app.core.tuning import definition_checks, landscape, proposals
from app.core.tuning.landscape import LandscapeGrid, LandscapePlan
from app.core.tuning.proposals import FlightPredictor
from app.core.tuning.strategy import Evidence, Proposal


def next_proposal(definition: Definition, flights: Sequence[Flight], donor: Flight | None = None) -> Proposal:
    return proposals.next_proposal(definition, experiment_of(definition), flights, donor)


def fitted_predictor(
    definition: Definition, flights: Sequence[Flight], donor: Flight | None = None
) -> FlightPredictor | None:
    return proposals.flight_predictor(definition, experiment_of(definition), flights, donor)


def predict_repeat(definition: Definition, flights: Sequence[Flight], gains: Gains) -> Proposal | None:
    return proposals.predict_repeat(experiment_of(definition), flights, gains)


def modelled_flights(definition: Definition, flights: Sequence[Flight]) -> frozenset[int]:
    return proposals.modelled_flights(experiment_of(definition), flights)


def plan_grid(plan: LandscapePlan) -> LandscapeGrid | None:
    return landscape.plan_grid(plan, experiment_of(plan.definition))


def problems_of(definition: Definition) -> tuple[Problem, ...]:
    return definition_checks.problems_of(definition, EXPERIMENTS)


def check_definition(definition: Definition) -> None:
    definition_checks.check_definition(definition, EXPERIMENTS)


def evidence(
    definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight], space: PolicySpace | None = None
) -> Evidence[ModelledExperiment]:
    """Of these flights, within the bounds of `space` if it is given."""
    bounds = definition.bounds if space is None else {gain.name: (gain.lower, gain.upper) for gain in space.gains}
    return Evidence(definition=replace(definition, bounds=bounds), experiment=experiment, flights=flights)
