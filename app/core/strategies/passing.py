"""Gate check of a step before it is proposed."""

from app.core.definition import Definition
from app.core.envelope import envelope_of
from app.core.experiments.base import ModelledExperiment
from app.core.policy import Vector
from app.core.spread import ParameterDistribution


def allows(
    definition: Definition, experiment: ModelledExperiment, gains: Vector, spread: ParameterDistribution
) -> bool:
    """Whether gains of shape (n,) pass the experiment's hazard checks over the vehicle's parameter distribution."""
    return all(check.passed for check in experiment.hazards(gains, spread, envelope_of(definition, experiment)))
