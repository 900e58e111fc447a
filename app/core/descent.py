"""Nelder–Mead within a box, with first steps towards its interior."""

from collections.abc import Callable

import numpy as np

from app.core.policy import Vector


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
