"""Fit of the copter model to flights, by regression of the sensed acceleration on throttle and climb rate.

    log(1 + a/g) = s·log u − s·log h − (drag/g)·v + disturbance

The throttle also answers to disturbances, which would bias an ordinary regression: a gust raises the vehicle, and the
loop lowers the throttle. The reference does not answer to them, so the equation is required to hold on average beside
the climb rates and accelerations that follow from it, the instruments (generalised method of moments). How well each of
these averages holds depends on the noise: gusts that decay exponentially beside noise that does not last are an
autoregressive moving average; and where the throttle jumps, nobody knows when between two rows it did. Neither the
noise nor the motors' lag is linear in this equation: each value of a grid is weighed, the noises by their likelihood,
the lags by what they leave that follows the reference, and by what is usual.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop, LoggedFlight
from app.core.analysis.segment import Segment, interpolated
from app.core.models.copter import GRAVITY_M_S2, Copter, filtered, motor_filter, passed
from app.core.records.trajectory import Samples

USUAL_DRAG_1_S: Final = (0.3, 0.3)
USUAL_LAG_S: Final = (0.05, 0.05)
"""Mean and standard deviation over vehicles; that of the slope depends on the autopilot."""

_LAGS_S: Final = np.linspace(0.0, 0.25, 26)
LAG_ROUNDING_S: Final = 0.01 / math.sqrt(12.0)
_OF_JUMP: Final = 1.0 / math.sqrt(6.0)
"""A jump at any time between two rows has a twelfth of its square as variance, and moves both from their middles by
half of it."""
_FREE_FALL: Final = -0.95
_LEAST_THROTTLE: Final = 0.01
_DRAWS: Final = 32
_GENERATOR: Final = (1, 7, 9, 15)
"""Of a lattice of so many points with even margins, whose normal scores correlate least."""
_INSTRUMENT_ROWS: Final = 4
_FEW: Final = 5
_NEGLIGIBLE: Final = -4.0
"""Logarithm of a likelihood beside that of the likeliest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CopterEstimate:
    """What flights tell about the vehicle: means and standard deviations by the names of `Copter`, and equally
    probable copters. `residual_m_s2` is the standard deviation of what the model leaves of the acceleration."""

    mean: Copter
    deviation: Copter
    draws: Sequence[Copter]
    residual_m_s2: float

    @property
    def few(self) -> Sequence[Copter]:
        """The likeliest copter, then some draws that are far from each other."""
        return (self.mean, *self.draws[:_FEW])


@dataclass(frozen=True, slots=True)
class _Noise:
    """Gusts that decay by `decay` from row to row, beside noise that does not last; `smoothing` is from 0, gusts alone,
    to `decay`, noise alone."""

    decay: float
    smoothing: float

    def covariance(self, values: Samples) -> Samples:
        """Covariance of the products of `values`, shape (n, k), with such noise of unit innovations, (k, k)."""
        before = np.vstack([np.zeros(values.shape[1]), values])
        coloured = _filtered(before[::-1], -self.smoothing, -self.decay)
        coloured[-1] /= math.sqrt(1.0 - self.decay**2)
        return np.asarray(coloured.T @ coloured)


def _filtered(values: Samples, before: float, behind: float) -> Samples:
    """Rows, shape (n, …), from nothing through a first-order filter with these shares of the row before."""
    filter_ = np.array([1.0, before]), np.array([1.0, behind])
    columns = [passed(each, *filter_, np.zeros(1)) for each in np.ascontiguousarray(values.reshape(len(values), -1).T)]
    return np.column_stack(columns).reshape(values.shape)


_NOISES: Final = [
    _Noise(decay, share * decay)
    for decay in (0.5, 0.7, 0.8, 0.87, 0.92, 0.96, 0.98)
    for share in (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.87, 0.93, 1.0)
]


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows for one lag: log(1 + a/g), shape (n,), its causes, (n, 3), and orthonormal instruments, (n, m), the same for
    each lag."""

    lag_s: float
    sought: Samples
    causes: Samples
    instruments: Samples

    @property
    def variance(self) -> float:
        """Variance of what two-stage least squares leaves."""
        projection = self.instruments.T
        found, *_ = np.linalg.lstsq(projection @ self.causes, projection @ self.sought, rcond=None)
        rows, causes = self.causes.shape
        return float(np.sum((self.sought - self.causes @ found) ** 2)) / int(rows - causes)

    def whitened(self, noise: _Noise) -> "_Rows":
        """The rows without the correlation of this noise, from the second on: the first is not free of what was before
        it."""
        signals = (self.sought, self.causes, self.instruments)
        sought, causes, instruments = (_filtered(each, -noise.decay, -noise.smoothing)[1:] for each in signals)
        return _Rows(self.lag_s, sought, causes, np.linalg.qr(instruments).Q)

    @property
    def log_likelihood(self) -> float:
        """Logarithm of the restricted likelihood that they are independent."""
        rows, causes = self.causes.shape
        beside = self.instruments.T @ self.causes
        log_determinant = float(np.linalg.slogdet(beside.T @ beside).logabsdet)
        return -0.5 * (int(rows - causes) * math.log(self.variance) + log_determinant)


@dataclass(frozen=True, slots=True)
class _Regression:
    """Result for one lag and noise: mean, shape (3,), and covariance, (3, 3), of slope, −drag/g and −slope·log h, and
    the logarithm of the likelihood."""

    lag_s: float
    mean: Samples
    covariance: Samples
    log_likelihood: float


def fit_copter(*flights: LoggedFlight) -> CopterEstimate:
    """Estimate the copter from all scored rows of its flights under one autopilot, at least one; deterministic."""
    loop = flights[0].loop
    parts = [
        _Part(flight, segment, *flight.loop.excitation(segment, flight.throttle_mean))
        for flight in flights
        for segment in flight.segments
    ]
    candidates = [_rows(parts, lag_s) for lag_s in _LAGS_S.tolist()]
    best = min(candidates, key=lambda each: each.variance)
    jumps = np.concatenate([each.segment.jumps[each.segment.scored] for each in parts])
    regressions = _regressions(candidates, best, jumps, loop)
    log_weight = np.array([each.log_likelihood for each in regressions])
    weight = np.exp(log_weight - log_weight.max())
    values = _draws(regressions, weight / weight.sum())
    return CopterEstimate(
        mean=_copter(values.mean(axis=0)),
        deviation=_copter(np.hypot(values.std(axis=0), [0.0, 0.0, 0.0, LAG_ROUNDING_S])),
        draws=tuple(_copter(row) for row in values),
        residual_m_s2=math.sqrt(best.variance) * GRAVITY_M_S2,
    )


@dataclass(frozen=True, slots=True)
class _Part:
    """A segment of a flight, with the climb rate and acceleration that follow from its reference, shape (n,) each."""

    flight: LoggedFlight
    segment: Segment
    excited_v_m_s: Samples
    excited_a_m_s2: Samples


def _rows(parts: Sequence[_Part], lag_s: float) -> _Rows:
    def rows(signal: Callable[[Segment], Samples]) -> Samples:
        return np.concatenate([signal(each.segment)[each.segment.scored] for each in parts])

    sought = np.log1p(np.maximum(rows(lambda each: each.a_m_s2) / GRAVITY_M_S2, _FREE_FALL))
    ones = np.ones(len(sought))
    sensed = [_sensed_throttle(each.segment, each.flight, lag_s)[each.segment.scored] for each in parts]
    causes = np.column_stack([np.log(np.concatenate(sensed)), rows(lambda each: each.rises_m_s), ones])
    excited = [
        np.column_stack(
            [each.excited_v_m_s, *(_before(each.excited_a_m_s2, rows=back) for back in range(_INSTRUMENT_ROWS))]
        )[each.segment.scored]
        for each in parts
    ]
    instruments = np.column_stack([np.concatenate(excited), ones])
    return _Rows(lag_s, sought, causes, np.linalg.qr(instruments).Q)


def _before(values: Samples, *, rows: int) -> Samples:
    """Values some rows before each, shape (n,); that of the first row before the first."""
    return np.asarray(values[np.maximum(np.arange(len(values)) - rows, 0)])


def _regressions(candidates: Sequence[_Rows], best: _Rows, jumps: Samples, loop: AltitudeLoop) -> list[_Regression]:
    """Of the rows for each lag, in their order, under each noise that is not negligible beside the likeliest. Where the
    throttle jumps, rows with these `jumps`, shape (n,), are less certain."""
    instruments, white = best.instruments, {noise: best.whitened(noise) for noise in _NOISES}
    unseen = (loop.usual_slope[0] * _OF_JUMP * jumps / np.exp(best.causes[:, 0]))[:, None] * instruments
    largest = max(each.log_likelihood for each in white.values())
    likely = []
    for noise, rows in white.items():
        if rows.log_likelihood - largest > _NEGLIGIBLE:
            covariance = rows.variance * noise.covariance(instruments) + unseen.T @ unseen
            root = np.linalg.solve(np.linalg.cholesky(covariance), instruments.T)
            likely.append((root, rows.log_likelihood - largest))
    return [_regress(each, root, loop, log_share) for each in candidates for root, log_share in likely]


def _regress(rows: _Rows, root: Samples, loop: AltitudeLoop, log_share: float) -> _Regression:
    """Least squares of averages that are independent and of variance 1, over rows with the weights `root`, shape
    (m, n), with the usual slope and drag as further observations; `log_share` is the likelihood of the noise, to which
    that of the lag is added."""
    usual_s, deviation_s = USUAL_LAG_S
    usual = np.array([loop.usual_slope[0], -USUAL_DRAG_1_S[0] / GRAVITY_M_S2, 0.0])
    certainty = np.diag([loop.usual_slope[1] ** -2, (USUAL_DRAG_1_S[1] / GRAVITY_M_S2) ** -2, 0.0])
    causes, sought = root @ rows.causes, root @ rows.sought
    covariance = np.asarray(np.linalg.inv(causes.T @ causes + certainty), dtype=np.float64)
    mean = covariance @ (causes.T @ sought + certainty @ usual)
    misfit = float(np.sum((sought - causes @ mean) ** 2)) + ((rows.lag_s - usual_s) / deviation_s) ** 2
    with_hover = np.array([1.0, 0.0, mean[2] / mean[0]])
    covariance += loop.slope_error**2 * np.outer(with_hover, with_hover)
    return _Regression(rows.lag_s, mean, covariance, log_share - 0.5 * misfit)


def _sensed_throttle(segment: Segment, flight: LoggedFlight, lag_s: float) -> Samples:
    """Throttle after the motors' lag and the accelerometer's filter at each row, shape (n,)."""
    step_s = flight.loop.step_s
    steps = interpolated(segment, step_s)
    sensed = filtered(steps.throttle_filtered, motor_filter(lag_s, step_s), flight.loop.accelerometer)
    return np.maximum(np.interp(segment.time_s, steps.time_s, sensed), _LEAST_THROTTLE)


def _draws(regressions: Sequence[_Regression], weight: Samples) -> Samples:
    """Equally probable copters, shape (k, 4): slope, drag, hover throttle, lag. A drag that drives is not drawn."""
    from scipy.special import log_ndtr, ndtri, ndtri_exp

    quantiles = (np.arange(_DRAWS)[:, None] * _GENERATOR % _DRAWS + 0.5) / _DRAWS
    rows = []
    for lag_quantile, *others in quantiles:
        regression = regressions[int(np.searchsorted(np.cumsum(weight), lag_quantile))]
        root, normal = np.linalg.cholesky(regression.covariance), np.asarray(ndtri(others))
        largest = -(regression.mean[1] + root[1, 0] * normal[0]) / root[1, 1]
        normal[1] = ndtri_exp(math.log(others[1]) + log_ndtr(largest))
        slope, drag, constant = regression.mean + root @ normal
        slope = max(slope, 0.2)
        rows.append((slope, max(-drag * GRAVITY_M_S2, 0.0), math.exp(-constant / slope), regression.lag_s))
    return np.array(rows)


def _copter(values: Samples) -> Copter:
    slope, drag_1_s, hover_throttle, lag_s = values.tolist()
    return Copter(hover_throttle=hover_throttle, thrust_slope=slope, motor_lag_s=lag_s, drag_1_s=drag_1_s)
