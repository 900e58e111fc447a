"""Limits of a campaign's vehicle, shared by strategies and the gate."""

from app.core.checks import Envelope
from app.core.definition import Definition
from app.core.experiments.base import Experiment


def envelope_of(definition: Definition, experiment: Experiment) -> Envelope:
    """The campaign's ceiling and safe gains: the vehicle's own, or else the experiment's default gains."""
    own = definition.safe_gains
    safe_gains = experiment.space.mapping(experiment.space.default) if own is None else own
    return Envelope(ceiling_m=definition.ceiling_m, safe_gains=safe_gains)
