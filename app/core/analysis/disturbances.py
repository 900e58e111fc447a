"""What a flight did beyond the model: gusts, noise of the accelerometer, and what the estimator added."""

import math
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.segment import Segment, Steps
from app.core.models.copter import DISTURBANCES, GRAVITY_M_S2, Copter, filtered, motor_filter
from app.core.records.trajectory import Samples

_SEED: Final = 1
_CORRELATIONS: Final = (0.5, 0.98)
_LEAST_VARIANCE: Final = 1e-12
_STRENGTH_DEVIATION: Final = 0.25
"""How well one flight tells the strength of its disturbances, as a deviation of its logarithm: most of the error comes
from what lasts for seconds, of which a flight has few. With this value nine of ten flights of random vehicles lie
within a 90 % interval."""


def disturbances_of(loop: AltitudeLoop, segment: Segment, steps: Steps, copter: Copter) -> Samples:
    """Disturbances at every step, shape (m, 4) as `DISTURBANCES`, with which the copter flies what was flown."""
    accelerometer = loop.accelerometer
    modelled = modelled_acceleration(steps, copter, loop.step_s)
    sensed = np.interp(segment.time_s, steps.time_s, filtered(modelled, accelerometer))
    unmodelled = segment.a_m_s2 - sensed
    gust_at_rows, noise_m_s2 = _separated(unmodelled)
    gust = _at_steps(loop, segment, steps, gust_at_rows)

    def beyond(values: Samples, rates: Samples) -> Samples:
        """Rate at which `values`, at the rows, changed beyond the integral of `rates`, constant between two rows."""
        integral = np.append(0.0, np.cumsum(rates) * loop.step_s)
        at_rows = np.interp(segment.time_s, np.append(steps.time_s, steps.time_s[-1] + loop.step_s), integral)
        row = np.minimum(np.searchsorted(segment.time_s, steps.time_s, side="right") - 1, len(segment.time_s) - 2)
        rate: Samples = ((np.diff(values) - np.diff(at_rows)) / np.diff(segment.time_s))[row]
        return rate

    disturbances = np.empty((len(gust), len(DISTURBANCES)))
    disturbances[:, 0] = gust
    disturbances[:, 1] = beyond(segment.v_m_s, modelled + gust)
    disturbances[:, 2] = beyond(segment.z_m, steps.v_m_s)
    disturbances[:, 3] = sensor_noise(loop, len(gust), noise_m_s2)
    return disturbances


def _at_steps(loop: AltitudeLoop, segment: Segment, steps: Steps, rows: Samples) -> Samples:
    """Acceleration at each step, shape (m,), by that of the rows, (n,): if a row has the mean over the time before it,
    interpolation would take that mean a second time, and half a row late."""
    if loop.row_s is None:
        return np.interp(steps.time_s, segment.time_s, rows)
    following = np.searchsorted(segment.time_s, steps.time_s, side="right")
    return np.asarray(rows[np.minimum(following, len(rows) - 1)])


def sensor_noise(loop: AltitudeLoop, steps: int, deviation_m_s2: float) -> Samples:
    """Noise of the acceleration that the loop controls, shape (steps,)."""
    noise = filtered(np.random.default_rng(_SEED).standard_normal(steps), loop.sensor)
    return np.asarray(deviation_m_s2 * noise / noise.std())


def modelled_acceleration(steps: Steps, copter: Copter, step_s: float) -> Samples:
    """Acceleration of the copter with the throttle and climb rate of the flight, shape (m,)."""
    lagged = filtered(steps.throttle_filtered, motor_filter(copter.motor_lag_s, step_s))
    thrust = (np.maximum(lagged, 0.0) / copter.hover_throttle) ** copter.thrust_slope
    return np.asarray(GRAVITY_M_S2 * (thrust - 1.0) - copter.drag_1_s * steps.v_m_s)


def _separated(unmodelled: Samples) -> tuple[Samples, float]:
    """Gust at each row, and the standard deviation of the noise: the most likely sum of a gust that decays from row to
    row and of noise that does not last (Wiener's smoother)."""
    from scipy.linalg import solve, toeplitz

    mean = float(unmodelled.mean())
    left = unmodelled - mean
    none, one, two = (float(left[back:] @ left[: len(left) - back]) / len(left) for back in range(3))
    if one <= _LEAST_VARIANCE:
        return np.full_like(unmodelled, mean), math.sqrt(none)
    correlation = min(max(two / one, _CORRELATIONS[0]), _CORRELATIONS[1])
    gust_variance = min(one / correlation, none)
    noise_variance = none - gust_variance
    covariance = toeplitz(gust_variance * correlation ** np.arange(len(left)))
    noisy = covariance + (noise_variance + _LEAST_VARIANCE) * np.eye(len(left))
    return mean + covariance @ solve(noisy, left, assume_a="pos"), math.sqrt(noise_variance)


def in_other_weather(disturbances: Samples, random: np.random.Generator) -> Samples:
    """Disturbances of another flight, shape (m, 4), by what this one tells of the weather and the estimator.

    Each frequency, of all of them alike, has another phase and strength, as two stretches of the same random process
    have, and all frequencies together are stronger or weaker.
    """
    spectrum = np.fft.rfft(disturbances, axis=0)
    factor = random.standard_normal((len(spectrum), 2)) @ np.array([1.0, 1.0j]) / math.sqrt(2.0)
    factor[0] = 1.0
    strength = random.lognormal(-0.5 * _STRENGTH_DEVIATION**2, _STRENGTH_DEVIATION)
    return np.asarray(strength * np.fft.irfft(spectrum * factor[:, None], n=len(disturbances), axis=0))
