"""The frozen definition of a campaign: the fields that computations need."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from app.core.trajectory import Trajectory

OptionValue = bool | int | float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Donor:
    """The flight of another campaign that a warm start uses: its best, with the checksum of its record."""

    campaign_id: int
    trial_number: int
    checksum: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Source of the first flight's gains.

    `gains` is set only with the kinds `given` and `campaign`. `donor` is set only with `campaign`: the gains are then
    the best of another campaign, copied when this one was defined.
    """

    kind: Literal["default", "simplex", "given", "campaign"] = "default"
    gains: dict[str, float] | None = None
    donor: Donor | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRule:
    """When a campaign ends.

    - `paper`: after two flights in a row that do not improve on the best so far by `improvement` (a fraction of the
      best), or when the budget is used up.
    - `noise`: when no further step can be distinguished from noise with `confidence`, and the winner was flown again
      and compared with the baseline.
    - `budget`: only the number of flights ends the campaign.

    With every kind, `max_flights` or a flight that ends below `min_battery_v` (V) ends the campaign.
    """

    kind: Literal["paper", "noise", "budget"] = "paper"
    max_flights: int = 7
    improvement: float = 0.05
    confidence: float = 0.9
    min_battery_v: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Definition:
    """Everything a proposal depends on, besides the flights.

    `bounds` narrow the experiment's own. `first_step_fraction` and `step_fraction` limit a gain's change, as shares of
    its range, before and after the first valid flight. `ceiling_m` is the highest altitude that the gate lets a model
    run reach. `safe_gains` are the gains flown after an abort, if the vehicle's differ from the experiment's default
    gains.
    """

    experiment: str = "takeoff"
    experiment_options: dict[str, OptionValue] = field(default_factory=dict)
    strategy: str = "gradient"
    options: dict[str, OptionValue] = field(default_factory=dict)
    start: Start = field(default_factory=Start)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    first_step_fraction: float = 0.25
    step_fraction: float = 1.0
    ceiling_m: float = 4.5
    stop: StopRule = field(default_factory=StopRule)
    seed: int = 1
    safe_gains: dict[str, float] | None = None

    def digest(self) -> str:
        """SHA-256 of the canonical JSON, hex; safe gains are included only if the vehicle has its own."""
        fields = asdict(self)
        if self.safe_gains is None:
            del fields["safe_gains"]
        return hashlib.sha256(json.dumps(fields, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Predicted error of a flight, and its 90 % interval if there is one."""

    error: float
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A finished trial as a strategy sees it: single-precision trajectory, error in the experiment's unit.

    `outcome` is `valid` or `aborted`; invalid and lost flights are left out. An aborted flight has no error.
    `against_gains` is false if a person aborted the flight for another reason than the vehicle's behaviour. `predicted`
    is None for gains that no proposal contained.
    """

    number: int
    gains: Mapping[str, float]
    trajectory: Trajectory
    error: float | None
    outcome: Literal["valid", "aborted"]
    predicted: Prediction | None = None
    against_gains: bool = True


def flight_seed(seed: int, number: int) -> int:
    """Random seed of a campaign's flight `number` (from 1): 32 bits, independent between flights and campaigns."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])
