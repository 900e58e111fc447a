"""Identify the aircraft's model from the flights, then fly its optimum."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.definition import Option, was_flown
from app.core.experiments.base import Matrix, ModelledExperiment, fitted_parameters, halton, normal_distribution
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.formatting import format_gains, named_flights, short
from app.core.models.f16 import STEP_S
from app.core.policy import PolicySpace, Vector
from app.core.tuning.corrected_model import CorrectedModel, Optimum, model_optimum, uncorrected_model
from app.core.tuning.evidence import Evidence
from app.core.tuning.identification import Fit, Identified, identify
from app.core.tuning.strategy import (
    Explanation,
    ModelPrediction,
    Proposal,
    Strategy,
    positive_interval,
    proposal_of,
    with_band,
)

_STARTS: Final = 256
_SEARCHES: Final = 1
_RESTARTS: Final = 8
_SETTLED: Final = 1e-4
_MODELS: Final = 48
_MIN_IMPROVEMENT: Final = 0.002
"""Smallest predicted improvement worth a flight, as a share of the best flight's expected error."""
_MODEL_ERROR_SD: Final = 0.005
"""Standard deviation of the error of any linear model, as a share of the predicted error."""
_TAIL: Final = 0.05
_TAIL_SD: Final = 1.6449


def propose(evidence: Evidence[ModelledExperiment]) -> Proposal:
    """Propose the optimum of the model identified from all flights, within the step limit around the best flight.

    At least one flight must be valid.
    """
    space, base, model = evidence.space, evidence.best, identified_model(evidence)
    if isinstance(model, CorrectedModel):
        return _nothing_to_fit(model, evidence)
    here = space.nearest(space.vector(base.gains))
    low, high = space.reachable(here, evidence.definition.step_fraction)
    optimum = _optimum(model.aircraft, space, low, high, here)
    gains = space.mapping(optimum.gains)
    expected, predicted_at_optimum = (float(model.errors(each[np.newaxis])[0]) for each in (here, optimum.gains))
    stays = was_flown(gains, evidence.flights) or predicted_at_optimum > expected - _MIN_IMPROVEMENT * expected
    chosen = space.mapping(here) if stays else gains
    predicted = model.predict(space.vector(chosen))
    offer = (
        f"The identified model predicts no sufficient improvement over flight {base.number}, error "
        f"{short(base.error)} {evidence.experiment.error_unit}."
        if stays
        else f"The identified model's optimum is at {format_gains(gains)}; predicted {short(predicted.error)} "
        f"{evidence.experiment.error_unit}."
    )
    explanation = Explanation(
        summary=f"A and B were re-identified from {named_flights(model.found.flights)}. {offer}",
        base_flight=base.number,
        notes=(_FITS[_fit_of(evidence)],),
        lesson="The dynamics under gains far from those flown so far; the next fit uses every flight.",
        fitted=fitted_parameters(evidence.experiment.model_parameters, model.found.model, model.found.covariance),
    )
    return proposal_of("none" if stays else "step", chosen, predicted, explanation)


@dataclass(frozen=True, slots=True)
class IdentifiedModel:
    """The aircraft as identified: predicts flights and their scores, including the noise of the recorded pitch."""

    aircraft: PitchTracking
    found: Identified

    def errors(self, gains: Matrix) -> Vector:
        """Expected scores of flights: gains (k, 6) → (k,)."""
        outputs = self.aircraft.outputs(gains, self.found.model)
        return self.aircraft.errors(_folded(outputs, self.found.pitch_noise_rad))

    def predict(self, gains: Vector) -> ModelPrediction:
        """Predicted output with its band, error, and interval, over models from the fit's distribution."""
        aircraft, found = self.aircraft, self.found
        spread = normal_distribution(found.model, found.covariance, origin="the flights")
        outputs = aircraft.outputs(np.tile(gains, (_MODELS, 1)), spread.sample(aircraft, _MODELS))
        errors = aircraft.errors(_folded(outputs, found.pitch_noise_rad))
        error = float(errors[0])
        noise = found.pitch_noise_rad * np.sqrt(STEP_S * aircraft.grid_s[-1] * (1.0 - 2.0 / np.pi))
        reach = _TAIL_SD * float(np.hypot(noise, _MODEL_ERROR_SD * error))
        lowest, highest = np.quantile(errors, (_TAIL, 1.0 - _TAIL))
        edges, beyond = np.quantile(outputs, (_TAIL, 1.0 - _TAIL), axis=0), _TAIL_SD * found.pitch_noise_rad
        lower, upper = np.minimum(outputs[0], edges[0]) - beyond, np.maximum(outputs[0], edges[1]) + beyond
        return ModelPrediction(
            trajectory=with_band(aircraft, outputs[0], lower, upper),
            error=error,
            interval=positive_interval(min(error, float(lowest)) - reach, max(error, float(highest)) + reach),
        )


def identified_model(evidence: Evidence[ModelledExperiment]) -> IdentifiedModel | CorrectedModel:
    """The model identified from all flights; the nominal one if no flight recorded the required channels."""
    experiment = evidence.experiment
    assert isinstance(experiment, PitchTracking)  # definitions with another experiment are refused
    found = identify(experiment, evidence.flights, _fit_of(evidence))
    if found is None:
        return uncorrected_model(experiment)
    return IdentifiedModel(experiment.informed(found.model, np.sqrt(np.diag(found.covariance))), found)


def _fit_of(evidence: Evidence[ModelledExperiment]) -> Fit:
    return "map" if evidence.definition.options.get("fit", "map") == "map" else "least-squares"


def _optimum(aircraft: PitchTracking, space: PolicySpace, low: Vector, high: Vector, base: Vector) -> Optimum:
    """Nelder–Mead on the identified model, from the best of 256 points spread over the bounds and from the flown gains.

    Each search is restarted from its end until it no longer improves.
    """
    reach = PolicySpace(
        tuple(
            replace(gain, lower=float(lower), upper=float(upper))
            for gain, lower, upper in zip(space.gains, low, high, strict=True)
        )
    )
    spread = low + (high - low) * halton(len(low), _STARTS)
    starts = np.vstack((base, reach.nearest(space.default), spread))
    errors = uncorrected_model(aircraft).errors(starts)
    likely = starts[np.argsort(errors, kind="stable")[:_SEARCHES]]
    ends = [_restarted(aircraft, reach, start) for start in (*likely, base)]
    return min(ends, key=lambda end: end.error)


def _restarted(aircraft: PitchTracking, space: PolicySpace, start: Vector) -> Optimum:
    best = model_optimum(aircraft, space, start)
    for _ in range(_RESTARTS):
        again = model_optimum(aircraft, space, best.gains)
        settled = again.error > (1.0 - _SETTLED) * best.error
        best = min(best, again, key=lambda end: end.error)
        if settled:
            break
    return best


def _folded(outputs: Matrix, noise: float) -> Matrix:
    """Mean of |output + normal noise|; `noise` is its standard deviation, above zero."""
    from scipy.special import erf

    apart = outputs / (noise * np.sqrt(2.0))
    return np.asarray(noise * np.sqrt(2.0 / np.pi) * np.exp(-(apart**2)) + outputs * erf(apart))


def _nothing_to_fit(model: CorrectedModel, evidence: Evidence[ModelledExperiment]) -> Proposal:
    base = evidence.best
    summary = (
        "No flight recorded all of its states and commands, so the model cannot be identified. "
        f"The best so far is flight {base.number} ({format_gains(base.gains)})."
    )
    explanation = Explanation(summary=summary, base_flight=base.number)
    return proposal_of("none", base.gains, model.predict(evidence.space.vector(base.gains)), explanation)


_FITS: Final[dict[Fit, str]] = {
    "least-squares": "Least squares over single steps: exact for clean records, biased by noise on the states.",
    "map": "Maximum a posteriori over windows of a second: not biased by noise on the recorded states.",
}

IDENTIFIED: Final = Strategy(
    name="identified",
    title="Re-identified model",
    line="Identifies the aircraft's linear model from all flights, then flies the optimum of that model.",
    options=(
        Option(
            name="fit",
            title="Identification: single steps (clean records), or windows of one second (noisy records)",
            default="map",
            choices=("least-squares", "map"),
        ),
    ),
    propose=propose,
    model=identified_model,
    kinds=(PitchTracking,),
)
