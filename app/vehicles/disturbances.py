"""Seeded disturbances of simulated flights."""

import numpy as np

from app.vehicles.kernels import Rows, correlate


def streams(seed: int, count: int) -> list[np.random.Generator]:
    """Independent generators of one flight: what one of them is asked for leaves the others alone."""
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(count)]


def gusts(generator: np.random.Generator, steps: int, *, sd: float, correlation_s: float) -> Rows:
    """Gauss-Markov gusts at 512 Hz, shape (steps,), with the standard deviation's unit."""
    if sd == 0.0:
        return np.zeros(steps)
    series = generator.standard_normal(steps)
    correlate(series, correlation_s)
    series *= sd
    return series
