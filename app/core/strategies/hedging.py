"""Robust optimum: gains that perform well on several plausible models at once.

The merit of a policy is its mean error over the models, plus a penalty of one metre per metre by which it rises above
3.6 m on any model or stays below 2.4 m after five seconds; both limits keep a margin from what is unsafe. A fixed set
of points spread over the box is evaluated first, for 8 s only and on half the models; then Nelder–Mead on integer
counts starts from the best two.
"""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from app.core.descent import minimise_in_box
from app.core.experiments.base import Matrix
from app.core.experiments.takeoff import Takeoff
from app.core.policy import Vector
from app.core.quasi_random import halton

HIGHEST_M: Final = 3.6
LOWEST_M: Final = 2.4

_POINTS: Final = 64
_COARSE_S: Final = 8.0
_FINE_S: Final = 12.0
_EVALUATIONS: Final = (60, 40)
_DIGITS: Final = 9
"""Merits are rounded to nanometres: smaller differences vary between machines."""


@dataclass(frozen=True, slots=True)
class Box:
    """Lowest and highest allowed gains, both of shape (n,)."""

    low: Vector
    high: Vector

    def nearest(self, gains: Vector) -> Vector:
        """The closest integer counts in the box."""
        return np.clip(np.rint(gains), self.low, self.high)


def merit(takeoff: Takeoff, gains: Matrix, models: Matrix, until_s: float = _FINE_S) -> Vector:
    """Mean error, m, plus the penalty for unsafe flights: gains (c, 3), models (k, m) → (c,); lower is better."""
    sketches = takeoff.sketches(gains, models, until_s)
    beyond = np.maximum(sketches.highest_m - HIGHEST_M, 0.0) + np.maximum(LOWEST_M - sketches.lowest_m, 0.0)
    return np.asarray(np.round(sketches.errors.mean(axis=1) + beyond.max(axis=1), _DIGITS))


def find_robust_optimum(takeoff: Takeoff, box: Box, models: Matrix, known: Matrix) -> Vector:
    """The best gains found in the box, shape (n,); `known` (c, n) are included in the first points."""
    spread = box.low + halton(len(box.low), _POINTS + 1)[1:] * (box.high - box.low)
    points = box.nearest(np.vstack((known, spread)))
    first = merit(takeoff, points, models[::2], _COARSE_S)
    starts = points[np.argsort(first, kind="stable")[: len(_EVALUATIONS)]]

    @cache
    def flown(counts: tuple[float, ...]) -> float:
        return float(merit(takeoff, np.array([counts]), models)[0])

    def fine(gains: Vector) -> float:
        return flown(tuple(box.nearest(gains).tolist()))

    steps = (box.high - box.low) / 10.0
    ends = [
        box.nearest(minimise_in_box(fine, start, steps, box.low, box.high, evaluations=evaluations, tolerance=1.0))
        for start, evaluations in zip(starts, _EVALUATIONS, strict=True)
    ]
    return ends[int(np.argmin([fine(end) for end in ends]))]
