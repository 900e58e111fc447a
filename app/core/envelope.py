"""What a campaign lets its vehicle do: the same to a strategy and to the gate."""

from app.core.checks import Envelope
from app.core.definition import Definition
from app.core.experiments.base import Experiment


def envelope_of(definition: Definition, experiment: Experiment) -> Envelope:
    """The campaign's ceiling, and the vehicle's own safe gains, else the experiment's default ones."""
    own = definition.safe_gains
    safe_gains = experiment.space.mapping(experiment.space.default) if own is None else own
    return Envelope(ceiling_m=definition.ceiling_m, safe_gains=safe_gains)
