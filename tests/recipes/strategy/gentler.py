"""The best gains with half of the integral one: an example, not a good strategy."""

from typing import Final

from app.core.experiments.base import ModelledExperiment
from app.core.tuning.corrected_model import CorrectedModel, correct_by_bias
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import Explanation, Proposal, Strategy, proposal_of


def propose(evidence: Evidence[ModelledExperiment]) -> Proposal:
    """At least one flight must be valid."""
    space, best = evidence.space, evidence.best
    gains = space.nearest(space.vector({**best.gains, "ki": best.gains["ki"] / 2.0}))
    explanation = Explanation(summary="Half of the integral gain.", base_flight=best.number)
    return proposal_of("step", space.mapping(gains), corrected_model(evidence).predict(gains), explanation)


def corrected_model(evidence: Evidence[ModelledExperiment]) -> CorrectedModel:
    """The model corrected by the best flight. At least one flight must be valid."""
    return correct_by_bias(evidence.experiment, evidence.best)


GENTLER: Final = Strategy(
    name="gentler",
    title="Gentler",
    line="Flies the best gains with half of the integral one.",
    options=(),
    propose=propose,
    model=corrected_model,
)
