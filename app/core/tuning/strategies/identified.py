"""Identify the aircraft's model from the flights, then fly its optimum."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, Option, best_flight, was_flown
from app.core.experiments.base import Matrix, ModelledExperiment, ParameterDistribution, fitted_parameters, halton
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.formatting import format_gains, named_flights, short
from app.core.models.f16 import STEP_S
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.corrected_model import Optimum, model_optimum, uncorrected_model
from app.core.tuning.identification import Fit, Identified, identify
from app.core.tuning.predictions import predict_corrected
from app.core.tuning.strategy import (
    ErrorsOf,
    Explanation,
    Interval,
    ModelPrediction,
    PredictionOf,
    Proposal,
    Strategy,
    band_channels,
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


def propose(
    definition: Definition, experiment: ModelledExperiment, space: PolicySpace, flights: Sequence[Flight]
) -> Proposal:
    """Propose the optimum of the model identified from all flights, within the step limit around the best flight.

    At least one flight must be valid.
    """
    assert isinstance(experiment, PitchTracking)  # definitions with another experiment are refused
    base = best_flight(flights)
    fit = _fit_of(definition)
    found = identify(experiment, flights, fit)
    if found is None:
        return _nothing_to_fit(experiment, space, base)
    here = space.nearest(space.vector(base.gains))
    low, high = space.reachable(here, definition.step_fraction)
    aircraft = _aircraft(experiment, found)
    optimum = _optimum(aircraft, space, low, high, here)
    gains = space.mapping(optimum.gains)
    expected = _expected_error(aircraft, found, here)
    predicted_at_optimum = _expected_error(aircraft, found, optimum.gains)
    stays = was_flown(gains, flights) or predicted_at_optimum > expected - _MIN_IMPROVEMENT * expected
    chosen = space.mapping(here) if stays else gains
    trajectory, error, interval = _prediction(aircraft, found, space.vector(chosen))
    return Proposal(
        kind="none" if stays else "step",
        gains=chosen,
        predicted=trajectory,
        predicted_error=error,
        interval=interval,
        explanation=_explanation(experiment, found, fit, base, optimum, space, error, stays=stays),
    )


def error_model(definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> ErrorsOf:
    """The errors of the model identified from all flights.

    Those of the nominal model if no flight recorded the required channels.
    """
    assert isinstance(experiment, PitchTracking)
    found = identify(experiment, flights, _fit_of(definition))
    if found is None:
        return uncorrected_model(experiment).errors
    return partial(_expected_errors, _aircraft(experiment, found), found)


def flight_model(definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> PredictionOf:
    """The flights of the same model."""
    assert isinstance(experiment, PitchTracking)
    found = identify(experiment, flights, _fit_of(definition))
    if found is None:
        return partial(predict_corrected, uncorrected_model(experiment))
    return partial(_prediction, _aircraft(experiment, found), found)


def _aircraft(experiment: PitchTracking, found: Identified) -> PitchTracking:
    return experiment.informed(found.model, np.sqrt(np.diag(found.covariance)))


def _fit_of(definition: Definition) -> Fit:
    return "map" if definition.options.get("fit", "map") == "map" else "least-squares"


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


def _expected_error(aircraft: PitchTracking, found: Identified, gains: Vector) -> float:
    """Expected score of the flight: the model's error, including the noise of the recorded pitch."""
    return float(_expected_errors(aircraft, found, gains[np.newaxis])[0])


def _expected_errors(aircraft: PitchTracking, found: Identified, gains: Matrix) -> Vector:
    return aircraft.errors(_folded(aircraft.outputs(gains, found.model), found.pitch_noise_rad))


def _folded(outputs: Matrix, noise: float) -> Matrix:
    """Mean of |output + normal noise|; `noise` is its standard deviation, above zero."""
    from scipy.special import erf

    apart = outputs / (noise * np.sqrt(2.0))
    return np.asarray(noise * np.sqrt(2.0 / np.pi) * np.exp(-(apart**2)) + outputs * erf(apart))


def _prediction(aircraft: PitchTracking, found: Identified, gains: Vector) -> ModelPrediction:
    """Predicted output with its band, error, and interval, over models from the fit's distribution."""
    spread = ParameterDistribution(
        mean=tuple(found.model.tolist()),
        covariance=tuple(tuple(row) for row in found.covariance.tolist()),
        origin="the flights",
    )
    outputs = aircraft.outputs(np.tile(gains, (_MODELS, 1)), spread.sample(aircraft, _MODELS))
    errors = aircraft.errors(_folded(outputs, found.pitch_noise_rad))
    error = float(errors[0])
    noise = found.pitch_noise_rad * np.sqrt(STEP_S * aircraft.grid_s[-1] * (1.0 - 2.0 / np.pi))
    reach = _TAIL_SD * float(np.hypot(noise, _MODEL_ERROR_SD * error))
    lowest, highest = np.quantile(errors, (_TAIL, 1.0 - _TAIL))
    interval = Interval(lower=max(0.0, min(error, float(lowest)) - reach), upper=max(error, float(highest)) + reach)
    return ModelPrediction(_trajectory(aircraft, outputs, _TAIL_SD * found.pitch_noise_rad), error, interval)


def _trajectory(aircraft: PitchTracking, outputs: Matrix, reach: float) -> Trajectory:
    lower, upper = band_channels(aircraft.output)
    edges = np.quantile(outputs, (_TAIL, 1.0 - _TAIL), axis=0)
    channels: dict[str, Samples] = {
        aircraft.output: outputs[0],
        lower: np.minimum(outputs[0], edges[0]) - reach,
        upper: np.maximum(outputs[0], edges[1]) + reach,
    }
    return Trajectory(aircraft.grid_s, channels, "model", "simulation")


def _nothing_to_fit(experiment: PitchTracking, space: PolicySpace, base: Flight) -> Proposal:
    trajectory, error = uncorrected_model(experiment).predict(space.vector(base.gains))
    summary = (
        "No flight recorded all of its states and commands, so the model cannot be identified. "
        f"The best so far is flight {base.number} ({format_gains(base.gains)})."
    )
    return Proposal(
        kind="none",
        gains=dict(base.gains),
        predicted=trajectory,
        predicted_error=error,
        explanation=Explanation(summary=summary, base_flight=base.number),
    )


def _explanation(
    experiment: PitchTracking,
    found: Identified,
    fit: Fit,
    base: Flight,
    optimum: Optimum,
    space: PolicySpace,
    error: float,
    *,
    stays: bool,
) -> Explanation:
    fitted = f"A and B were re-identified from {named_flights(found.flights)}."
    gains = format_gains(space.mapping(optimum.gains))
    offer = (
        f"The identified model predicts no sufficient improvement over flight {base.number}, error "
        f"{short(base.error)} {experiment.error_unit}."
        if stays
        else f"The identified model's optimum is at {gains}; predicted {short(error)} {experiment.error_unit}."
    )
    return Explanation(
        summary=f"{fitted} {offer}",
        base_flight=base.number,
        notes=(_FITS[fit],),
        lesson="The dynamics under gains far from those flown so far; the next fit uses every flight.",
        fitted=fitted_parameters(experiment.model_parameters, found.model, found.covariance),
    )


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
    predict_errors=error_model,
    predict_flight=flight_model,
    kinds=(PitchTracking,),
)
