"""Gains chosen by the operator, subject to the same checks."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from app.core.definition import Definition, Flight, best_flight
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.formatting import format_gains, short
from app.core.policy import PolicySpace
from app.core.tuning.corrected_model import correct_by_bias
from app.core.tuning.predictions import predict_corrected
from app.core.tuning.strategy import ErrorsOf, Explanation, PredictionOf, Proposal, Strategy


def propose(_definition: Definition, experiment: Experiment, space: PolicySpace, flights: Sequence[Flight]) -> Proposal:
    """Propose the best flown gains, or the nearest inside the bounds, for the operator to change.

    Without a model nothing is predicted. At least one flight must be valid.
    """
    best = best_flight(flights)
    gains = space.nearest(space.vector(best.gains))
    modelled = experiment.modelled
    trajectory, error = (None, None) if modelled is None else correct_by_bias(modelled, best).predict(gains)
    summary = (
        f"This strategy proposes no step. The best gains so far are those of flight {best.number} "
        f"({format_gains(best.gains)}), error {short(best.error)} {experiment.error_unit}."
    )
    return Proposal(
        kind="manual",
        gains=space.mapping(gains),
        predicted=trajectory,
        predicted_error=error,
        explanation=Explanation(summary=summary, base_flight=best.number),
    )


def error_model(_definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> ErrorsOf:
    """The errors of the model corrected by the best flight. At least one flight must be valid."""
    return correct_by_bias(experiment, best_flight(flights)).errors


def flight_model(_definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> PredictionOf:
    """The flights of the same model."""
    return partial(predict_corrected, correct_by_bias(experiment, best_flight(flights)))


MANUAL: Final = Strategy(
    name="manual",
    title="Manual",
    line="You choose every gain set; bounds and step limits are checked as for any other.",
    options=(),
    propose=propose,
    predict_errors=error_model,
    predict_flight=flight_model,
    needs_model=False,
)
