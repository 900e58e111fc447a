"""Nelder–Mead within a box, the first steps leading into it."""

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
    """Where the search ends, shape (n,): from `start`, its first steps of `steps` (positive) away from the nearer side,
    until the simplex is `tolerance` wide and differs by 1e-6 in its errors, or `evaluations` are spent."""
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
