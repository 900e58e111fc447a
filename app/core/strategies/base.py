"""What a strategy is: a pure function of a campaign's definition and its flights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from app.core.definition import Definition, Flight, OptionValue
from app.core.experiments.base import Experiment
from app.core.policy import PolicySpace
from app.core.trajectory import Trajectory

Kind = Literal["start", "step", "shorter step", "manual", "none"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LadderStep:
    """One step size tried along the search line: length in the strategy's own metric, gains flown on the model, and
    the predicted error there; `clipped` names the gains that a bound or step limit stopped."""

    length: float
    gains: dict[str, float]
    predicted_error: float
    clipped: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """Why these gains: sentences for a person, and the numbers behind them."""

    summary: str
    base_flight: int | None = None
    gradient: dict[str, float] = field(default_factory=dict)
    direction: dict[str, float] = field(default_factory=dict)
    ladder: tuple[LadderStep, ...] = ()
    chosen_length: float | None = None
    clipped: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """The next gain set. Kind `none` means that the strategy has nothing better to offer, `manual` that the operator
    chooses; `gains` is then the best flown.

    `predicted` is the corrected model's output for these gains on the experiment's grid.
    """

    kind: Kind
    gains: dict[str, float]
    predicted: Trajectory | None
    predicted_error: float | None
    explanation: Explanation


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One setting of a strategy."""

    name: str
    title: str
    default: OptionValue
    choices: tuple[OptionValue, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Strategy:
    """A registered strategy: `propose(definition, experiment, space, flights)`, with at least one valid flight."""

    name: str
    title: str
    line: str
    options: tuple[Option, ...]
    propose: Callable[[Definition, Experiment, PolicySpace, Sequence[Flight]], Proposal]
