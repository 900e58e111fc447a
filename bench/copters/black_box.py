"""Black-box searches for gains on a vehicle, flight by flight, without a model.

Each begins with the gains of the first flight, knows the error of single flights alone, and searches the space of
a proposal as a unit cube.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from app.core.analysis.loop import GainSpace
from app.core.records.trajectory import Samples
from bench.targets.flying import BudgetSpentError

BUDGET: Final = 20
_FIRST_STEP: Final = 0.25

Gains = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Trial:
    """A flight of a search: its gains and its error, m."""

    gains: Gains
    error_m: float


def best_of(trials: Sequence[Trial]) -> Trial:
    """The flight with the least error."""
    return min(trials, key=lambda trial: trial.error_m)


def nelder_mead(space: GainSpace, first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:  # noqa: ARG001
    """The simplex of Nelder and Mead, with first steps of a quarter of each range."""
    flown = _Flown(space, fly)
    start = flown.point(first)
    simplex = np.vstack((start, start + np.diag(np.where(start > 0.5, -_FIRST_STEP, _FIRST_STEP))))
    with suppress(BudgetSpentError):
        minimize(
            flown.error,
            start,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * len(start),
            options={"initial_simplex": simplex, "maxfev": BUDGET + 1, "xatol": 0.0, "fatol": 0.0},
        )
    return flown.trials


def quadratic_models(space: GainSpace, first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:  # noqa: ARG001
    """COBYQA: a quadratic model of the error within a trust region."""
    flown = _Flown(space, fly)
    start = flown.point(first)
    with suppress(BudgetSpentError):
        minimize(
            flown.error,
            start,
            method="COBYQA",
            bounds=[(0.0, 1.0)] * len(start),
            options={"maxfev": BUDGET + 1, "initial_tr_radius": _FIRST_STEP, "final_tr_radius": 1e-6},
        )
    return flown.trials


def random_search(space: GainSpace, first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:
    """Points that fill the bounds evenly (Sobol), in random order."""
    flown = _Flown(space, fly)
    points = qmc.Sobol(len(space.bounds), rng=np.random.default_rng(seed)).random_base2(5)
    with suppress(BudgetSpentError):
        for point in (flown.point(first), *points):
            flown.error(point)
    return flown.trials


SEARCHES: Final[Mapping[str, Callable[..., list[Trial]]]] = {
    "Nelder-Mead": nelder_mead,
    "COBYQA": quadratic_models,
    "random search": random_search,
}


class _Flown:
    """The flights of a search; raises BudgetSpentError instead of flying one too many."""

    def __init__(self, space: GainSpace, fly: Callable[[Gains], float]) -> None:
        self._space, self._fly = space, fly
        ends = [{name: ends[place] for name, ends in space.bounds.items()} for place in (0, 1)]
        self._low, self._high = map(space.coordinates, ends)
        self.trials: list[Trial] = []

    def error(self, point: Samples) -> float:
        if len(self.trials) == BUDGET:
            raise BudgetSpentError
        gains = self._space.gains_at(self._low + np.clip(point, 0.0, 1.0) * (self._high - self._low))
        self.trials.append(Trial(gains, self._fly(gains)))
        return self.trials[-1].error_m

    def point(self, gains: Gains) -> Samples:
        """The gains in the unit cube, shape (k,)."""
        return np.asarray((self._space.coordinates(gains) - self._low) / (self._high - self._low))
