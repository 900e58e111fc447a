"""Whether the gate would let a step fly, asked before it is proposed."""

from app.core.definition import Definition
from app.core.envelope import envelope_of
from app.core.experiments.base import ModelledExperiment
from app.core.policy import Vector
from app.core.spread import ParameterDistribution


def allows(
    definition: Definition, experiment: ModelledExperiment, gains: Vector, spread: ParameterDistribution
) -> bool:
    """Whether the experiment sees no hazard in gains of shape (n,) over what is known of the vehicle."""
    return all(check.passed for check in experiment.hazards(gains, spread, envelope_of(definition, experiment)))
