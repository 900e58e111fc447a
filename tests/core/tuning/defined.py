"""The core's functions of a definition, with the experiment that it names."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from app.autopilots.registry import EXPERIMENTS, evidence_of
from app.core.definition import Definition, Flight
from app.core.errors import Problem
from app.core.experiments.base import Experiment
from app.core.policy import Gains, PolicySpace
from app.core.tuning import definition_checks, proposals
from app.core.tuning.evidence import Evidence
from app.core.tuning.proposals import FlightPredictor
from app.core.tuning.strategy import Proposal

_E = TypeVar("_E", bound=Experiment)


def next_proposal(definition: Definition, flights: Sequence[Flight], donor: Flight | None = None) -> Proposal:
    return proposals.next_proposal(evidence_of(definition, flights, donor=donor))


def fitted_predictor(
    definition: Definition, flights: Sequence[Flight], donor: Flight | None = None
) -> FlightPredictor | None:
    return proposals.flight_predictor(evidence_of(definition, flights, donor=donor))


def predict_repeat(definition: Definition, flights: Sequence[Flight], gains: Gains) -> Proposal | None:
    return proposals.predict_repeat(evidence_of(definition, flights), gains)


def modelled_flights(definition: Definition, flights: Sequence[Flight]) -> frozenset[int]:
    return proposals.modelled_flights(evidence_of(definition, flights))


def problems_of(definition: Definition) -> tuple[Problem, ...]:
    return definition_checks.problems_of(definition, EXPERIMENTS)


def evidence(
    definition: Definition,
    experiment: _E,
    flights: Sequence[Flight],
    space: PolicySpace | None = None,
    *,
    donor: Flight | None = None,
    open_until_flight: int = 0,
) -> Evidence[_E]:
    """Of these flights, within the bounds of `space` if it is given."""
    bounds = definition.bounds if space is None else {gain.name: (gain.lower, gain.upper) for gain in space.gains}
    return Evidence(
        definition=replace(definition, bounds=bounds),
        experiment=experiment,
        flights=flights,
        donor=donor,
        open_until_flight=open_until_flight,
    )
