"""The gains of a campaign's first flight."""

from app.core.definition import Definition
from app.core.experiments.base import Experiment
from app.core.policy import PolicySpace
from app.core.strategies.simplex import model_optimum


def start_gains(definition: Definition, experiment: Experiment, space: PolicySpace) -> dict[str, float]:
    """Gains of the first flight: given ones, the nominal model's optimum, or the experiment's defaults.

    Given gains are those in the definition, its own or the best of another campaign. The optimum is searched from the
    default gains, if there is a model.
    """
    modelled = experiment.modelled
    if definition.start.gains is not None:
        return space.check(definition.start.gains, field="start.gains")
    if definition.start.kind == "simplex" and modelled is not None:
        return space.mapping(model_optimum(modelled, space, space.nearest(space.default)).gains)
    return space.mapping(space.default)
