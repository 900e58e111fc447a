"""Interface of a strategy: a pure function of a campaign's definition and its flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from app.core.definition import Definition, Flight, Option
from app.core.experiments.base import Experiment, FittedParameter, Matrix, ModelledExperiment, ParameterDistribution
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Trajectory

ErrorsOf = Callable[[Matrix], Vector]
"""Gains (k, g) → the errors a model predicts for them, (k,)."""

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Predicted interval of the error, with probability `confidence`."""

    lower: float
    upper: float
    confidence: float = 0.9

    def __contains__(self, error: float) -> bool:
        return self.lower <= error <= self.upper


class ModelPrediction(NamedTuple):
    """Output and error that a model predicts for one gain set; with an interval if the model has one of its own."""

    trajectory: Trajectory
    error: float
    interval: Interval | None = None


PredictionOf = Callable[[Vector], ModelPrediction]
"""Gains (g,) → what a model predicts for their flight."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Strategy:
    """A registered strategy.

    `propose(definition, experiment, space, flights)` requires at least one valid flight. `predict_errors(definition,
    experiment, flights)` returns the model from which the predicted errors of its proposals come, for many gain sets;
    `predict_flight(definition, experiment, flights)` the same model for one set, with the curve.
    `kinds` are those of the experiments it supports; empty for all. `corrects_model`: whether its predictions are
    corrected by the flight that its explanation names as the base. `needs_model`: whether it searches for gains on a
    model.
    """

    name: str
    title: str
    line: str
    options: tuple[Option, ...]
    propose: Callable[[Definition, ModelledExperiment, PolicySpace, Sequence[Flight]], Proposal]
    predict_errors: Callable[[Definition, ModelledExperiment, Sequence[Flight]], ErrorsOf]
    predict_flight: Callable[[Definition, ModelledExperiment, Sequence[Flight]], PredictionOf]
    kinds: tuple[type[object], ...] = ()
    corrects_model: bool = True
    needs_model: bool = True

    def works_with(self, experiment: Experiment) -> bool:
        """Whether a campaign may combine this strategy with the experiment."""
        supported = not self.kinds or isinstance(experiment, self.kinds)
        return supported and not (self.needs_model and experiment.modelled is None)


def band_channels(output: str) -> tuple[str, str]:
    """Names of the channels with the lower and the upper edge of a predicted output's band."""
    return f"{output}_lower", f"{output}_upper"
