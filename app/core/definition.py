"""The frozen definition of a campaign and its flights: the fields that computations need, the settings of strategies
and experiments with their validation, and queries of the flight history.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Literal

import numpy as np

from app.core.errors import Problem
from app.core.formatting import allowed_range
from app.core.policy import Gains, is_finite, shortened
from app.core.records.trajectory import Trajectory

OptionValue = bool | int | float | str


@dataclass(frozen=True, slots=True, kw_only=True)
class Donor:
    """The flight of another campaign that a warm start uses: its best, with the checksum of its record."""

    campaign_id: int
    trial_number: int
    checksum: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LogEvidence:
    """What the log of another flight tells before the first flight: the mean distance between reference and altitude
    in its own manoeuvre, m, mean and standard deviation of the parameters of the vehicle's model, and the autopilot's
    parameters in that flight, each by name."""

    file_name: str
    error_m: float
    vehicle: dict[str, tuple[float, float]]
    parameters: dict[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Source of the first flight's gains.

    `gains` is set only with the kinds `given` and `campaign`. `donor` is set only with `campaign`: the gains are then
    the best of another campaign, copied when this one was defined. `log` may be set with `given`: the gains are those
    proposed from it.
    """

    kind: Literal["default", "simplex", "given", "campaign"] = "default"
    gains: dict[str, float] | None = None
    donor: Donor | None = None
    log: LogEvidence | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopRule:
    """When a campaign ends.

    - `noise`: when no further step can be distinguished from noise with `confidence`, and the winner was flown again
      and compared with the baseline.
    - `paper`: after two flights in a row that do not improve on the best so far by `improvement` (a fraction of the
      best), or when the budget is used up.
    - `budget`: only the number of flights ends the campaign.

    With every kind, `max_flights` or a flight that ends below `min_battery_v` (V) ends the campaign.
    """

    kind: Literal["noise", "paper", "budget"] = "noise"
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
        """SHA-256 of the canonical JSON, hex; safe gains are included only if the vehicle has its own, a log only if
        there is one."""
        fields = asdict(self)
        if self.safe_gains is None:
            del fields["safe_gains"]
        if self.start.log is None:
            del fields["start"]["log"]
        return hashlib.sha256(json.dumps(fields, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Predicted interval of the error, with probability `confidence`."""

    lower: float
    upper: float
    confidence: float = 0.9

    def __contains__(self, error: float) -> bool:
        return self.lower <= error <= self.upper


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Predicted error of a flight, and its interval if there is one."""

    error: float
    interval: Interval | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A finished trial as a strategy sees it: single-precision trajectory, error in the experiment's unit.

    `outcome` is `valid` or `aborted`; invalid and lost flights are left out. An aborted flight has no error.
    `against_gains` is false if a person aborted the flight for another reason than the vehicle's behaviour. `predicted`
    is None for gains whose error was not predicted when their flight was planned. `parameters` are those of the
    vehicle's autopilot in flight, by the firmware's names, as far as they were recorded.
    """

    number: int
    gains: Mapping[str, float]
    trajectory: Trajectory
    error: float | None
    outcome: Literal["valid", "aborted"]
    predicted: Prediction | None = None
    against_gains: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)


def flight_seed(seed: int, number: int) -> int:
    """Random seed of a campaign's flight `number` (from 1): 32 bits, independent between flights and campaigns."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])


@dataclass(frozen=True, slots=True)
class Option:
    """One setting: one of `choices`, or any number of the default's type within `lower` … `upper`. `label`: the title
    without the help for entering a value, empty if it contains none. `autopilots`: those whose vehicles have it, empty
    for all."""

    name: str
    title: str
    default: OptionValue
    unit: str = ""
    lower: float | None = None
    upper: float | None = None
    choices: tuple[OptionValue, ...] = ()
    label: str = ""
    autopilots: tuple[str, ...] = ()

    def refusal(self, value: OptionValue) -> str | None:
        """Why `value` is not allowed, or None if it is."""
        if self.choices:
            if any(value == choice and type(value) is type(choice) for choice in self.choices):
                return None
            return f"must be one of {', '.join(str(choice).lower() for choice in self.choices)}, got {value!r}"
        return self._no_number(value)

    def _no_number(self, value: OptionValue) -> str | None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return f"must be a number, got {value!r}"
        if not is_finite(value):
            return f"must be a finite number, got {shortened(value)}"
        if isinstance(self.default, int) and value != int(value):
            return f"must be a whole number, got {value:g}"
        if (self.lower is not None and value < self.lower) or (self.upper is not None and value > self.upper):
            return f"must be {allowed_range(self.lower, self.upper)} {self.unit}".rstrip() + f", got {value:g}"
        return None


def problems_of_options(
    chosen: Mapping[str, OptionValue], offered: Sequence[Option], *, field: str, owner: str
) -> Iterator[Problem]:
    """Every setting in `chosen` that `owner` does not have, or whose value is not allowed."""
    known = {option.name: option for option in offered}
    for name, value in chosen.items():
        if name not in known:
            yield Problem(f"{field}.{name}", f"is not an option of {owner} (options: {', '.join(known) or 'none'})")
        elif (reason := known[name].refusal(value)) is not None:
            yield Problem(f"{field}.{name}", reason)


def with_defaults(chosen: Mapping[str, OptionValue], offered: Sequence[Option]) -> dict[str, OptionValue]:
    """Every setting: the chosen value, else the default."""
    return {option.name: chosen.get(option.name, option.default) for option in offered}


def titled(chosen: Mapping[str, OptionValue], offered: Iterable[Option]) -> Iterator[tuple[str, str, OptionValue]]:
    """Title, unit and value of each chosen setting; one that is not offered has its name as its title."""
    described = {option.name: (option.title, option.unit) for option in offered}
    return ((*described.get(name, (name, "")), value) for name, value in chosen.items())


def best_flight(flights: Sequence[Flight]) -> Flight:
    """The valid flight with the lowest error, the earliest of equals. At least one flight must be valid."""
    return min(
        (flight for flight in flights if flight.error is not None and flight.outcome == "valid"),
        key=lambda flight: (flight.error, flight.number),
    )


def was_flown(gains: Gains, flights: Sequence[Flight]) -> bool:
    """Whether these gains were flown before, to the end or until an abort that counts against them."""
    return any(
        dict(flight.gains) == dict(gains) for flight in flights if flight.outcome == "valid" or flight.against_gains
    )


def aborted_by_gains(flights: Sequence[Flight], gains: Gains | None = None) -> list[Flight]:
    """The flights whose abort counts against their gains; only those with `gains` if they are given."""
    return [
        flight
        for flight in flights
        if flight.outcome == "aborted" and flight.against_gains and (gains is None or dict(flight.gains) == dict(gains))
    ]
