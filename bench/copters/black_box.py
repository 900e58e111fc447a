"""Black-box searches for gains on a vehicle, flight by flight, without a model.

Each begins with the gains of the first flight, knows the error of single flights alone, and searches the bounds of a
proposal as a unit cube of the gains' logarithms.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from app.core.analysis.proposal import BOUNDS
from app.core.records.trajectory import Samples
from bench.targets.flying import BudgetSpentError

BUDGET: Final = 20
_FIRST_STEP: Final = 0.25

Gains = Mapping[str, float]
_LOW, _HIGH = np.log(np.array(list(BOUNDS.values()))).T


@dataclass(frozen=True, slots=True)
class Trial:
    """A flight of a search: its gains and its error, m."""

    gains: Gains
    error_m: float


def best_of(trials: Sequence[Trial]) -> Trial:
    """The flight with the least error."""
    return min(trials, key=lambda trial: trial.error_m)


def nelder_mead(first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:  # noqa: ARG001
    """The simplex of Nelder and Mead, with first steps of a quarter of each range."""
    flown = _Flown(fly)
    start = _point(first)
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


def quadratic_models(first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:  # noqa: ARG001
    """COBYQA: a quadratic model of the error within a trust region."""
    flown = _Flown(fly)
    start = _point(first)
    with suppress(BudgetSpentError):
        minimize(
            flown.error,
            start,
            method="COBYQA",
            bounds=[(0.0, 1.0)] * len(start),
            options={"maxfev": BUDGET + 1, "initial_tr_radius": _FIRST_STEP, "final_tr_radius": 1e-6},
        )
    return flown.trials


def random_search(first: Gains, fly: Callable[[Gains], float], *, seed: int) -> list[Trial]:
    """Points that fill the bounds evenly (Sobol), in random order."""
    flown = _Flown(fly)
    points = qmc.Sobol(len(BOUNDS), rng=np.random.default_rng(seed)).random_base2(5)
    with suppress(BudgetSpentError):
        for point in (_point(first), *points):
            flown.error(point)
    return flown.trials


SEARCHES: Final[Mapping[str, Callable[..., list[Trial]]]] = {
    "Nelder-Mead": nelder_mead,
    "COBYQA": quadratic_models,
    "random search": random_search,
}


class _Flown:
    """The flights of a search; raises BudgetSpentError instead of flying one too many."""

    def __init__(self, fly: Callable[[Gains], float]) -> None:
        self._fly = fly
        self.trials: list[Trial] = []

    def error(self, point: Samples) -> float:
        if len(self.trials) == BUDGET:
            raise BudgetSpentError
        values = np.exp(_LOW + np.clip(point, 0.0, 1.0) * (_HIGH - _LOW)).tolist()
        gains = dict(zip(BOUNDS, values, strict=True))
        self.trials.append(Trial(gains, self._fly(gains)))
        return self.trials[-1].error_m


def _point(gains: Gains) -> Samples:
    return np.asarray((np.log([gains[name] for name in BOUNDS]) - _LOW) / (_HIGH - _LOW))
