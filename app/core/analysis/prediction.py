"""Prediction of the same flight with other gains: the model flies the logged reference, with the disturbances found.

Each copter that the flight allows is corrected by what it got wrong in the flight, as in step 4 of the paper's method
(Junell et al. 2016, section II): the difference of sensed and modelled acceleration, and what the estimated climb rate
and altitude changed beyond their own derivatives, at the same time of the flight. So with the gains of the flight every
copter flies nearly what was flown; they differ in what they predict for other gains.

The disturbances are gusts, noise of the accelerometer, and what the estimator added. The climb rate is the integral of
the acceleration, whatever the rows of a log show of it: what it changed from row to row beyond the model is the gust,
and what the accelerometer sensed beside that has no mean over a row.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop, LoggedFlight, Run
from app.core.analysis.segment import LEAD_S, Segment, Steps, interpolated
from app.core.models.copter import DISTURBANCES, FLOWN, GRAVITY_M_S2, Copter, filtered, motor_filter
from app.core.records.trajectory import Samples

_SEED: Final = 1
_ROW_S: Final = 0.1
_QUANTILES: Final = (0.05, 0.95)
STRENGTH_DEVIATION: Final = 0.25
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


def in_other_weather(
    disturbances: Samples, random: np.random.Generator, *, strength_deviation: float = STRENGTH_DEVIATION
) -> Samples:
    """Disturbances of another flight, shape (m, 3), by what this one tells of the weather and the estimator.

    Each frequency, of all of them alike, has another phase and strength, as two stretches of the same random process
    have, and all frequencies together are stronger or weaker, by this deviation of the logarithm.
    """
    spectrum = np.fft.rfft(disturbances, axis=0)
    factor = random.standard_normal((len(spectrum), 2)).view(np.complex128)[:, 0] / math.sqrt(2.0)
    factor[0] = 1.0
    strength = random.lognormal(-0.5 * strength_deviation**2, strength_deviation)
    return np.asarray(strength * np.fft.irfft(spectrum * factor[:, None], n=len(disturbances), axis=0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Predicted error, m, with its 90 % interval for a single flight, and the throttle activity: the standard
    deviation of the demanded throttle about its own 2 Hz low-pass, share of full."""

    error_m: float
    low_m: float
    high_m: float
    activity: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictedCurve:
    """A prediction with what is behind it: error of each copter, m, shape (k,); times of the loop's steps in the first
    segment, s, (m,), and the altitudes of each copter then, in the weather of the flight and at another time, (k, m).
    """

    prediction: Prediction
    errors_m: Samples
    time_s: Samples
    altitudes_m: Samples
    elsewhen_m: Samples


@dataclass(frozen=True, slots=True)
class _Flown:
    """Error, m, and throttle activity of a copter over all segments, and its altitude in the first one, shape (m,)."""

    score: tuple[float, float]
    altitude_m: Samples


class FlightModel:
    """A flight and the copters that it allows; predicts it with other gains."""

    def __init__(self, flight: LoggedFlight, copters: Sequence[Copter]) -> None:
        self._flight = flight
        steps = [interpolated(each, flight.loop.step_s) for each in flight.segments]
        self._runs = [
            [_run(flight.loop, segment, each, copter) for segment, each in zip(flight.segments, steps, strict=True)]
            for copter in copters
        ]
        if flight.activity is not None:
            self._runs = [self._as_active(runs, flight.activity) for runs in self._runs]

    def fly(self, loop: AltitudeLoop) -> tuple[float, float]:
        """Error, m, and throttle activity in the weather of the flight, means of the copters."""
        return _means([self._flown(runs, loop).score for runs in self._runs])

    def predict(self, loop: AltitudeLoop) -> Prediction:
        """Prediction for a single flight: the disturbances of the interval meet the reference at other times."""
        return _prediction(
            *([self._flown(runs, loop).score for runs in every] for every in (self._runs, self._elsewhen()))
        )

    def predict_curve(self, loop: AltitudeLoop) -> PredictedCurve:
        """The same, with what each copter flies."""
        now, then = ([self._flown(runs, loop) for runs in every] for every in (self._runs, self._elsewhen()))
        altitudes = np.array([each.altitude_m for each in now])
        begin_s, step_s = self._flight.segments[0].time_s[0], self._flight.loop.step_s
        return PredictedCurve(
            prediction=_prediction([each.score for each in now], [each.score for each in then]),
            errors_m=np.array([each.score[0] for each in now]),
            time_s=begin_s + step_s * np.arange(altitudes.shape[1]),
            altitudes_m=altitudes,
            elsewhen_m=np.array([each.altitude_m for each in then]),
        )

    def errors_m(self, *loops: AltitudeLoop) -> tuple[Samples, Samples]:
        """Error of each copter under each loop, m, shape (loops, k): in the weather of the flight, and in weather as
        strong at another time."""
        now, then = (
            np.array([[self._flown(runs, loop).score[0] for loop in loops] for runs in every]).T
            for every in (self._runs, self._elsewhen(strength_deviation=0.0))
        )
        return now, then

    def still_m(self, *loops: AltitudeLoop) -> Samples:
        """Mean error of the copters under each loop, m, shape (loops,), without disturbances: by the manoeuvre."""
        every = [[replace(run, disturbances=np.zeros_like(run.disturbances)) for run in runs] for runs in self._runs]
        return np.array([_means([self._flown(runs, loop).score for runs in every])[0] for loop in loops])

    def rows(self, loop: AltitudeLoop) -> Samples:
        """What the first copter flies in the weather of the flight, at the rows of the first segment, shape (n, 6) as
        `FLOWN`."""
        time_s = self._flight.segments[0].time_s
        flown = loop.fly(self._runs[0][0])
        place = np.round((time_s - time_s[0]) / self._flight.loop.step_s).astype(np.int64)
        return np.asarray(flown[np.minimum(place, len(flown) - 1)])

    def _elsewhen(self, *, strength_deviation: float = STRENGTH_DEVIATION) -> Iterator[list[Run]]:
        """The runs at another time, the same at every call: kept, they would be most of what an analysis keeps."""
        random = np.random.default_rng(_SEED)
        other = partial(in_other_weather, random=random, strength_deviation=strength_deviation)
        for runs in self._runs:
            yield [replace(run, disturbances=other(run.disturbances)) for run in runs]

    def _as_active(self, runs: Sequence[Run], activity: float) -> list[Run]:
        """The runs with the noise of the sensed acceleration that moves the throttle as much as in the flight."""
        loop = self._flight.loop
        calm, noisy = ([_with_noise(run, loop, deviation) for run in runs] for deviation in (0.0, 1.0))
        without, moved = (self._flown(each, loop).score[1] ** 2 for each in (calm, noisy))
        variance = (activity**2 - without) / (moved - without)
        return [_with_noise(run, loop, math.sqrt(max(variance, 0.0))) for run in runs]

    def _flown(self, runs: Sequence[Run], loop: AltitudeLoop) -> _Flown:
        """What a copter flies in all segments."""
        lead = round(LEAD_S / self._flight.loop.step_s)
        deviations, fast, altitudes = [], [], []
        for run in runs:
            whole = loop.fly(run)
            altitudes.append(whole[:, FLOWN.index("z_m")].copy())
            flown = whole[lead:]
            deviations.append(np.abs(run.reference[lead:, 0] - flown[:, 0]))
            fast.append(flown[:, FLOWN.index("throttle")] - flown[:, FLOWN.index("throttle_slow")])
        return _Flown((float(np.concatenate(deviations).mean()), float(np.concatenate(fast).std())), altitudes[0])


def _means(scores: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Mean error, m, and throttle activity of copters."""
    error_m, activity = np.mean(scores, axis=0).tolist()
    return error_m, activity


def _prediction(now: Sequence[tuple[float, float]], then: Sequence[tuple[float, float]]) -> Prediction:
    """Of error, m, and throttle activity of each copter in the weather of the flight and at another time."""
    error_m, activity = _means(now)
    elsewhen = np.array(then)[:, 0]
    low_m, high_m = np.quantile(elsewhen + (error_m - elsewhen.mean()), _QUANTILES).tolist()
    return Prediction(error_m=error_m, low_m=max(low_m, 0.0), high_m=high_m, activity=activity)


def _with_noise(run: Run, loop: AltitudeLoop, deviation_m_s2: float) -> Run:
    """The run with noise of this standard deviation in the sensed acceleration."""
    disturbances = run.disturbances.copy()
    disturbances[:, DISTURBANCES.index("sensed_m_s2")] = sensor_noise(loop, len(disturbances), deviation_m_s2)
    return replace(run, disturbances=disturbances)


def _run(loop: AltitudeLoop, segment: Segment, steps: Steps, copter: Copter) -> Run:
    """The start is the altitude of the flight, and the loop's own climb rate and acceleration, with the throttle for
    them in the wind of the first seconds."""
    disturbances = disturbances_of(loop, segment, steps, copter)
    v, a = loop.start(steps)
    gust = float(disturbances[: round(LEAD_S / loop.step_s), 0].mean())
    lift = max(1.0 + (a + copter.drag_1_s * v - gust) / GRAVITY_M_S2, 0.0)
    return Run(
        copter=loop.packed(copter),
        reference=steps.reference,
        disturbances=disturbances,
        start=(copter.hover_throttle * lift ** (1.0 / copter.thrust_slope), float(segment.z_m[0]), v, a),
    )
