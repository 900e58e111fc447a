"""Prediction of the same flight with other gains: the model flies the logged reference, with the disturbances found.

Each copter that the flight allows is corrected by what it got wrong in the flight, as in step 4 of the paper's method
(Junell et al. 2016, section II): the difference of sensed and modelled acceleration, and what the estimated climb rate
and altitude changed beyond their own derivatives, at the same time of the flight. So with the gains of the flight every
copter flies nearly what was flown; they differ in what they predict for other gains.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.analysis.disturbances import disturbances_of, in_other_weather, sensor_noise
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.loop import AltitudeLoop, Run
from app.core.analysis.segment import LEAD_S, Segment, Steps, interpolated
from app.core.models.copter import DISTURBANCES, FLOWN, GRAVITY_M_S2, Copter
from app.core.records.trajectory import Samples

_SEED: Final = 1
_QUANTILES: Final = (0.05, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """Predicted error, m, with its 90 % interval for a single flight, and the throttle activity: the standard
    deviation of the demanded throttle about its own 2 Hz low-pass, share of full."""

    error_m: float
    low_m: float
    high_m: float
    activity: float


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
        random = np.random.default_rng(_SEED)
        self._elsewhen = [
            [replace(run, disturbances=in_other_weather(run.disturbances, random)) for run in runs]
            for runs in self._runs
        ]

    def fly(self, loop: AltitudeLoop) -> tuple[float, float]:
        """Error, m, and throttle activity in the weather of the flight, means of the copters."""
        error_m, activity = np.mean([self._flown(runs, loop) for runs in self._runs], axis=0).tolist()
        return error_m, activity

    def predict(self, loop: AltitudeLoop) -> Prediction:
        """Prediction for a single flight: the disturbances of the interval meet the reference at other times."""
        error_m, activity = self.fly(loop)
        elsewhen = np.array([self._flown(runs, loop)[0] for runs in self._elsewhen])
        low_m, high_m = np.quantile(elsewhen + (error_m - elsewhen.mean()), _QUANTILES).tolist()
        return Prediction(error_m=error_m, low_m=max(low_m, 0.0), high_m=high_m, activity=activity)

    def errors(self, loop: AltitudeLoop) -> Samples:
        """Error of each copter in the weather of the flight, m, shape (k,)."""
        return np.array([self._flown(runs, loop)[0] for runs in self._runs])

    def curves(self, loop: AltitudeLoop) -> tuple[Samples, Samples, Samples]:
        """Times of the steps of the first segment, shape (m,), and what each copter flies in the weather of the flight,
        and at another time: altitudes, shape (k, m)."""
        z = FLOWN.index("z_m")
        altitudes, elsewhen = (
            np.array([loop.fly(runs[0])[:, z] for runs in every]) for every in (self._runs, self._elsewhen)
        )
        time_s = self._flight.segments[0].time_s[0] + self._flight.loop.step_s * np.arange(altitudes.shape[1])
        return time_s, altitudes, elsewhen

    def rows(self, loop: AltitudeLoop) -> Samples:
        """What the first copter flies in the weather of the flight, at the rows of the first segment, shape (n, 6) as
        `FLOWN`."""
        time_s = self._flight.segments[0].time_s
        flown = loop.fly(self._runs[0][0])
        place = np.round((time_s - time_s[0]) / self._flight.loop.step_s).astype(np.int64)
        return np.asarray(flown[np.minimum(place, len(flown) - 1)])

    def _as_active(self, runs: Sequence[Run], activity: float) -> list[Run]:
        """The runs with the noise of the sensed acceleration that moves the throttle as much as in the flight."""
        loop = self._flight.loop
        calm, noisy = ([_with_noise(run, loop, deviation) for run in runs] for deviation in (0.0, 1.0))
        without, moved = (self._flown(each, loop)[1] ** 2 for each in (calm, noisy))
        variance = (activity**2 - without) / (moved - without)
        return [_with_noise(run, loop, math.sqrt(max(variance, 0.0))) for run in runs]

    def _flown(self, runs: Sequence[Run], loop: AltitudeLoop) -> tuple[float, float]:
        """Error, m, and throttle activity over all segments."""
        lead = round(LEAD_S / self._flight.loop.step_s)
        deviations, fast = [], []
        for run in runs:
            flown = loop.fly(run)[lead:]
            deviations.append(np.abs(run.reference[lead:, 0] - flown[:, 0]))
            fast.append(flown[:, FLOWN.index("throttle")] - flown[:, FLOWN.index("throttle_slow")])
        return float(np.concatenate(deviations).mean()), float(np.concatenate(fast).std())


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
