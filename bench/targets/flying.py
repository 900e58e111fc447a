"""One tuning of one vehicle: its flights are counted and evaluated, and end with the budget."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Final

import numpy as np

from app.core.definition import Flight, Interval, flight_seed
from app.core.experiments.takeoff import Takeoff
from app.core.policy import PolicySpace, Vector
from bench.targets.vehicles import SampledVehicle, fly, is_unsafe, noise_free_error

EXPERIMENT: Final = Takeoff()
SPACE: Final[PolicySpace] = EXPERIMENT.space
DEFAULT: Final[Mapping[str, float]] = SPACE.mapping(SPACE.default)
WORST_M: Final = 100.0
"""Error reported to a method for a flight that diverged, and the largest error reported."""


class BudgetSpentError(Exception):
    """The method has used all its flights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """One flight: its gains and error (m), the gains `chosen` that the method recommends after it, their noise-free
    error, the processor time of choosing this flight (s), and the predicted interval."""

    gains: tuple[float, ...]
    error: float
    is_unsafe: bool
    chosen: tuple[float, ...]
    chosen_error: float
    compute_s: float
    interval: tuple[float, float] | None = None


@dataclass(kw_only=True)
class Tuning:
    """The flights of one method on one vehicle. `recommends_last`: the method recommends the gains that it proposed
    last, not the best that it has flown. The scatter depends only on the vehicle, the seed and the number of the
    flight, so that it is the same for all methods."""

    vehicle: SampledVehicle
    seed: int
    budget: int
    recommends_last: bool = False
    flights: list[Flown] = field(default_factory=list)
    ended: str = "budget"
    settled_error: float | None = None
    _asked_s: float = field(default_factory=time.process_time)

    @property
    def space(self) -> PolicySpace:
        """The bounds that all methods search."""
        return SPACE

    @property
    def campaign_seed(self) -> int:
        """Seed of the method and of its flights."""
        return int(np.random.SeedSequence((self.seed, self.vehicle.number)).generate_state(1)[0])

    def error(self, gains: Vector) -> float:
        """Fly the nearest valid gains and return their error (m), at most 100. Raises BudgetSpentError."""
        return min(float(self.fly(SPACE.nearest(gains)).error or WORST_M), WORST_M)

    def fly(self, gains: Vector, interval: Interval | None = None) -> Flight:
        """Fly valid gains and store the outcome. Raises BudgetSpentError if no flights are left."""
        asked_s = time.process_time() - self._asked_s
        number = len(self.flights) + 1
        if number > self.budget:
            raise BudgetSpentError
        named = SPACE.mapping(gains)
        record = fly(self.vehicle, named, flight_seed(self.campaign_seed, number))
        is_number = bool(np.isfinite(record["altitude_m"]).all())
        error = EXPERIMENT.error(record.as_stored()) if is_number else WORST_M
        chosen, chosen_error = self._recommended(tuple(named.values()), error)
        self.flights.append(
            Flown(
                gains=tuple(named.values()),
                error=error,
                is_unsafe=is_unsafe(record),
                chosen=chosen,
                chosen_error=chosen_error,
                compute_s=asked_s,
                interval=(interval.lower, interval.upper) if interval else None,
            )
        )
        self._asked_s = time.process_time()
        return Flight(number=number, gains=named, trajectory=record.as_stored(), error=error, outcome="valid")

    def settle(self, gains: Vector, why: str) -> None:
        """End before the budget is spent, recommending these gains from now on."""
        self.ended, self.settled_error = why, noise_free_error(self.vehicle, SPACE.mapping(gains))

    def _recommended(self, gains: tuple[float, ...], error: float) -> tuple[tuple[float, ...], float]:
        if self.recommends_last or not self.flights or error < min(flight.error for flight in self.flights):
            return gains, noise_free_error(self.vehicle, dict(zip(SPACE.names, gains, strict=True)))
        return self.flights[-1].chosen, self.flights[-1].chosen_error


Method = Callable[[Tuning], None]


def tune(method: Method, tuning: Tuning) -> dict[str, object]:
    """Run a method until it ends or its budget is spent, and return the stored outcome as JSON."""
    try:
        method(tuning)
    except BudgetSpentError:
        tuning.ended = "budget"
    return {
        "ended": tuning.ended,
        "settled_error": tuning.settled_error,
        "flights": [asdict(flight) for flight in tuning.flights],
    }
