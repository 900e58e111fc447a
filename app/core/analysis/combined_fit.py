"""Several flights of one vehicle fitted together, from what is stored of each fit alone.

Each fit is a normal distribution of thrust slope, motor lag and drag that holds what is usual once. What its flight
itself tells is the rest: its precision less the prior's. These are independent, so they add up, and the prior counts
once. Two things do not average out: the error of the slope that the vehicle's estimator causes is left out of the sum
and added to the result, and a part of each deviation is that of errors which the fits of all its flights have in
common. The hover throttle differs from flight to flight with battery and load, and stays beside.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.vehicle_fit import LAG_ROUNDING_S, USUAL_DRAG_1_S, USUAL_LAG_S, CopterEstimate
from app.core.records.trajectory import Samples

FITTED: Final = ("hover_throttle", "thrust_slope", "motor_lag_s", "drag_1_s")
"""Of `Copter`, in the order of the arrays here."""
_COMMON: Final = FITTED[1:]
_IN_COMMON: Final = np.array([0.45, 0.5, 0.7])
"""Share of the deviation of slope, lag and drag that the fits of a vehicle's flights have in common, by what the model
lacks and by how fits of short flights err: over simulated vehicles, eight flights each."""
_BETWEEN_MANOEUVRES: Final = 0.03
"""So far apart are the slopes of one vehicle in quiet flights of different manoeuvres."""
_LEAST_OWN: Final = 0.1
_LARGEST_CONTRADICTION: Final = 0.99
_MOST_OF_USUAL: Final = 0.8
"""Of the variance over vehicles: a log that leaves more of it tells nothing about the slope."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFit:
    """What a log tells of its vehicle: mean, 4 numbers, and covariance, 4 × 4, by `FITTED`; `usual` are mean and
    standard deviation of the slope, lag and drag over vehicles, and `slope_error` is the part of the slope's deviation
    that comes from the vehicle's estimator."""

    mean: Sequence[float]
    covariance: Sequence[Sequence[float]]
    usual: Sequence[tuple[float, float]]
    slope_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CombinedFit:
    """What the logs tell together, by the names of `Copter`: means, standard deviations, and these as a share of the
    least that one log has. `hover_throttles` are those of the logs, with the standard deviation among them.
    `contradiction` is the confidence, 0 … 1, that not one vehicle flew them all: propellers or the thrust curve may
    have changed, and the mean is then that of no vehicle."""

    mean: Mapping[str, float]
    deviation: Mapping[str, float]
    remaining: Mapping[str, float]
    hover_throttles: Sequence[float]
    hover_spread: float
    contradiction: float

    @property
    def is_one_vehicle(self) -> bool:
        """Whether the logs allow that one vehicle flew them all."""
        return self.contradiction < _LARGEST_CONTRADICTION


def log_fit(estimate: CopterEstimate, loop: AltitudeLoop) -> LogFit:
    """What is stored of a fit of one flight under this loop."""
    values = np.array([[getattr(each, name) for name in FITTED] for each in estimate.draws])
    covariance = np.cov(values.T) + np.diag([0.0, 0.0, LAG_ROUNDING_S**2, 0.0])
    return LogFit(
        mean=values.mean(axis=0).tolist(),
        covariance=covariance.tolist(),
        usual=[_without_negative(*each) for each in (loop.usual_slope, USUAL_LAG_S, USUAL_DRAG_1_S)],
        slope_error=loop.slope_error,
    )


def combine(fits: Sequence[LogFit]) -> CombinedFit:
    """Fit logs of one vehicle under one autopilot together; at least one."""
    usual, deviation = np.array(fits[-1].usual).T
    evidence = [_evidence_of(each, usual, deviation) for each in fits]
    precision = np.eye(len(_COMMON)) + np.sum([each for each, _ in evidence], axis=0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ np.sum([each for _, each in evidence], axis=0)
    own = np.array([np.diag(_own(each)) for each in fits])
    in_common = np.average(np.sqrt(own), axis=0, weights=1.0 / own) ** 2
    independent = np.diag(covariance) * deviation**2
    systematic = np.array([fits[-1].slope_error ** 2, 0.0, 0.0])
    alone = own.min(axis=0) + systematic
    together = np.minimum(independent + _IN_COMMON**2 * (in_common - independent) + systematic, alone)
    hover = [each.mean[0] for each in fits]
    return CombinedFit(
        mean=_named(usual + deviation * mean),
        deviation=_named(np.sqrt(together)),
        remaining=_named(np.sqrt(together / alone)),
        hover_throttles=hover,
        hover_spread=float(np.std(hover, ddof=1)) if len(hover) > 1 else 0.0,
        contradiction=_contradiction(fits, deviation[0]),
    )


def _evidence_of(fit: LogFit, usual: Samples, deviation: Samples) -> tuple[Samples, Samples]:
    """Precision, shape (3, 3), that a flight adds to the prior, and its product with what the flight alone tells, (3,),
    both in deviations of the prior. Of 32 draws the precision may come out below the prior's: such a direction counts
    as not told."""
    covariance = _own(fit)
    variances, directions = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    precision = 1.0 / np.minimum(variances, 1.0)
    apart = directions.T @ ((np.array(fit.mean)[1:] - usual) / deviation)
    product = np.where(precision > 1.0, precision * apart, 0.0)
    return np.asarray(directions * (precision - 1.0) @ directions.T), np.asarray(directions @ product)


def _own(fit: LogFit) -> Samples:
    """Covariance of slope, lag and drag, shape (3, 3), without the estimator's part."""
    covariance = np.array(fit.covariance)[1:, 1:]
    covariance[0, 0] -= min(fit.slope_error**2, (1.0 - _LEAST_OWN) * covariance[0, 0])
    return covariance


def _contradiction(fits: Sequence[LogFit], usual_deviation: float) -> float:
    """How sure it is that the thrust slopes differ: χ² of what each log alone tells of it."""
    from scipy.special import chdtr

    variances = ((each, each.covariance[1][1] + _BETWEEN_MANOEUVRES**2) for each in fits)
    tells = [(each, variance) for each, variance in variances if variance < _MOST_OF_USUAL * usual_deviation**2]
    if len(tells) < 2:
        return 0.0
    usual, mean, variance = np.array([(each.usual[0][0], each.mean[1], variance) for each, variance in tells]).T
    weight = 1.0 / variance - usual_deviation**-2
    alone = usual + (mean - usual) / variance / weight
    apart = alone - np.average(alone, weights=weight)
    return float(chdtr(len(tells) - 1, np.sum(weight * apart**2)))


def _named(values: Samples) -> dict[str, float]:
    return dict(zip(_COMMON, values.tolist(), strict=True))


def _without_negative(mean: float, deviation: float) -> tuple[float, float]:
    """Mean and standard deviation of a normal distribution without its negative part."""
    from scipy.special import log_ndtr

    least = -mean / deviation
    excess = np.exp(-0.5 * least**2 - log_ndtr(-least)) / np.sqrt(2.0 * np.pi)
    return mean + deviation * float(excess), deviation * float(np.sqrt(1.0 + least * excess - excess**2))
