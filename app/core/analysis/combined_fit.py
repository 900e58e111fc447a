"""Several flights of one vehicle fitted together, from what is stored of each fit alone.

Each fit is a normal distribution of thrust slope, motor lag and drag that holds what is usual once. What its flight
itself tells is the rest: its precision less the prior's. These are independent, so they add up, and the prior counts
once. What the errors of all flights have in common, by the vehicle's estimator, by what the model lacks, and by the
fit of a short flight, does not average out: it is left out of the sum, and added to the result. The hover throttle
differs from flight to flight with battery and load, and stays beside.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.vehicle_fit import USUAL_DRAG_1_S, USUAL_LAG_S, CopterEstimate
from app.core.records.trajectory import Samples

FITTED: Final = ("hover_throttle", "thrust_slope", "motor_lag_s", "drag_1_s")
"""Of `Copter`, in the order of the arrays here."""
_COMMON: Final = FITTED[1:]
_ALIKE: Final = (0.04, 0.01, 0.06)
"""Standard deviation of slope, lag, s, and drag, 1/s, that fits of short flights of one vehicle have in common: over
simulated vehicles, eight flights each. Under an autopilot whose estimator adds more to the slope, that counts."""
_LEAST_OWN: Final = 0.1
_LARGEST_CONTRADICTION: Final = 0.99


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFit:
    """What a log tells of its vehicle: mean, 4 numbers, and covariance, 4 × 4, by `FITTED`; `usual` are mean and
    standard deviation of the slope, lag and drag over vehicles, and `shared` the standard deviations of the errors that
    all flights of a vehicle have in common."""

    mean: Sequence[float]
    covariance: Sequence[Sequence[float]]
    usual: Sequence[tuple[float, float]]
    shared: Sequence[float]


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
    return LogFit(
        mean=values.mean(axis=0).tolist(),
        covariance=np.cov(values.T).tolist(),
        usual=[_without_negative(*each) for each in (loop.usual_slope, USUAL_LAG_S, USUAL_DRAG_1_S)],
        shared=[max(loop.slope_error, _ALIKE[0]), *_ALIKE[1:]],
    )


def combine(fits: Sequence[LogFit]) -> CombinedFit:
    """Fit logs of one vehicle under one autopilot together; at least one."""
    usual, deviation = np.array(fits[-1].usual).T
    told = [_told(each, usual, deviation) for each in fits]
    precision = np.eye(len(_COMMON)) + np.sum([each for each, _ in told], axis=0)
    covariance = np.linalg.inv(precision)
    mean = covariance @ np.sum([each for _, each in told], axis=0)
    shared = np.square(fits[-1].shared)
    alone = np.min([np.diag(_own(each)) for each in fits], axis=0) + shared
    together = np.diag(covariance) * deviation**2 + shared
    hover = [each.mean[0] for each in fits]
    return CombinedFit(
        mean=_named(usual + deviation * mean),
        deviation=_named(np.sqrt(together)),
        remaining=_named(np.sqrt(together / alone)),
        hover_throttles=hover,
        hover_spread=float(np.std(hover, ddof=1)) if len(hover) > 1 else 0.0,
        contradiction=_contradiction(fits, deviation[0]),
    )


def _told(fit: LogFit, usual: Samples, deviation: Samples) -> tuple[Samples, Samples]:
    """Precision, shape (3, 3), that a flight adds to the prior, and its product with what the flight alone tells, (3,),
    both in deviations of the prior. Of 32 draws the precision may come out below the prior's: such a direction counts
    as not told."""
    covariance = _own(fit)
    variances, directions = np.linalg.eigh(covariance / np.outer(deviation, deviation))
    precision = 1.0 / np.minimum(variances, 1.0)
    apart = directions.T @ ((np.array(fit.mean)[1:] - usual) / deviation)
    told = np.where(precision > 1.0, precision * apart, 0.0)
    return np.asarray(directions * (precision - 1.0) @ directions.T), np.asarray(directions @ told)


def _own(fit: LogFit) -> Samples:
    """Covariance of slope, lag and drag, shape (3, 3), without what all flights have in common, but for a tenth of each
    variance."""
    covariance = np.array(fit.covariance)[1:, 1:]
    variances = np.diag(covariance)
    left = np.sqrt(np.maximum(1.0 - np.square(fit.shared) / variances, _LEAST_OWN))
    return np.asarray(covariance * np.outer(left, left))


def _contradiction(fits: Sequence[LogFit], usual_deviation: float) -> float:
    """How sure it is that the thrust slopes differ: χ² of what each log alone tells of it."""
    from scipy.special import chdtr

    variance = np.array([each.covariance[1][1] for each in fits])
    weight = np.maximum(1.0 / variance - usual_deviation**-2, 1e-6)
    usual = np.array([each.usual[0][0] for each in fits])
    alone = usual + (np.array([each.mean[1] for each in fits]) - usual) / variance / weight
    apart = alone - np.average(alone, weights=weight)
    return float(chdtr(len(fits) - 1, np.sum(weight * apart**2))) if len(fits) > 1 else 0.0


def _named(values: Samples) -> dict[str, float]:
    return dict(zip(_COMMON, values.tolist(), strict=True))


def _without_negative(mean: float, deviation: float) -> tuple[float, float]:
    """Mean and standard deviation of a normal distribution without its negative part."""
    from scipy.special import log_ndtr

    least = -mean / deviation
    excess = np.exp(-0.5 * least**2 - log_ndtr(-least)) / np.sqrt(2.0 * np.pi)
    return mean + deviation * float(excess), deviation * float(np.sqrt(1.0 + least * excess - excess**2))
