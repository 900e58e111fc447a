"""What a flight did beyond the model: gusts, noise of the accelerometer, and what the estimator added.

The climb rate is the integral of the acceleration, whatever the rows of a log show of it: what it changed from row to
row beyond the model is the gust, and what the accelerometer sensed beside that has no mean over a row.
"""

import math
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.segment import Segment, Steps
from app.core.models.copter import DISTURBANCES, GRAVITY_M_S2, Copter, filtered, motor_filter
from app.core.records.trajectory import Samples

_SEED: Final = 1
_ROW_S: Final = 0.1
_STRENGTH_DEVIATION: Final = 0.25
"""How well one flight tells the strength of its disturbances, as a deviation of its logarithm: most of the error comes
from what lasts for seconds, of which a flight has few. With this value nine of ten flights of random vehicles lie
within a 90 % interval."""


def disturbances_of(loop: AltitudeLoop, segment: Segment, steps: Steps, copter: Copter) -> Samples:
    """Disturbances at every step, shape (m, 3) as `DISTURBANCES`, with which the copter flies what was flown."""

    def beyond(values: Samples, rates: Samples) -> Samples:
        """Rate at which `values`, at the rows, changed beyond the integral of `rates`, constant between two rows."""
        integral = np.append(0.0, np.cumsum(rates) * loop.step_s)
        at_rows = np.interp(segment.time_s, np.append(steps.time_s, steps.time_s[-1] + loop.step_s), integral)
        row = np.minimum(np.searchsorted(segment.time_s, steps.time_s, side="right") - 1, len(segment.time_s) - 2)
        rate: Samples = ((np.diff(values) - np.diff(at_rows)) / np.diff(segment.time_s))[row]
        return rate

    modelled = modelled_acceleration(steps, copter, loop.step_s)
    gust = beyond(segment.v_m_s, modelled)
    sensed = np.interp(segment.time_s, steps.time_s, filtered(modelled + gust, loop.accelerometer))
    disturbances = np.empty((len(gust), len(DISTURBANCES)))
    disturbances[:, 0] = gust
    disturbances[:, 1] = beyond(segment.z_m, steps.v_m_s)
    disturbances[:, 2] = sensor_noise(loop, len(gust), float(np.std(segment.a_m_s2 - sensed)))
    return disturbances


def sensor_noise(loop: AltitudeLoop, steps: int, deviation_m_s2: float) -> Samples:
    """Noise of the acceleration that the loop controls, without a mean over any row, shape (steps,)."""
    noise = filtered(np.random.default_rng(_SEED).standard_normal(steps), loop.sensor)
    row = np.arange(steps) // round(_ROW_S / loop.step_s)
    noise -= (np.bincount(row, noise) / np.bincount(row))[row]
    return np.asarray(deviation_m_s2 * noise / noise.std())


def modelled_acceleration(steps: Steps, copter: Copter, step_s: float) -> Samples:
    """Acceleration of the copter with the throttle and climb rate of the flight, shape (m,)."""
    lagged = filtered(steps.throttle_filtered, motor_filter(copter.motor_lag_s, step_s))
    thrust = (np.maximum(lagged, 0.0) / copter.hover_throttle) ** copter.thrust_slope
    return np.asarray(GRAVITY_M_S2 * (thrust - 1.0) - copter.drag_1_s * steps.v_m_s)


def in_other_weather(disturbances: Samples, random: np.random.Generator) -> Samples:
    """Disturbances of another flight, shape (m, 3), by what this one tells of the weather and the estimator.

    Each frequency, of all of them alike, has another phase and strength, as two stretches of the same random process
    have, and all frequencies together are stronger or weaker.
    """
    spectrum = np.fft.rfft(disturbances, axis=0)
    factor = random.standard_normal((len(spectrum), 2)) @ np.array([1.0, 1.0j]) / math.sqrt(2.0)
    factor[0] = 1.0
    strength = random.lognormal(-0.5 * _STRENGTH_DEVIATION**2, _STRENGTH_DEVIATION)
    return np.asarray(strength * np.fft.irfft(spectrum * factor[:, None], n=len(disturbances), axis=0))
