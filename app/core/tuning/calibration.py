"""Calibration of the model: least squares on the trajectories of flights, with prior knowledge of the parameters.

The fit minimises, over the parameters p and each flight's own deviations δ (in standard deviations `flight_sd`),

    Σ_flights |W·(y − ŷ(gains; p + δ))|² + Σ ((p − expected)/prior_sd)² + Σ δ²,

with y and ŷ sampled at 10 Hz. The deviations of a flight are correlated in time (a gust acts for seconds), so W whitens
them: a fourth-order autoregression, fitted to the residuals of the first pass, removes what the previous samples
predict, and the second pass minimises the innovations. This makes the standard errors realistic, and gives a short
event that no gust can cause, above all the lift-off, more weight than a long oscillation.

Results are rounded to six digits of their standard errors, so that differences between machines in the last bits of
linear algebra do not affect later results.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.definition import Flight, best_flight
from app.core.experiments.base import (
    FittedParameter,
    Matrix,
    ModelledExperiment,
    ParameterDistribution,
    fitted_parameters,
    normal_distribution,
)
from app.core.formatting import count
from app.core.policy import Vector
from app.core.records.trajectory import Samples
from app.core.tuning.corrected_model import resample_to_grid

MAX_FLIGHTS: Final = 4
"""Number of flights fitted: the best and the latest valid ones. That is enough, and it bounds the computing time."""

_RATE_HZ: Final = 10.0
_ORDER: Final = 4
_FIRST_SCALE: Final = 3.0
_NOISE_FLOOR: Final = 0.4
"""Noise standard deviation assumed by the first pass (`_FIRST_SCALE`), and the minimum that is always assumed
(`_NOISE_FLOOR`): both in units of the experiment's scatter."""
_DIFFERENCE: Final = 0.1
"""Step of the difference quotients, in prior standard deviations: well above the quantisation of the loop."""
_STARTS: Final = 32
_WIDEST_OWN: Final = 4.0
_MAX_STEPS: Final = 20
_LEAST_GAIN: Final = 0.2
"""The search ends when a step is predicted to reduce half the sum of squares by less than this: such a step moves the
solution by less than a standard deviation."""
_DAMPING: Final = 1.0
"""Damping after the first failed step, in units of the priors."""
_MODEL_ERROR_SD: Final = 0.05
"""Model error that no fit can exclude, in prior standard deviations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """Result of a fit.

    `model` is the fitted parameter vector, shape (m,), with its `covariance` (m, m); `noise` is the standard deviation
    of the residuals, in the output's unit. `own_models` holds the parameters of each flight, (k, m), in the order of
    `numbers`; `residual` is the deviation of the best flight from its own model, on the grid.
    """

    experiment: ModelledExperiment
    model: Vector
    covariance: Matrix
    noise: float
    numbers: tuple[int, ...]
    own_models: Matrix
    residual: Samples

    def spread(self) -> ParameterDistribution:
        """Distribution of the vehicle's parameters after the fit, including the model error."""
        known = np.diag(self.covariance) + (_MODEL_ERROR_SD * self.experiment.prior_sd) ** 2
        covariance = self.covariance + np.diag(known - np.diag(self.covariance))
        return normal_distribution(self.model, covariance, f"the calibration on {count(len(self.numbers), 'flight')}")

    def plausible(self, *, runs: int, width: float = 1.0, next_flight: bool = False) -> Matrix:
        """Return `runs` models (a power of two), `width` standard deviations from the fitted one.

        They lie in orthogonal directions; shape (runs, m). With fewer runs than parameters + 1, the last parameters
        keep their fitted values. `next_flight` includes the differences between flights.
        """
        from scipy.linalg import hadamard

        covariance = self.covariance
        if next_flight:
            covariance = covariance + np.diag(_flight_sd(self.experiment) ** 2)
        m = len(self.model)
        shifts = np.zeros((runs, m))
        used = min(runs - 1, m)
        shifts[:, :used] = width * hadamard(runs)[:, 1 : used + 1]
        models = self.model + shifts @ np.linalg.cholesky(covariance).T
        return np.asarray(np.clip(models, *self.experiment.limits))

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        return fitted_parameters(self.experiment.model_parameters, self.model, self.covariance)


def calibrate(experiment: ModelledExperiment, flights: Sequence[Flight]) -> Calibration:
    """Fit the model to the best and the latest valid flights, `MAX_FLIGHTS` at most.

    At least one flight must be valid; all others are ignored.
    """
    fitted = fitted_flights(flights)
    best = best_flight(fitted)
    numbers = tuple(flight.number for flight in fitted)
    fit = _Fit(experiment, fitted)
    start = fit.start()
    for _ in range(2):
        start = fit.minimum(start)
        fit.learn_noise(start)
    m = len(experiment.model_parameters)
    slopes = fit.slopes(start, fit.outputs(start))
    covariance: Matrix = np.linalg.inv(slopes.T @ slopes)[:m, :m].astype(np.float64)
    sd = np.sqrt(np.diag(covariance))
    model = np.clip(np.rint(start[:m] / sd * 1e6) * sd.round(12) / 1e6, fit.lower, fit.upper)
    own_models = fit.models(start)
    place = numbers.index(best.number)
    flown = experiment.outputs(fit.gains[place : place + 1], own_models[place])[0]
    return Calibration(
        experiment=experiment,
        model=model,
        covariance=_rounded(covariance, sd),
        noise=float(fit.noise[0]),
        numbers=numbers,
        own_models=own_models,
        residual=resample_to_grid(experiment, best) - flown,
    )


def fitted_flights(flights: Sequence[Flight]) -> list[Flight]:
    """The flights that `calibrate` uses, in the order of their numbers. At least one flight must be valid."""
    valid = [flight for flight in flights if flight.outcome == "valid" and flight.error is not None]
    best = best_flight(valid)
    latest = [flight for flight in valid[-MAX_FLIGHTS:] if flight is not best][1 - MAX_FLIGHTS :]
    return sorted((best, *latest), key=lambda flight: flight.number)


def _rounded(covariance: Matrix, sd: Vector) -> Matrix:
    correlation = np.round(covariance / np.outer(sd, sd), 6)
    rounded = np.array([float(f"{value:.6g}") for value in sd])
    return np.asarray((correlation + correlation.T) / 2.0 * np.outer(rounded, rounded))


def _flight_sd(experiment: ModelledExperiment) -> Vector:
    return np.array([parameter.flight_sd for parameter in experiment.model_parameters])


class _Fit:
    """Residuals of k flights and their derivatives.

    The unknowns have shape (m + k·q,): the parameters, then each flight's deviations in the q parameters that differ
    between flights.
    """

    def __init__(self, experiment: ModelledExperiment, flights: Sequence[Flight]) -> None:
        self.experiment = experiment
        self.mean = experiment.prior_mean
        self.sd = experiment.prior_sd
        self.lower, self.upper = experiment.limits
        self.flight_sd = _flight_sd(experiment)
        self.own = np.flatnonzero(self.flight_sd)
        self.gains = np.array([experiment.space.vector(flight.gains) for flight in flights])
        self.every = max(round(1.0 / _RATE_HZ / float(experiment.grid_s[1] - experiment.grid_s[0])), 1)
        self.measured = np.array([resample_to_grid(experiment, flight) for flight in flights])[:, :: self.every]
        self.memory = np.zeros(0)
        self.noise = np.full(2, _FIRST_SCALE * experiment.scatter.sd)

    def models(self, unknowns: Vector) -> Matrix:
        """Parameters of each flight: (k, m)."""
        models = np.tile(unknowns[: len(self.mean)], (len(self.gains), 1))
        deviations = unknowns[len(self.mean) :].reshape(len(self.gains), len(self.own))
        models[:, self.own] += deviations * self.flight_sd[self.own]
        return np.asarray(np.clip(models, self.lower, self.upper))

    def start(self) -> Vector:
        """Starting point: the sampled model that fits the first flight best."""
        likely = normal_distribution(self.mean, np.diag(self.sd**2), origin="").sample(self.experiment, _STARTS)
        misses = (self._outputs(np.tile(self.gains[0], (_STARTS, 1)), likely) - self.measured[0]) / self.noise[1]
        cost = np.sum(misses**2, axis=1) + np.sum(((likely - self.mean) / self.sd) ** 2, axis=1)
        return np.concatenate((likely[np.argmin(cost)], np.zeros(len(self.gains) * len(self.own))))

    def minimum(self, start: Vector) -> Vector:
        """Gauss–Newton within the bounds, damped (Levenberg–Marquardt) if residuals decrease less than predicted."""
        others = len(start) - len(self.mean)
        lower = np.concatenate((self.lower, np.full(others, -_WIDEST_OWN)))
        upper = np.concatenate((self.upper, np.full(others, _WIDEST_OWN)))
        scale = np.concatenate((self.sd, np.ones(others)))
        at, damping = np.clip(start, lower, upper), 0.0
        outputs, misses = self._flown(at)
        slopes = self.slopes(at, outputs)
        for _ in range(_MAX_STEPS):
            there, gain = _bounded_step(slopes, misses, at, lower, upper, damping / scale)
            if gain < _LEAST_GAIN:
                break
            outputs, tried = self._flown(there)
            gained = 0.5 * float(misses @ misses - tried @ tried)
            damping = damping / 4.0 if gained > 0.25 * gain else max(4.0 * damping, _DAMPING)
            if gained > 0.0:
                at, misses = there, tried
                slopes = self.slopes(at, outputs)
        return at

    def _flown(self, unknowns: Vector) -> tuple[Matrix, Vector]:
        """Outputs of the models, shape (k, s), and the residuals.

        The residuals are the whitened deviations from the flights, then the deviations of the unknowns from their
        priors.
        """
        outputs, m = self.outputs(unknowns), len(self.mean)
        deviations = self._whitened(outputs - self.measured).ravel()
        return outputs, np.concatenate((deviations, (unknowns[:m] - self.mean) / self.sd, unknowns[m:]))

    def slopes(self, unknowns: Vector, outputs: Matrix) -> Matrix:
        """∂residuals/∂unknowns at the models with these `outputs`, by one-sided differences, all in one call."""
        models = self.models(unknowns)
        k, m = models.shape
        step = np.where(models + _DIFFERENCE * self.sd > self.upper, -_DIFFERENCE, _DIFFERENCE) * self.sd
        moved = (models[:, np.newaxis] + np.eye(m) * step[:, :, np.newaxis]).reshape(-1, m)
        there = self._outputs(np.repeat(self.gains, m, axis=0), moved).reshape(k, m, -1)
        of_model = self._whitened((there - outputs[:, np.newaxis]) / step[:, :, np.newaxis])
        samples, q = of_model.shape[2], len(self.own)
        slopes = np.zeros((k * samples + len(unknowns), len(unknowns)))
        for flight in range(k):
            rows, own = slice(flight * samples, (flight + 1) * samples), m + flight * q
            slopes[rows, :m] = of_model[flight].T
            slopes[rows, own : own + q] = of_model[flight, self.own].T * self.flight_sd[self.own]
        slopes[k * samples :] = np.diag(np.concatenate((1.0 / self.sd, np.ones(k * q))))
        return slopes

    def learn_noise(self, unknowns: Vector) -> None:
        """Fit the autoregression to the residuals (Yule–Walker), with white noise at the assumed floor added."""
        from scipy.linalg import solve_toeplitz

        left = self.outputs(unknowns) - self.measured
        samples = left.shape[1]
        lags = [float(np.sum(left[:, lag:] * left[:, : samples - lag])) / left.size for lag in range(_ORDER + 1)]
        lags[0] += (_NOISE_FLOOR * self.experiment.scatter.sd) ** 2
        self.memory = np.asarray(solve_toeplitz(lags[:-1], lags[1:]))
        self.noise = np.sqrt([lags[0], lags[0] - float(self.memory @ lags[1:])])

    def outputs(self, unknowns: Vector) -> Matrix:
        """Output of each flight's own model, at 10 Hz: (k, s)."""
        return self._outputs(self.gains, self.models(unknowns))

    def _outputs(self, gains: Matrix, models: Matrix) -> Matrix:
        return self.experiment.outputs(gains, models)[:, :: self.every]

    def _whitened(self, deviations: Samples) -> Samples:
        """Innovation of each sample, in its standard deviations; the first few samples are only scaled."""
        order = len(self.memory)
        new = deviations.copy()
        for lag, share in enumerate(self.memory, start=1):
            new[..., order:] -= share * deviations[..., order - lag : deviations.shape[-1] - lag]
        new[..., :order] /= self.noise[0]
        new[..., order:] /= self.noise[1]
        return new


def _bounded_step(
    slopes: Matrix, misses: Vector, at: Vector, lower: Vector, upper: Vector, damping: Vector
) -> tuple[Vector, float]:
    """Minimise the linearised residuals within the bounds, with each change damped by `damping`; vectors of shape (n,).

    Returns the new point, and the predicted decrease of half the sum of squares.
    """
    from scipy.optimize import lsq_linear

    q, r = np.linalg.qr(np.vstack((slopes, np.diag(damping))))
    aim = -q[: len(misses)].T @ misses
    step = lsq_linear(r, aim, (lower - at, upper - at), method="bvls").x
    linear = slopes @ step
    return np.clip(at + step, lower, upper), -float(misses @ linear + 0.5 * linear @ linear)
