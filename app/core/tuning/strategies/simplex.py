"""Nelder–Mead on the nominal model alone: the paper's starting point, and also a strategy."""

from typing import Final

import numpy as np

from app.core.definition import was_flown
from app.core.experiments.base import ModelledExperiment
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.formatting import format_gains, short
from app.core.tuning.corrected_model import CorrectedModel, model_optimum, uncorrected_model
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import Explanation, Proposal, Strategy, proposal_of


def propose(evidence: Evidence[ModelledExperiment]) -> Proposal:
    """Propose the nominal model's optimum, within the step limit around the best flight.

    At least one flight must be valid.
    """
    definition, experiment, space, base = evidence.definition, evidence.experiment, evidence.space, evidence.best
    start = space.vector(definition.start.gains) if definition.start.gains else space.nearest(space.default)
    optimum = model_optimum(experiment, space, start)
    low, high = space.reachable(space.vector(base.gains), definition.step_fraction)
    target = np.clip(optimum.gains, low, high)
    is_flown = was_flown(space.mapping(target), evidence.flights)
    gains = space.nearest(space.vector(base.gains)) if is_flown else target
    found = (
        f"{optimum.evaluations} runs of the nominal model end at {format_gains(space.mapping(optimum.gains))}, "
        f"model error {short(optimum.error)} {experiment.error_unit}."
    )
    summary = f"{found} These gains have been flown; the model alone proposes nothing else." if is_flown else found
    explanation = Explanation(
        summary=summary,
        base_flight=base.number,
        clipped=space.names_where(target != optimum.gains),
        notes=("Flights do not change this strategy's model.",),
    )
    predicted = nominal_model(evidence).predict(gains)
    return proposal_of("none" if is_flown else "step", space.mapping(gains), predicted, explanation)


def nominal_model(evidence: Evidence[ModelledExperiment]) -> CorrectedModel:
    """The nominal model, which flights do not change."""
    return uncorrected_model(evidence.experiment)


SIMPLEX: Final = Strategy(
    name="simplex",
    title="Simplex on the model",
    line="Nelder–Mead on the nominal model alone, then that one set is flown.",
    options=(),
    propose=propose,
    model=nominal_model,
    kinds=(VerticalLoop, PitchTracking),
    corrects_model=False,
)
