"""Identify the aircraft's linear model from flights that recorded its states and commands, then fly its optimum.

The unknowns m are the logarithms of factors on the elements of A and B, with a normal prior around the model's own
values from the experiment. Two fits minimise

    Σ (r/σ)² + Σ ((m − m₀)/s)²

by Gauss–Newton with a limited step; the noise σ of each state is re-estimated from the residuals in every iteration:

- `least-squares`: r is the difference between the next recorded state and one model step from the recorded one. Exact
  for clean records; noise on the states biases it, because it enters both sides.
- `map` (maximum a posteriori): r is the difference between the recorded states of a one-second window and the model's,
  driven by the recorded commands from the initial state that fits the window best (linear, so solved exactly). Noise on
  the states affects r alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from app.core.definition import Flight, Option, was_flown
from app.core.experiments.base import Matrix, ModelledExperiment, fitted_parameters, halton, normal_distribution
from app.core.experiments.pitch_tracking import OUTPUT, PitchTracking, states_and_commands
from app.core.formatting import format_gains, named_flights, short
from app.core.models.f16 import LARGEST_ERROR_RAD, PITCH, RATE_HZ, STATES, STEP_S, transitions
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples
from app.core.tuning.corrected_model import CorrectedModel, Optimum, model_optimum, uncorrected_model
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import (
    Explanation,
    ModelPrediction,
    Proposal,
    Strategy,
    positive_interval,
    proposal_of,
    with_band,
)

Fit = Literal["least-squares", "map"]
Cube = Samples

WINDOW_STEPS: Final = RATE_HZ
"""One second."""

_ROUNDS: Final = 40
_DIFFERENCE: Final = 1e-5
_LARGEST_STEP: Final = 0.5
_FIT_TOLERANCE: Final = 0.01
"""The fit has converged once a step is below this share of the standard errors, and the noise changes by less."""
_SINGLE_PRECISION: Final = 6e-8
_SMALLEST: Final = 1e-12
_MIN_RECORD: Final = WINDOW_STEPS + 1

_STARTS: Final = 256
_RESTARTS: Final = 8
_SEARCH_TOLERANCE: Final = 1e-4
_MODELS: Final = 48
_MIN_IMPROVEMENT: Final = 0.002
"""Smallest predicted improvement worth a flight, as a share of the best flight's expected error."""
_MODEL_ERROR_SD: Final = 0.005
"""Standard deviation of the error of any linear model, as a share of the predicted error."""
_TAIL: Final = 0.05
_TAIL_SD: Final = 1.6449


@dataclass(frozen=True, slots=True, kw_only=True)
class Identified:
    """Result of an identification.

    `model` is the parameter vector, shape (19,), with its `covariance` (19, 19); `noise` is that of each recorded state
    (5,), in the source's units; `flights` are the numbers of the flights used.
    """

    model: Vector
    covariance: Matrix
    noise: Vector
    flights: tuple[int, ...]

    @property
    def pitch_noise_rad(self) -> float:
        return float(self.noise[PITCH])


def identify(experiment: PitchTracking, flights: Sequence[Flight], fit: Fit) -> Identified | None:
    """Fit the model to every flight with recorded states and commands, aborted ones included; None if there is none.

    Pure and deterministic; uses trajectories as they are stored.
    """
    records = [(flight.number, _record(experiment, flight)) for flight in flights]
    usable = [(number, record) for number, record in records if record is not None]
    if not usable:
        return None
    windows = np.concatenate([_windows(record) for _, record in usable])
    residuals = _one_step if fit == "least-squares" else _over_windows
    model, covariance = _fit(experiment, windows, residuals)
    sizes = _rms(windows[..., :STATES]) + _SMALLEST
    noise = _rms(_over_windows(experiment, model[np.newaxis], windows, sizes)[0]) + _SMALLEST
    return Identified(model=model, covariance=covariance, noise=noise, flights=tuple(number for number, _ in usable))


def _record(experiment: PitchTracking, flight: Flight) -> Matrix | None:
    """[x | u] of the flight up to its end or its divergence, shape (n, 7); None if shorter than a window."""
    trajectory = flight.trajectory.as_stored()
    if not len(trajectory):
        return None
    grid_s = experiment.grid_s
    record = states_and_commands(trajectory, grid_s)
    if record is None:
        return None
    flown = grid_s <= trajectory.time_s[-1]
    on_course = np.abs(np.interp(grid_s, trajectory.time_s, trajectory[OUTPUT])) < LARGEST_ERROR_RAD
    length = int(np.logical_and.accumulate(flown & on_course).sum())
    return record[:length] if length >= _MIN_RECORD else None


def _windows(record: Matrix) -> Cube:
    """One-second windows; neighbours share their end samples: (k, 51, 7)."""
    count = (len(record) - 1) // WINDOW_STEPS
    return np.stack([record[k * WINDOW_STEPS : (k + 1) * WINDOW_STEPS + 1] for k in range(count)])


Residuals = Callable[[PitchTracking, Matrix, Cube, Vector], Cube]
"""(experiment, models (p, 19), windows (k, 51, 7), noise (5,)) → (p, …, 5), in the source's units."""


def _one_step(experiment: PitchTracking, models: Matrix, windows: Cube, _noise: Vector) -> Cube:
    moves = transitions(experiment.systems(models))
    predicted = np.einsum("pij,ktj->pkti", moves, windows[:, :-1], optimize=True)
    return np.asarray(windows[np.newaxis, :, 1:, :STATES] - predicted)


def _over_windows(experiment: PitchTracking, models: Matrix, windows: Cube, noise: Vector) -> Cube:
    moves = transitions(experiment.systems(models))
    free, forced = _responses(moves, windows)
    beyond = (windows[..., :STATES] - forced) / noise
    weighted = (free / noise[:, np.newaxis]).reshape(len(models), -1, STATES)
    basis = np.linalg.qr(weighted)[0]
    flat = beyond.reshape(len(models), len(windows), -1)
    left = flat - (flat @ basis) @ basis.transpose(0, 2, 1)
    return np.asarray(left.reshape(beyond.shape) * noise)


def _responses(moves: Cube, windows: Cube) -> tuple[Cube, Cube]:
    """Free response to each initial state (p, 51, 5, 5), and response to the commands from rest (p, k, 51, 5)."""
    models, steps = len(moves), windows.shape[1]
    free = np.empty((models, steps, STATES, STATES))
    forced = np.zeros((models, len(windows), steps, STATES))
    free[:, 0] = np.eye(STATES)
    motion, control = moves[..., :STATES], moves[..., STATES:].transpose(0, 2, 1)
    turned = motion.transpose(0, 2, 1)
    for i in range(1, steps):
        free[:, i] = motion @ free[:, i - 1]
        forced[:, :, i] = forced[:, :, i - 1] @ turned + windows[np.newaxis, :, i - 1, STATES:] @ control
    return free, forced


def _rms(values: Cube) -> Vector:
    """Root mean square over all but the last axis."""
    return np.asarray(np.sqrt((values.reshape(-1, STATES) ** 2).mean(axis=0)))


def _fit(experiment: PitchTracking, windows: Cube, residuals: Residuals) -> tuple[Vector, Matrix]:
    """Gauss–Newton from the model's own parameters; the noise follows the residuals down to the storage precision."""
    nominal = experiment.nominal_model
    precision = 1.0 / experiment.prior_sd**2
    floor = _SINGLE_PRECISION * np.abs(windows[..., :STATES]).max(axis=(0, 1)) + _SMALLEST
    model = nominal
    noise = np.maximum(_rms(residuals(experiment, model[np.newaxis], windows, floor)[0]), floor)
    covariance = np.diag(1.0 / precision)
    for _ in range(_ROUNDS):
        shifted = model + _DIFFERENCE * np.vstack((np.zeros_like(model), np.eye(len(model))))
        left = residuals(experiment, shifted, windows, noise).reshape(len(shifted), -1, STATES) / noise
        now, *others = left.reshape(len(shifted), -1)
        slopes = (np.stack(others) - now) / _DIFFERENCE
        # einsum: a matrix product of this shape would wake every linear algebra thread for a millisecond's work
        covariance = np.linalg.inv(np.einsum("ik,jk->ij", slopes, slopes) + np.diag(precision))
        step = -covariance @ (slopes @ now + precision * (model - nominal))
        step *= min(1.0, _LARGEST_STEP / float(np.abs(step).max()))
        model = np.clip(model + step, *experiment.limits)
        before = noise
        noise = np.maximum(_rms(residuals(experiment, model[np.newaxis], windows, noise)[0]), floor)
        moved = np.abs(step) / np.sqrt(np.diag(covariance))
        if moved.max() < _FIT_TOLERANCE and np.abs(noise / before - 1.0).max() < _FIT_TOLERANCE:
            break
    return model, covariance


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
    bounds = zip(low.tolist(), high.tolist(), strict=True)
    reach = space.narrowed(dict(zip(space.names, bounds, strict=True)))
    spread = low + (high - low) * halton(len(low), _STARTS)
    starts = np.vstack((base, reach.nearest(space.default), spread))
    errors = uncorrected_model(aircraft).errors(starts)
    ends = [_restarted(aircraft, reach, start) for start in (starts[np.argmin(errors)], base)]
    return min(ends, key=lambda end: end.error)


def _restarted(aircraft: PitchTracking, space: PolicySpace, start: Vector) -> Optimum:
    best = model_optimum(aircraft, space, start)
    for _ in range(_RESTARTS):
        again = model_optimum(aircraft, space, best.gains)
        settled = again.error > (1.0 - _SEARCH_TOLERANCE) * best.error
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
