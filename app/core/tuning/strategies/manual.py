"""Gains chosen by the operator, subject to the same checks."""

from typing import Final

from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.formatting import format_gains, short
from app.core.tuning.corrected_model import CorrectedModel, correct_by_bias
from app.core.tuning.evidence import Evidence, has_model
from app.core.tuning.strategy import Explanation, Proposal, Strategy, proposal_of


def propose(evidence: Evidence[Experiment]) -> Proposal:
    """Propose the best flown gains, or the nearest inside the bounds, for the operator to change.

    Without a model nothing is predicted. At least one flight must be valid.
    """
    best, space = evidence.best, evidence.space
    gains = space.nearest(space.vector(best.gains))
    predicted = corrected_model(evidence).predict(gains) if has_model(evidence) else None
    summary = (
        f"This strategy proposes no step. The best gains so far are those of flight {best.number} "
        f"({format_gains(best.gains)}), error {short(best.error)} {evidence.experiment.error_unit}."
    )
    return proposal_of("manual", space.mapping(gains), predicted, Explanation(summary=summary, base_flight=best.number))


def corrected_model(evidence: Evidence[ModelledExperiment]) -> CorrectedModel:
    """The model corrected by the best flight. At least one flight must be valid."""
    return correct_by_bias(evidence.experiment, evidence.best)


MANUAL: Final = Strategy(
    name="manual",
    title="Manual",
    line="You choose every gain set; bounds and step limits are checked as for any other.",
    options=(),
    propose=propose,
    model=corrected_model,
    needs_model=False,
)
