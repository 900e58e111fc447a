"""How far a step may go from the best flight, given how well earlier predictions held, and the best gains within those
bounds on several plausible models at once.

The merit of a policy is its mean error over the models, plus a penalty of one metre per metre by which it rises more
than 0.6 m above the set point on any model, or stays that far below it after five seconds; both limits keep a margin
from what is unsafe. A fixed set of points spread over the box is evaluated first, on shorter flights and on half the
models; then Nelder–Mead on integer counts starts from the best two.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Matrix, halton
from app.core.experiments.takeoff import Takeoff
from app.core.policy import Vector

SHRINK: Final = 0.5
GROW: Final = 2.0


def trust_fraction(flights: Sequence[Flight]) -> float:
    """Allowed step as a share of each gain's range, at most 1, from the flights in order.

    Starts at the whole range. Halved after a flight aborted because of its gains, and after one whose error exceeds its
    predicted interval; doubled after one inside the interval. The first valid flight is ignored, because its prediction
    did not come from a calibrated model.
    """
    fraction, is_calibrated = 1.0, False
    for flight in flights:
        if flight.outcome == "aborted":
            fraction *= SHRINK if flight.against_gains else 1.0
        elif is_calibrated and flight.error is not None and (predicted := flight.predicted) is not None:
            if predicted.upper is not None and flight.error > predicted.upper:
                fraction *= SHRINK
            elif predicted.lower is not None and flight.error >= predicted.lower:
                fraction = min(fraction * GROW, 1.0)
        is_calibrated = is_calibrated or flight.outcome == "valid"
    return fraction


def minimise_in_box(
    error: Callable[[Vector], float],
    start: Vector,
    steps: Vector,
    low: Vector,
    high: Vector,
    *,
    evaluations: int,
    tolerance: float,
) -> Vector:
    """Minimise `error` within the box and return the final point, shape (n,).

    The initial simplex is `start` and its `steps` (positive) away from the nearer bound. The search ends when the
    simplex is `tolerance` wide and its errors differ by 1e-6, or after `evaluations`.
    """
    from scipy.optimize import minimize

    inward = np.where(start > (low + high) / 2.0, -steps, steps)
    found = minimize(
        error,
        start,
        method="Nelder-Mead",
        bounds=list(zip(low, high, strict=True)),
        options={
            "initial_simplex": np.vstack((start, start + np.diag(inward))),
            "maxfev": evaluations,
            "xatol": tolerance,
            "fatol": 1e-6,
        },
    )
    return np.asarray(found.x)


_POINTS: Final = 64
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


def merit(experiment: Takeoff, gains: Matrix, models: Matrix, until_s: float | None = None) -> Vector:
    """Mean error, m, plus the penalty for unsafe flights: gains (c, 3), models (k, m) → (c,); lower is better.

    `until_s` is the time up to which flights are simulated, by default the finer of the experiment's.
    """
    sketches = experiment.sketches(gains, models, experiment.sketches_s[1] if until_s is None else until_s)
    lowest_m, highest_m = experiment.expected_m
    beyond = np.maximum(sketches.highest_m - highest_m, 0.0) + np.maximum(lowest_m - sketches.lowest_m, 0.0)
    return np.asarray(np.round(sketches.errors.mean(axis=1) + beyond.max(axis=1), _DIGITS))


def find_robust_optimum(experiment: Takeoff, box: Box, models: Matrix, known: Matrix) -> Vector:
    """The best gains found in the box, shape (n,); `known` (c, n) are included in the first points."""
    spread = box.low + halton(len(box.low), _POINTS + 1)[1:] * (box.high - box.low)
    points = box.nearest(np.vstack((known, spread)))
    first = merit(experiment, points, models[::2], experiment.sketches_s[0])
    starts = points[np.argsort(first, kind="stable")[: len(_EVALUATIONS)]]

    @cache
    def flown(counts: tuple[float, ...]) -> float:
        return float(merit(experiment, np.array([counts]), models)[0])

    def fine(gains: Vector) -> float:
        return flown(tuple(box.nearest(gains).tolist()))

    steps = (box.high - box.low) / 10.0
    ends = [
        box.nearest(minimise_in_box(fine, start, steps, box.low, box.high, evaluations=evaluations, tolerance=1.0))
        for start, evaluations in zip(starts, _EVALUATIONS, strict=True)
    ]
    return ends[int(np.argmin([fine(end) for end in ends]))]
