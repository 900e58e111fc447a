"""What a strategy is: a pure function of a campaign's definition and its flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment, FittedParameter, Matrix, ModelledExperiment
from app.core.options import Option
from app.core.policy import PolicySpace, Vector
from app.core.spread import ParameterDistribution
from app.core.trajectory import Trajectory

ErrorsOf = Callable[[Matrix], Vector]
"""Gains (k, g) → the errors that a model predicts for them, (k,)."""

Kind = Literal["start", "step", "shorter step", "repeat", "baseline", "manual", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderStep:
    """One step size tried along the search line: length in the strategy's own metric, gains flown on the model, and
    the predicted error there; `clipped` names the gains that a bound or step limit stopped."""

    length: float
    gains: dict[str, float]
    predicted_error: float
    clipped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Where the error is expected, with probability `confidence`."""

    lower: float
    upper: float
    confidence: float = 0.9

    def __contains__(self, error: float) -> bool:
        return self.lower <= error <= self.upper


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why these gains: sentences for a person, and the numbers behind them.

    `lesson` says what the flight is expected to teach; `fitted` is empty for strategies that fit nothing;
    `trust_fraction` is the share of each gain's range that the step was allowed, None without a trust region.
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
    """The next gain set. Kind `none` means that the strategy has nothing better to offer, `manual` that the operator
    chooses; `gains` is then the best flown.

    `spread` is what is known of the vehicle, where the strategy has found it out; it is costly to find again.
    `predicted` is the corrected model's output for these gains on the experiment's grid; where a band is known, it has
    two more channels, named by `band_channels`. `interval` is where the flight's error is expected, its scatter
    included.
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
    """A registered strategy: `propose(definition, experiment, space, flights)`, with at least one valid flight.

    `foresee(definition, experiment, flights)` is the model that its proposals' errors come from, for many gain sets.

    `experiments` names those it works with; empty: with all. `learns`: whether its predictions are corrected by the
    flight that its explanation names as the base. `needs_model`: whether it finds gains by flying them on a model.
    """

    name: str
    title: str
    line: str
    options: tuple[Option, ...]
    propose: Callable[[Definition, ModelledExperiment, PolicySpace, Sequence[Flight]], Proposal]
    predict_errors: Callable[[Definition, ModelledExperiment, Sequence[Flight]], ErrorsOf]
    experiments: tuple[str, ...] = ()
    corrects_model: bool = True
    needs_model: bool = True

    def works_with(self, experiment: Experiment) -> bool:
        """Whether a campaign may combine the two."""
        named = not self.experiments or experiment.name in self.experiments
        return named and not (self.needs_model and experiment.modelled is None)


def band_channels(output: str) -> tuple[str, str]:
    """Names of the channels that hold the lower and the upper edge of a predicted output's band."""
    return f"{output}_lower", f"{output}_upper"
