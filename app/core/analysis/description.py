"""What any flight tells without a model of its loop: how long it held its altitude, the throttle in hover, how far it
was from its reference, whether its altitude oscillated, and how often the throttle was at a limit.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.records.trajectory import Samples

LONGEST_GAP_S: Final = 1.0
_AT_REST: Final = (0.3, 0.3)
"""Climb rate, m/s, and its change within a second, below which the throttle is that of hover."""
_LEAST_ROWS: Final = 5
_OFF_GROUND_M: Final = 0.5
_NEAR_LIMIT: Final = 1e-3
_SHORTEST_S: Final = 8.0
_SLOWEST_HZ: Final = 0.2
LEAST_PERIODS: Final = 5.0
_SMOOTHED_PERIODS: Final = 3.0
_STRONG: Final = 0.95
"""Quantile of the envelope: its largest values may be those of a takeoff or of the first step."""
_ABOVE_NOISE: Final = 40.0
"""Power of a line over the median beside it. Of noise alone, the largest of 500 lines has about nine times that."""
_BESIDE: Final = 31
_COMMANDED: Final = 0.25
"""A line of the reference with this share of that of the deviation is its cause: a late vehicle deviates by up to twice
it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightSignals:
    """Signals of a whole recording, up, shape (n,) each, NaN where one is not known; `time_s` increases. The vehicle is
    in the air in the rows `flown`, and follows an altitude by itself in those of them that are `held`. The acceleration
    is as sensed, without gravity; `assumed_hover` is the parameter for the throttle in hover, None if not known."""

    time_s: Samples
    altitude_m: Samples
    climb_rate_m_s: Samples
    reference_m: Samples
    throttle: Samples
    flown: NDArray[np.bool_]
    held: NDArray[np.bool_]
    sensed_m_s2: Samples
    assumed_hover: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Oscillation:
    """A line in the spectrum of the deviation: its frequency, the mean amplitude since it began, and when that was, s
    of the recording."""

    frequency_hz: float
    amplitude_m: float
    since_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """A flight as it was flown; None for what it does not tell.

    The hover throttle is the median at rest, with its standard deviation; the deviation is the distance of altitude and
    reference where the altitude was held, and the saturated share that of its rows with the throttle at a limit. An
    oscillation is searched for in the longest part with the altitude held; for 0 s in none that is long enough.
    """

    flown_s: float
    held_s: float
    altitude_range_m: float
    hover_throttle: float | None
    hover_throttle_deviation: float | None
    deviation_mean_m: float | None
    deviation_largest_m: float | None
    saturated_share: float | None
    searched_s: float
    oscillation: Oscillation | None


def describe(signals: FlightSignals, limits: tuple[float, float] = (0.0, 1.0)) -> Description | None:
    """The description of a flight whose loop has these limits of the throttle; None if nothing flew."""
    time_s, flown = signals.time_s, signals.flown & np.isfinite(signals.altitude_m)
    seconds = np.minimum(np.diff(time_s, append=time_s[-1:]), LONGEST_GAP_S)
    if not seconds[flown].sum() > 0.0:
        return None
    held = flown & signals.held
    part = _longest(time_s, held & np.isfinite(signals.reference_m))
    rest = _throttle_at_rest(signals, flown)
    away_m = np.abs(signals.reference_m - signals.altitude_m)[held]
    away_m = away_m[np.isfinite(away_m)]
    throttle = signals.throttle[held & np.isfinite(signals.throttle)]
    least, most = limits
    at_limit = (throttle <= least + _NEAR_LIMIT) | (throttle >= most - _NEAR_LIMIT)
    return Description(
        flown_s=float(seconds[flown].sum()),
        held_s=float(seconds[held].sum()),
        altitude_range_m=float(np.ptp(signals.altitude_m[flown])),
        hover_throttle=float(np.median(rest)) if rest.size >= _LEAST_ROWS else None,
        hover_throttle_deviation=float(np.std(rest)) if rest.size >= _LEAST_ROWS else None,
        deviation_mean_m=float(away_m.mean()) if away_m.size else None,
        deviation_largest_m=float(away_m.max()) if away_m.size else None,
        saturated_share=float(at_limit.mean()) if throttle.size else None,
        searched_s=float(time_s[part[-1]] - time_s[part[0]]) if part.size else 0.0,
        oscillation=_oscillation_in(signals, part) if part.size else None,
    )


def _throttle_at_rest(signals: FlightSignals, flown: NDArray[np.bool_]) -> Samples:
    slow_m_s, steady_m_s = _AT_REST
    known = np.isfinite(signals.climb_rate_m_s)
    if not known.any():
        return np.empty(0)
    at_s, rates = signals.time_s[known], signals.climb_rate_m_s[known]
    before, after = (np.interp(signals.time_s + side_s, at_s, rates) for side_s in (-0.5, 0.5))
    height_m = signals.altitude_m - signals.altitude_m[flown].min()
    off_ground = signals.flown.all() | (height_m > min(_OFF_GROUND_M, 0.5 * float(height_m[flown].max())))
    is_steady = (np.abs(signals.climb_rate_m_s) < slow_m_s) & (np.abs(after - before) < steady_m_s)
    return np.asarray(signals.throttle[flown & off_ground & is_steady & np.isfinite(signals.throttle)])


def _longest(time_s: Samples, rows: NDArray[np.bool_]) -> NDArray[np.int64]:
    """The longest part of these rows without a gap, if it is long enough for a spectrum; else none."""
    places = np.flatnonzero(rows)
    parts = np.split(places, np.flatnonzero((np.diff(places) > 1) | (np.diff(time_s[places]) > LONGEST_GAP_S)) + 1)
    part = max(parts, key=len)
    is_long = len(part) >= _BESIDE and time_s[part[-1]] - time_s[part[0]] >= _SHORTEST_S
    return part if is_long else part[:0]


def _oscillation_in(signals: FlightSignals, part: NDArray[np.int64]) -> Oscillation | None:
    at_s = signals.time_s[part]
    time_s = np.arange(at_s[0], at_s[-1], np.median(np.diff(at_s)))
    reference_m, altitude_m = (
        np.interp(time_s, at_s, each[part]) for each in (signals.reference_m, signals.altitude_m)
    )
    return find_oscillation(time_s, altitude_m - reference_m, reference_m)


def find_oscillation(time_s: Samples, deviation_m: Samples, reference_m: Samples) -> Oscillation | None:
    """The strongest line in the spectrum of a deviation at even times, shape (n,) each, that stands out of the noise
    beside it, lasts for some periods, and is not one of the reference; None if there is none.

    The spectrum is that of the rate, in which gusts and the ends of altitude changes are about even.
    """
    from scipy.ndimage import median_filter, uniform_filter1d

    step_s, window = float(time_s[1] - time_s[0]), np.hanning(len(time_s))
    frequency_hz = np.fft.rfftfreq(len(time_s), step_s)
    spectra = [np.abs(np.fft.rfft(window * _detrended(time_s, each))) for each in (deviation_m, reference_m)]
    power = (frequency_hz * spectra[0]) ** 2
    counted = frequency_hz >= max(_SLOWEST_HZ, LEAST_PERIODS / (time_s[-1] - time_s[0]))
    above = np.where(counted, power / np.maximum(median_filter(power, _BESIDE), np.finfo(float).tiny), 0.0)
    line = int(np.argmax(above[:-1]))
    if above[line] < _ABOVE_NOISE or spectra[1][line] >= _COMMANDED * spectra[0][line]:
        return None
    left, middle, right = np.log(spectra[0][line - 1 : line + 2])
    at_hz = float(frequency_hz[line] + frequency_hz[1] * 0.5 * (left - right) / (left - 2.0 * middle + right))
    turned = _detrended(time_s, deviation_m) * np.exp(-2j * np.pi * at_hz * time_s)
    envelope_m = 2.0 * np.abs(uniform_filter1d(turned, max(round(_SMOOTHED_PERIODS / at_hz / step_s), 1)))
    oscillates = np.flatnonzero(envelope_m > 0.5 * np.quantile(envelope_m, _STRONG))
    if len(oscillates) * step_s * at_hz < LEAST_PERIODS:
        return None
    amplitude_m = float(np.median(envelope_m[oscillates]))
    return Oscillation(frequency_hz=at_hz, amplitude_m=amplitude_m, since_s=float(time_s[oscillates[0]]))


def _detrended(time_s: Samples, values: Samples) -> Samples:
    """Values less the straight line through them, shape (n,)."""
    return np.asarray(values - np.polynomial.Polynomial.fit(time_s, values, 1)(time_s))
