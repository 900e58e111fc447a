"""Uncertainty of a prediction: its interval and band before the flight, and the track record afterwards.

A bias-corrected model ŷ = model(gains; p) + (measured − model(flown gains; p)) is run for a sample of likely parameter
sets p (from the priors of a fit), each with its own bias. The mean and standard deviation of their errors represent the
model uncertainty. With the flight-to-flight scatter σ (`app.core.statistics`), which affects both the new flight and
the n flights of the base,

    interval = mean ± t(ν) · f · √(σ² (1 + 1/n) + sd²),    widened to contain the predicted error itself.

The band has the same form at every instant, with σ converted to the output offset that costs σ. The factor f adapts to
experience: f² = (ν₀ + Σ z²)/(ν₀ + k), where z are the k earlier prediction errors in units of their own intervals and
ν₀ = 4. An uncorrected model (first flight, simplex) has no base: the term 1/n and the bias are omitted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.definition import Flight, Prediction
from app.core.experiments.base import Experiment, Matrix, ModelledExperiment
from app.core.policy import PolicySpace, Vector
from app.core.recorded import resample_to_grid
from app.core.spread import ParameterDistribution
from app.core.statistics import Group, PooledScatter, groups_of
from app.core.strategies.base import Explanation, Interval, Kind, Proposal, band_channels
from app.core.trajectory import Samples, Trajectory

CONFIDENCE: Final = 0.9
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
    trustworthy: bool
    sentence: str

    @property
    def share(self) -> float | None:
        """Share of flights inside their interval; None before the first flight with an interval."""
        return self.inside / self.of if self.of else None


def track_record(flights: Sequence[Flight]) -> TrackRecord:
    """Compute the track record of the predictions that the flights carry.

    The direction counts where new gains were predicted to change the best error before them; repeated gains predict no
    change. The predictions are not trustworthy once at least three flights went in the other direction, and more than
    went in the predicted one.
    """
    inside = of = agreeing = disagreeing = 0
    best: float | None = None
    seen: set[frozenset[tuple[str, float]]] = set()
    for flight in flights:
        if flight.outcome != "valid" or flight.error is None:
            continue
        told, gains = flight.predicted, frozenset(flight.gains.items())
        if told is not None and told.lower is not None and told.upper is not None:
            of += 1
            inside += told.lower <= flight.error <= told.upper
        if told is not None and best is not None and gains not in seen:
            agreed = (told.error - best) * (flight.error - best)
            agreeing += agreed > 0.0
            disagreeing += agreed < 0.0
        best = flight.error if best is None else min(best, flight.error)
        seen.add(gains)
    trustworthy = not (disagreeing >= _DISAGREEMENTS and disagreeing > agreeing)
    return TrackRecord(
        inside=inside,
        of=of,
        agreeing=agreeing,
        disagreeing=disagreeing,
        trustworthy=trustworthy,
        sentence=_sentence(inside, of, agreeing, disagreeing, trustworthy),
    )


def prediction_of(proposal: Proposal) -> Prediction | None:
    """The prediction stored with a flight of the proposal, for later comparison."""
    if proposal.predicted_error is None:
        return None
    interval = proposal.interval
    return Prediction(
        error=proposal.predicted_error,
        lower=None if interval is None else interval.lower,
        upper=None if interval is None else interval.upper,
    )


def with_interval(
    experiment: ModelledExperiment,
    space: PolicySpace,
    flights: Sequence[Flight],
    proposal: Proposal,
    scatter: PooledScatter,
    *,
    base: Flight | None,
) -> Proposal:
    """Add the interval and band to a proposal; one that has an interval, or predicts nothing, is returned unmodified.

    `base` is the flight whose bias corrects the prediction, None for the uncorrected model.
    """
    from scipy.special import stdtrit

    if proposal.interval is not None or proposal.predicted is None or proposal.predicted_error is None:
        return proposal
    outputs = _sample_outputs(experiment, space, space.vector(proposal.gains), base)
    repeats = next((group.size for group in groups_of(flights) if base and base.number in group.numbers), 0)
    noise = scatter.sigma**2 * (1.0 + (1.0 / repeats if repeats else 0.0))
    reach = float(stdtrit(scatter.degrees_of_freedom, 0.5 + CONFIDENCE / 2)) * interval_scale(flights)
    errors, curve = experiment.errors(outputs), proposal.predicted[experiment.output]
    half = reach * float(np.sqrt(noise + np.var(errors, ddof=1)))
    offset = noise / offset_sensitivity(experiment) ** 2
    band = reach * np.sqrt(offset + np.var(outputs, axis=0, ddof=1))
    middle = np.mean(outputs, axis=0)
    edges = (np.minimum(curve, middle - band), np.maximum(curve, middle + band))
    centre = float(np.mean(errors))
    return replace(
        proposal,
        interval=_interval(min(proposal.predicted_error, centre - half), max(proposal.predicted_error, centre + half)),
        predicted=_with_band(proposal.predicted, experiment.output, *edges),
    )


def repeat_proposal(
    experiment: Experiment,
    flights: Sequence[Flight],
    group: Group,
    scatter: PooledScatter,
    kind: Kind,
    why: Explanation,
) -> Proposal:
    """Proposal to repeat a policy: predicts the mean of its flights, with the scatter as interval if it is known."""
    measured = np.array([resample_to_grid(experiment, flight) for flight in flights if flight.number in group.numbers])
    curve = Trajectory(experiment.grid_s, {experiment.output: measured.mean(axis=0)}, "flights", "simulation")
    bare = Proposal(kind=kind, gains=dict(group.gains), predicted=curve, predicted_error=group.mean, explanation=why)
    if not scatter.known:
        return bare
    half = scatter.half_width(1.0 + 1.0 / group.size, CONFIDENCE)
    offset = half / offset_sensitivity(experiment)
    return replace(
        bare,
        predicted=_with_band(
            curve, experiment.output, curve[experiment.output] - offset, curve[experiment.output] + offset
        ),
        interval=_interval(group.mean - half, group.mean + half),
    )


def interval_scale(flights: Sequence[Flight]) -> float:
    """The factor f: above 1 if earlier prediction errors exceeded their intervals, below 1 if they were smaller."""
    from scipy.special import ndtri

    half_width = float(ndtri(0.5 + CONFIDENCE / 2))
    squares = [
        ((2.0 * flight.error - told.lower - told.upper) / max(told.upper - told.lower, _TINY) * half_width) ** 2
        for flight in flights
        if flight.error is not None
        and (told := flight.predicted) is not None
        and told.lower is not None
        and told.upper is not None
    ]
    return float(np.sqrt((_PRIOR_WEIGHT + sum(squares)) / (_PRIOR_WEIGHT + len(squares))))


def _with_band(curve: Trajectory, output: str, lower: Samples, upper: Samples) -> Trajectory:
    """A predicted curve with the two edges of its band added as channels."""
    edges = dict(zip(band_channels(output), (lower, upper), strict=True))
    return replace(curve, channels={**curve.channels, **edges})


def _interval(lower: float, upper: float) -> Interval:
    """The interval, cut off at zero: an error is never negative."""
    return Interval(lower=max(lower, 0.0), upper=upper, confidence=CONFIDENCE)


def _sample_outputs(experiment: ModelledExperiment, space: PolicySpace, gains: Vector, base: Flight | None) -> Matrix:
    """Outputs of these gains on the sampled models, shape (k, n), each with its own bias if there is a base."""
    parameters = experiment.model_parameters
    prior = ParameterDistribution(
        mean=tuple(parameter.prior_mean for parameter in parameters),
        covariance=tuple(map(tuple, np.diag([parameter.prior_sd**2 for parameter in parameters]).tolist())),
        origin="the priors of a fit",
    )
    models = prior.sample(experiment, MODELS)
    proposed = experiment.outputs(np.tile(gains, (MODELS, 1)), models)
    if base is None:
        return proposed
    flown = experiment.outputs(np.tile(space.vector(base.gains), (MODELS, 1)), models)
    return np.asarray(proposed - flown + resample_to_grid(experiment, base))


def offset_sensitivity(experiment: Experiment) -> float:
    """Error caused by a constant offset of one unit of the output: 1 for a mean, the window for an integral."""
    return float(experiment.errors(experiment.set_point(experiment.grid_s)[np.newaxis] + 1.0)[0])


def _sentence(inside: int, of: int, agreeing: int, disagreeing: int, trustworthy: bool) -> str:
    if not of and not agreeing + disagreeing:
        return "No flight has put a prediction to the test yet."
    parts = [f"{inside} of {of} flights lay in their predicted interval"] if of else []
    if agreeing + disagreeing:
        parts.append(f"{agreeing} of {agreeing + disagreeing} changed the error in the predicted direction")
    ending = "" if trustworthy else "; the gradient is not trustworthy: flights keep going the other way"
    return f"{', '.join(parts)}{ending}."
