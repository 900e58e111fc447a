"""Nelder–Mead on the nominal model alone: the paper's starting point, and also a strategy."""

from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, best_flight, was_flown
from app.core.experiments.base import ModelledExperiment
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.formatting import format_gains, short
from app.core.policy import PolicySpace
from app.core.tuning.corrected_model import model_optimum, uncorrected_model
from app.core.tuning.predictions import predict_corrected
from app.core.tuning.strategy import ErrorsOf, Explanation, PredictionOf, Proposal, Strategy


def propose(
    definition: Definition, experiment: ModelledExperiment, space: PolicySpace, flights: Sequence[Flight]
) -> Proposal:
    """Propose the nominal model's optimum, within the step limit around the best flight.

    At least one flight must be valid.
    """
    start = space.vector(definition.start.gains) if definition.start.gains else space.nearest(space.default)
    optimum = model_optimum(experiment, space, start)
    base = best_flight(flights)
    low, high = space.reachable(space.vector(base.gains), definition.step_fraction)
    target = np.clip(optimum.gains, low, high)
    is_flown = was_flown(space.mapping(target), flights)
    gains = space.nearest(space.vector(base.gains)) if is_flown else target
    trajectory, error = uncorrected_model(experiment).predict(gains)
    found = (
        f"{optimum.evaluations} runs of the nominal model end at {format_gains(space.mapping(optimum.gains))}, "
        f"model error {short(optimum.error)} {experiment.error_unit}."
    )
    summary = f"{found} These gains have been flown; the model alone proposes nothing else." if is_flown else found
    return Proposal(
        kind="none" if is_flown else "step",
        gains=space.mapping(gains),
        predicted=trajectory,
        predicted_error=error,
        explanation=Explanation(
            summary=summary,
            base_flight=base.number,
            clipped=space.names_where(target != optimum.gains),
            notes=("Flights do not change this strategy's model.",),
        ),
    )


def error_model(_definition: Definition, experiment: ModelledExperiment, _flights: Sequence[Flight]) -> ErrorsOf:
    """The errors of the nominal model, which flights do not change."""
    return uncorrected_model(experiment).errors


def flight_model(_definition: Definition, experiment: ModelledExperiment, _flights: Sequence[Flight]) -> PredictionOf:
    """The flights of the same model."""
    return partial(predict_corrected, uncorrected_model(experiment))


SIMPLEX: Final = Strategy(
    name="simplex",
    title="Simplex on the model",
    line="Nelder–Mead on the nominal model alone, then that one set is flown.",
    options=(),
    propose=propose,
    predict_errors=error_model,
    predict_flight=flight_model,
    kinds=(VerticalLoop, PitchTracking),
    corrects_model=False,
)
