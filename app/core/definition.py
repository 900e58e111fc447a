"""The frozen definition of a campaign, as the mathematics needs it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from app.core.trajectory import Trajectory

OptionValue = bool | int | float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where the first flight's gains come from; `gains` only with kind `given`."""

    kind: Literal["default", "simplex", "given"] = "default"
    gains: dict[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRule:
    """`paper`: two flights in a row without `improvement` (a fraction of the best) on the best so far, or the budget;
    `budget`: only the number of flights ends the campaign."""

    kind: Literal["paper", "budget"] = "paper"
    max_flights: int = 7
    improvement: float = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """Everything a proposal depends on, beside the flights. `bounds` narrow the experiment's own;
    `first_step_fraction` and `step_fraction` limit a gain's change as shares of its range, before and after the first
    valid flight."""

    experiment: str = "takeoff"
    strategy: str = "gradient"
    options: dict[str, OptionValue] = field(default_factory=dict)
    start: Start = field(default_factory=Start)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    first_step_fraction: float = 0.25
    step_fraction: float = 1.0
    stop: StopRule = field(default_factory=StopRule)
    seed: int = 1

    def digest(self) -> str:
        """SHA-256 of the canonical JSON, hex."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A finished trial as a strategy sees it: single-precision trajectory, error in the experiment's unit.

    `outcome` is `valid` or `aborted`; invalid and lost flights are not history. An aborted flight has no error.
    """

    number: int
    gains: Mapping[str, float]
    trajectory: Trajectory
    error: float | None
    outcome: Literal["valid", "aborted"]


def flight_seed(seed: int, number: int) -> int:
    """The seed of a campaign's flight `number` (from 1): 32 bits, unrelated between flights and between campaigns."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])
