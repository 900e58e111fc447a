"""Uncertainty of a prediction: its interval and band before the flight, and the track record afterwards.

A bias-corrected model ŷ = model(gains; p) + (measured − model(flown gains; p)) is run for a sample of likely parameter
sets p (from the priors of a fit), each with its own bias. The mean and standard deviation of their errors represent the
model uncertainty. With the flight-to-flight scatter σ (`app.core.statistics.comparisons`), which affects both the new
flight and the n flights of the base,

    interval = mean ± t(ν) · f · √(σ² (1 + 1/n) + sd²),    widened to contain the predicted error itself.

The band has the same form at every instant, with σ converted to the output offset that costs σ. The factor f adapts to
experience: f² = (ν₀ + Σ z²)/(ν₀ + k), where z are the k earlier prediction errors in units of their own intervals and
ν₀ = 4. An uncorrected model (first flight, simplex) has no base: the term 1/n and the bias are omitted.

A calibrated model predicts a flight's curve and error by itself. Its remaining bias acts inside the loop: the
disturbances of the best flight relative to its own calibrated model are applied to the new gains as well, so that gains
which reject gusts are credited for it. If the record lacks the climb rate or the thrust command, the bias is added
outside the loop, and fades with the distance from the flown gains.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.definition import Flight, Interval
from app.core.experiments.base import Experiment, Matrix, ModelledExperiment, normal_distribution
from app.core.formatting import capitalised, count
from app.core.models.vertical import ENTERED
from app.core.policy import Vector
from app.core.records.trajectory import Trajectory
from app.core.statistics.comparisons import Group
from app.core.tuning.calibration import Calibration
from app.core.tuning.corrected_model import resample_to_grid
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import (
    CONFIDENCE,
    Explanation,
    Kind,
    ModelPrediction,
    Proposal,
    positive_interval,
    with_band,
)

MODELS: Final = 16
_PRIOR_WEIGHT: Final = 4.0
_DISAGREEMENTS: Final = 3
_TINY: Final = float(np.finfo(float).tiny)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackRecord:
    """How well earlier predictions held.

    `inside` of `of` flights lay in their interval. Of the flights that were predicted to change the error, `agreeing`
    changed it in the predicted direction and `disagreeing` in the other.
    """

    inside: int
    of: int
    agreeing: int
    disagreeing: int

    @property
    def trustworthy(self) -> bool:
        """False once at least three flights went in the other direction, and more than went in the predicted one."""
        return not (self.disagreeing >= _DISAGREEMENTS and self.disagreeing > self.agreeing)

    @property
    def share(self) -> float | None:
        """Share of flights inside their interval; None before the first flight with an interval."""
        return self.inside / self.of if self.of else None

    @property
    def sentence(self) -> str:
        moved = self.agreeing + self.disagreeing
        if not self.of and not moved:
            return "No prediction has been tested by a flight yet."
        parts = []
        if self.of == 1:
            parts.append(f"the only predicted flight ended {'inside' if self.inside else 'outside'} its interval")
        elif self.of:
            parts.append(f"{self.inside} of {self.of} flights ended inside their predicted interval")
        if moved:
            changed = f"{count(moved, 'flight')} with new gains changed the error in the predicted direction"
            parts.append(f"{self.agreeing} of {changed} (repeats are not counted)")
        ending = (
            ""
            if self.trustworthy
            else "; the gradient is not trustworthy: most flights changed the error in the direction opposite to the "
            "prediction"
        )
        counted = "; ".join(parts)
        return f"{capitalised(counted)}{ending}."


def is_informative(interval: Interval | None, *, corrected: bool) -> bool:
    """Whether a prediction with this interval says anything.

    Before the first valid flight the model is not `corrected`. An interval that then reaches down to zero (0 … 2.2 m)
    allows any flight, and is no prediction.
    """
    return corrected or interval is None or interval.lower > 0.0


def track_record(flights: Sequence[Flight]) -> TrackRecord:
    """Compute the track record of the predictions that the flights carry.

    The direction counts where new gains were predicted to change the best error before them; repeated gains predict no
    change. A prediction that is not informative is not counted.
    """
    inside = of = agreeing = disagreeing = 0
    best: float | None = None
    seen: set[frozenset[tuple[str, float]]] = set()
    for flight in flights:
        if flight.outcome != "valid" or flight.error is None:
            continue
        prediction, gains = flight.predicted, frozenset(flight.gains.items())
        interval = None if prediction is None else prediction.interval
        if interval is not None and is_informative(interval, corrected=best is not None):
            of += 1
            inside += flight.error in interval
        if prediction is not None and best is not None and gains not in seen:
            agreed = (prediction.error - best) * (flight.error - best)
            agreeing += agreed > 0.0
            disagreeing += agreed < 0.0
        best = flight.error if best is None else min(best, flight.error)
        seen.add(gains)
    return TrackRecord(inside=inside, of=of, agreeing=agreeing, disagreeing=disagreeing)


def with_interval(evidence: Evidence[ModelledExperiment], proposal: Proposal, *, base: Flight | None) -> Proposal:
    """Add the interval and band to a proposal; one that has an interval, or predicts nothing, is returned unmodified.

    `base` is the flight whose bias corrects the prediction, None for the uncorrected model. Of the other flights only
    gains, errors and predictions are used.
    """
    from scipy.special import stdtrit

    if proposal.interval is not None or proposal.predicted is None or proposal.predicted_error is None:
        return proposal
    experiment, scatter = evidence.experiment, evidence.scatter
    outputs = _sample_outputs(experiment, evidence.space.vector(proposal.gains), base)
    repeats = next((group.size for group in evidence.groups if base and base.number in group.numbers), 0)
    noise = scatter.sigma**2 * (1.0 + (1.0 / repeats if repeats else 0.0))
    reach = float(stdtrit(scatter.degrees_of_freedom, 0.5 + CONFIDENCE / 2)) * interval_scale(evidence.flights)
    errors, curve = experiment.errors(outputs), proposal.predicted[experiment.output]
    half = reach * float(np.sqrt(noise + np.var(errors, ddof=1)))
    offset = noise / offset_sensitivity(experiment) ** 2
    band = reach * np.sqrt(offset + np.var(outputs, axis=0, ddof=1))
    middle, centre, error = np.mean(outputs, axis=0), float(np.mean(errors)), proposal.predicted_error
    return replace(
        proposal,
        interval=positive_interval(min(error, centre - half), max(error, centre + half)),
        predicted=with_band(experiment, curve, np.minimum(curve, middle - band), np.maximum(curve, middle + band)),
    )


def repeat_proposal(evidence: Evidence[Experiment], group: Group, kind: Kind, why: Explanation) -> Proposal:
    """Proposal to repeat a policy: predicts the mean of its flights, with the scatter as interval.

    Without a reported scatter there is no interval: it is unknown, or the repeats were identical to the last digit and
    contradict the prior.
    """
    experiment, scatter = evidence.experiment, evidence.scatter
    flown = [flight for flight in evidence.flights if flight.number in group.numbers]
    measured = np.array([resample_to_grid(experiment, flight) for flight in flown])
    curve = measured.mean(axis=0)
    bare = Proposal(
        kind=kind,
        gains=dict(group.gains),
        predicted=Trajectory(experiment.grid_s, {experiment.output: curve}, "flights", "simulation"),
        predicted_error=group.mean,
        explanation=why,
    )
    if scatter.reported is None:
        return bare
    half = scatter.half_width(1.0 + 1.0 / group.size, CONFIDENCE)
    offset = half / offset_sensitivity(experiment)
    return replace(
        bare,
        predicted=with_band(experiment, curve, curve - offset, curve + offset, source="flights"),
        interval=positive_interval(group.mean - half, group.mean + half),
    )


def interval_reach() -> float:
    """Half-width of the interval of a prediction, in standard deviations of a normal error."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + CONFIDENCE / 2.0))


def interval_scale(flights: Sequence[Flight]) -> float:
    """The factor f: above 1 if earlier prediction errors exceeded their intervals, below 1 if they were smaller."""
    half_width = interval_reach()
    squares = [
        (
            (2.0 * flight.error - interval.lower - interval.upper)
            / max(interval.upper - interval.lower, _TINY)
            * half_width
        )
        ** 2
        for flight in flights
        if flight.error is not None and flight.predicted and (interval := flight.predicted.interval)
    ]
    return float(np.sqrt((_PRIOR_WEIGHT + sum(squares)) / (_PRIOR_WEIGHT + len(squares))))


def _sample_outputs(experiment: ModelledExperiment, gains: Vector, base: Flight | None) -> Matrix:
    """Outputs of these gains on the sampled models, shape (k, n), each with its own bias if there is a base."""
    variances = [parameter.prior_sd**2 for parameter in experiment.model_parameters]
    prior = normal_distribution(experiment.prior_mean, np.diag(variances), origin="the priors of a fit")
    models = prior.sample(experiment, MODELS)
    proposed = experiment.outputs(np.tile(gains, (MODELS, 1)), models)
    if base is None:
        return proposed
    flown = experiment.outputs(np.tile(experiment.space.vector(base.gains), (MODELS, 1)), models)
    return np.asarray(proposed - flown + resample_to_grid(experiment, base))


def offset_sensitivity(experiment: Experiment) -> float:
    """Error caused by a constant offset of one unit of the output: 1 for a mean, the window for an integral."""
    return experiment.window_s if experiment.integrates else 1.0


_AT_ONCE: Final = 8
"""Number of gain sets simulated together, limited because their curves are held in memory."""
_MODEL_ERROR: Final = 0.02
"""Relative error of even the best simple model."""
_GUST_VARIATION: Final = 0.5
"""Relative variation of the error caused by gusts between flights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPrediction(ModelPrediction):
    """Prediction of a flight by a fitted model, its curve with a band; `models` are those used, (k, m), with their
    `errors` (k,)."""

    interval: Interval
    models: Matrix
    errors: Vector


def predict_flight(calibration: Calibration, base: Flight, gains: Vector) -> FlightPrediction:
    """Predict a flight with `gains`, shape (n,); `base` is the best of the calibrated flights."""
    experiment = calibration.experiment
    bias = remaining_biases(calibration, base, gains[np.newaxis])[0]
    models = calibration.plausible(runs=MODELS, next_flight=True)
    clean = experiment.outputs(np.tile(gains, (MODELS, 1)), models)
    outputs = clean + bias
    errors = experiment.errors(outputs)
    weather = _GUST_VARIATION * float(np.mean(errors - experiment.errors(clean)))
    error = float(np.mean(errors))
    model_error = float(np.hypot(_MODEL_ERROR * error, experiment.least_model_error(base.trajectory)))
    sd = float(np.sqrt(np.var(errors) + weather**2 + model_error**2))
    curve = outputs.mean(axis=0)
    noise = float(np.sqrt(np.mean(bias**2)))
    reach = interval_reach()
    half = reach * np.sqrt(outputs.var(axis=0) + noise**2)
    return FlightPrediction(
        trajectory=with_band(experiment, curve, curve - half, curve + half),
        error=error,
        interval=positive_interval(error - reach * sd, error + reach * sd),
        models=models,
        errors=errors,
    )


def predict_errors(calibration: Calibration, base: Flight, gains: Matrix) -> Vector:
    """Errors as predicted by `predict_flight` for many gain sets, a few at a time: (c, n) → (c,)."""
    experiment = calibration.experiment
    models = calibration.plausible(runs=MODELS, next_flight=True)
    errors = np.empty(len(gains))
    for first in range(0, len(gains), _AT_ONCE):
        some = gains[first : first + _AT_ONCE]
        clean = experiment.outputs(np.repeat(some, MODELS, axis=0), np.tile(models, (len(some), 1)))
        beyond = np.repeat(remaining_biases(calibration, base, some), MODELS, axis=0)
        errors[first : first + len(some)] = experiment.errors(clean + beyond).reshape(-1, MODELS).mean(axis=1)
    return errors


def remaining_biases(calibration: Calibration, base: Flight, gains: Matrix) -> Matrix:
    """Expected deviations of flights from the calibrated model, on the grid: gains (c, n) → (c, samples)."""
    experiment = calibration.experiment
    flown = experiment.space.vector(base.gains)
    own = calibration.own_models[calibration.numbers.index(base.number)]
    disturbances = experiment.disturbances(base.trajectory.as_stored(), flown, own)
    if disturbances is None:
        return np.stack([calibration.residual * _similarity(experiment, some, flown) for some in gains])
    calm = np.zeros_like(disturbances)
    calm[:, ENTERED] = disturbances[:, ENTERED]
    disturbed, undisturbed = (experiment.disturbed_outputs(gains, own, acting) for acting in (disturbances, calm))
    beyond: Matrix = disturbed - undisturbed
    return beyond


def _similarity(experiment: ModelledExperiment, gains: Vector, flown: Vector) -> float:
    """1 at the flown gains, 0.6 at a distance of one scale."""
    return float(np.exp(-0.5 * np.sum(((gains - flown) / experiment.space.scale) ** 2)))
