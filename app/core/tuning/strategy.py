"""Interface of a strategy, a pure function of the evidence, and what it returns: a proposal with its prediction."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, Literal, Protocol

from app.core.definition import Interval, Option, Prediction
from app.core.experiments.base import Experiment, FittedParameter, Matrix, ModelledExperiment, ParameterDistribution
from app.core.policy import Gains, Vector
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.evidence import Evidence

CONFIDENCE: Final = 0.9
"""Probability with which a predicted interval contains the error of a flight."""

Kind = Literal["start", "step", "shorter step", "repeat", "baseline", "manual", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderStep:
    """One step size evaluated along the search line.

    `length` is in the strategy's own metric, `gains` are those simulated; `clipped` names the gains limited by a bound
    or the step limit.
    """

    length: float
    gains: dict[str, float]
    predicted_error: float
    clipped: tuple[str, ...] = ()


def positive_interval(lower: float, upper: float) -> Interval:
    """The interval, cut off at zero: an error is never negative."""
    return Interval(lower=max(lower, 0.0), upper=upper, confidence=CONFIDENCE)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelPrediction(Prediction):
    """The same with the output that a model predicts; the interval is the model's own, if it has one."""

    trajectory: Trajectory


class Predictor(Protocol):
    """A model that predicts the flights of one campaign."""

    def predict(self, gains: Vector) -> ModelPrediction:
        """A flight with these gains, shape (g,)."""

    def errors(self, gains: Matrix) -> Vector:
        """The errors of many gain sets: (k, g) → (k,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why these gains were chosen: sentences for a person, and the numbers behind them.

    `lesson` is what the flight is expected to show; `fitted` is empty for strategies without a fit; `trust_fraction` is
    the allowed step as a share of each gain's range, None without a trust region.
    """

    summary: str
    base_flight: int | None = None
    gradient: dict[str, float] = field(default_factory=dict)
    direction: dict[str, float] = field(default_factory=dict)
    ladder: tuple[LadderStep, ...] = ()
    chosen_length: float | None = None
    clipped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    lesson: str = ""
    fitted: tuple[FittedParameter, ...] = ()
    trust_fraction: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """The next gain set.

    Kind `none` means that the strategy has nothing better to offer, `manual` that the operator chooses; `gains` is then
    the best flown. `predicted` is the corrected model's output for these gains on the experiment's grid; with a band it
    has two more channels, named by `band_channels`. `interval` is the predicted interval of the flight's error, scatter
    included. `spread` is the vehicle's parameter distribution if the strategy has computed it, which is expensive.
    """

    kind: Kind
    gains: dict[str, float]
    predicted: Trajectory | None
    predicted_error: float | None
    explanation: Explanation
    interval: Interval | None = None
    spread: ParameterDistribution | None = None


def proposal_of(
    kind: Kind,
    gains: Gains,
    predicted: ModelPrediction | None,
    explanation: Explanation,
    *,
    spread: ParameterDistribution | None = None,
) -> Proposal:
    """The proposal of gains with what a model predicts for them, None without a model."""
    return Proposal(
        kind=kind,
        gains=dict(gains),
        predicted=None if predicted is None else predicted.trajectory,
        predicted_error=None if predicted is None else predicted.error,
        explanation=explanation,
        interval=None if predicted is None else predicted.interval,
        spread=spread,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Strategy:
    """A registered strategy.

    `propose` and `model` require at least one valid flight. `model` is the one from which the predictions of its
    proposals come. `kinds` are those of the experiments it supports; empty for all. `corrects_model`: whether its
    predictions are corrected by the flight that its explanation names as the base. `needs_model`: whether it searches
    for gains on a model.
    """

    name: str
    title: str
    line: str
    options: tuple[Option, ...]
    propose: Callable[[Evidence[ModelledExperiment]], Proposal]
    model: Callable[[Evidence[ModelledExperiment]], Predictor]
    kinds: tuple[type[object], ...] = ()
    corrects_model: bool = True
    needs_model: bool = True

    def works_with(self, experiment: Experiment) -> bool:
        """Whether a campaign may combine this strategy with the experiment."""
        supported = not self.kinds or isinstance(experiment, self.kinds)
        return supported and (isinstance(experiment, ModelledExperiment) or not self.needs_model)


def band_channels(output: str) -> tuple[str, str]:
    """Names of the channels with the lower and the upper edge of a predicted output's band."""
    return f"{output}_lower", f"{output}_upper"


def with_band(
    experiment: Experiment, curve: Samples, lower: Samples, upper: Samples, *, source: str = "model"
) -> Trajectory:
    """A predicted curve on the experiment's grid with the two edges of its band."""
    edges = dict(zip(band_channels(experiment.output), (lower, upper), strict=True))
    return Trajectory(experiment.grid_s, {experiment.output: curve, **edges}, source, "simulation")
