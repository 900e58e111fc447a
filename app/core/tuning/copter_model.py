"""The model of a vehicle under ArduCopter or PX4, fitted to a campaign's altitude steps: a flight is a log.

The vehicle comes from a regression over all fitted flights (`app.core.analysis.vehicle_fit`). Predictions fly the
autopilot's replica along the reference of the best flight, with the disturbances that this flight had
(`app.core.analysis.prediction`). Gains are searched as for a log (`app.core.analysis.proposal`): the least error that
keeps the margin from ringing, and moves the throttle at most 1.5 times as much as the gains of the first flight.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final, Generic, TypeVar

import numpy as np

from app.core.analysis.analysis import find_unexplained, is_alike
from app.core.analysis.loop import AltitudeLoop, GainSpace, LinearLoop, LoggedFlight
from app.core.analysis.margin import (
    EXTRA_LAG_S,
    LARGEST_MARGIN,
    REQUIRED_MARGIN,
    RINGING_DAMPING,
    gain_margin,
    robust_damping,
)
from app.core.analysis.prediction import FlightModel, Prediction
from app.core.analysis.proposal import LARGEST_ACTIVITY, search
from app.core.analysis.vehicle_fit import CopterEstimate, fit_copter
from app.core.definition import Flight, Interval, best_flight
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.experiments.base import (
    FittedParameter,
    Matrix,
    ParameterDistribution,
    fitted_parameters,
    normal_distribution,
)
from app.core.experiments.copter_steps import COPTERS, CopterSteps, copter_of, vector_of
from app.core.formatting import count, short
from app.core.models.copter import Copter
from app.core.policy import Box, PolicySpace, Vector
from app.core.tuning.calibration import fitted_flights
from app.core.tuning.predictions import FlightPrediction, interval_reach
from app.core.tuning.strategy import positive_interval, with_band

_V = TypeVar("_V")

_DIGITS: Final = 3
_MODEL_ERROR: Final = 0.04
"""Relative error of even the best fit: without it, 75 % of the flights of random vehicles under PX4 were inside their
90 % interval."""


class LimitedModel(ABC, Generic[_V]):
    """What models of a campaign share whose gains are limited by more than the error: altitude steps. The error alone
    drives the gains to their bounds. So the throttle may move little more than with the gains of the first flight, and
    no likely vehicle may ring (`app.core.analysis.proposal`).

    Gains have shape (n,). `base` is the best flight, `first_gains` are those of the first one."""

    least_improvement: Final = 0.05
    base: Flight
    first_gains: Vector
    policy_space: PolicySpace

    def _limit_by(self, space: PolicySpace, flights: Sequence[Flight]) -> None:
        """The gains, and the first of the flights that are valid."""
        first = next(flight for flight in flights if flight.outcome == "valid")
        self.policy_space, self.first_gains = space, space.vector(first.gains)

    @property
    @abstractmethod
    def vehicles(self) -> Sequence[_V]:
        """Those of the gate, for which gains are searched: the likeliest one first."""

    @abstractmethod
    def loop(self, gains: Vector) -> LinearLoop[_V]:
        """The loop with these gains."""

    @abstractmethod
    def flown(self, gains: Vector) -> tuple[float, float]:
        """Predicted error, m, and throttle activity of the likeliest vehicle, in the weather of the best flight."""

    def merits(self, gains: Matrix) -> Vector:
        """Errors of many gain sets: (c, n) → (c,)."""
        return np.array([self.flown(each)[0] for each in gains])

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        """Whether a step pays, or leaves gains that ring."""
        now, then = self.merits(np.stack((here, there))).tolist()
        before, after = (robust_damping(self.loop(gains), self.vehicles) for gains in (here, there))
        return bool(then <= (1.0 - self.least_improvement) * now) or before < RINGING_DAMPING <= after

    def found(self, space: GainSpace, starts: Sequence[Mapping[str, float]]) -> Vector | None:
        """The best allowed gains of the space, of which those that it lacks are the best flight's; None if there are
        none."""

        def whole(gains: Mapping[str, float]) -> Vector:
            return self.policy_space.vector({**self.base.gains, **gains})

        gains = search(
            space,
            [self.base.gains, *starts],
            self.policy_space.mapping(self.first_gains),
            fly=lambda gains: self.flown(whole(gains)),
            loop_of=lambda gains: self.loop(whole(gains)),
            vehicles=self.vehicles,
        )
        return None if gains is None else whole(gains)

    def limits(self, gains: Vector) -> tuple[str, str]:
        """Sentences about throttle activity and margin."""
        loop = self.loop(gains)
        activity = self.flown(gains)[1] / self.flown(self.first_gains)[1]
        margin = gain_margin(loop, self.vehicles[0])
        beyond = "at least " if margin == LARGEST_MARGIN else ""
        moves = (
            f"The throttle moves {activity:.2f} times as much as with the gains of the first flight; "
            f"{LARGEST_ACTIVITY:g} times is allowed."
        )
        rings = (
            f"With {1e3 * EXTRA_LAG_S:.0f} ms more {loop.texts.lateness}, the altitude begins to ring with {beyond}"
            f"{margin:.1f} times the {loop.texts.fast_gains}; {REQUIRED_MARGIN:g} times is required."
        )
        return moves, rings


class CopterModel(LimitedModel[Copter]):
    """The copters that the flights allow, and what they predict."""

    def __init__(self, experiment: CopterSteps, flights: Sequence[Flight]) -> None:
        """`experiment` has the autopilot's parameters of the last flight.

        Raises TrajectoryError naming the flight whose record does not suffice, or whose autopilot had a parameter
        with which its replica does not hold."""
        used = fitted_flights(flights)
        self.base = best_flight(used)
        self.numbers: Final = tuple(flight.number for flight in used)
        self._logs: Final = {flight.number: _read(experiment, flight) for flight in used}
        self._log: Final = self._logs[self.base.number]
        self._experiment: Final = experiment.exactly_under(self.base.parameters)
        self._estimate: Final[CopterEstimate] = fit_copter(*self._logs.values(), for_campaign=True)
        if (why := find_unexplained(self._estimate)) is not None:
            worst = max(self.numbers, key=lambda number: fit_copter(self._logs[number]).residual_m_s2)
            raise _unlike(worst, why.text)
        self._hover: Final = experiment.advise_hover(self._estimate.mean.hover_throttle)
        self._limit_by(experiment.space, flights)

    @cached_property
    def _values(self) -> Matrix:
        """Parameters of the copters that the flights allow, shape (k, 4)."""
        return np.array([vector_of(copter) for copter in self._estimate.draws])

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(self._log.loop.space.bounds)

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        parameters = self._experiment.model_parameters
        return fitted_parameters(
            parameters, self._values.mean(axis=0), np.diag(vector_of(self._estimate.deviation) ** 2)
        )

    @cached_property
    def spread(self) -> ParameterDistribution:
        beyond = vector_of(self._estimate.deviation) ** 2 - self._values.var(axis=0)
        covariance = np.cov(self._values.T, bias=True) + np.diag(np.maximum(beyond, 0.0))
        origin = f"the fit to {count(len(self.numbers), 'flight')}"
        return normal_distribution(self._values.mean(axis=0), covariance, origin)

    @cached_property
    def vehicles(self) -> Sequence[Copter]:
        return [copter_of(model) for model in self.spread.sample(self._experiment, COPTERS)]

    @cached_property
    def _likeliest(self) -> FlightModel:
        return FlightModel(self._log, self.vehicles[:1])

    @cached_property
    def _all(self) -> FlightModel:
        return FlightModel(self._log, self._estimate.draws)

    def loop(self, gains: Vector) -> AltitudeLoop:
        return self._experiment.loop(gains)

    def flown(self, gains: Vector) -> tuple[float, float]:
        return self._likeliest.fly(self.loop(gains))

    def optimum(self, box: Box) -> Vector | None:
        """The best gains within the box that the limits allow; None if they allow none there. Raises TrajectoryError if
        the model does not fly as the best flight did."""
        flown_m, modelled_m = self._log.error_m, self._likeliest.fly(self._log.loop)[0]
        if not is_alike(flown_m, modelled_m):
            raise _unlike(
                self.base.number,
                f"deviates by {1e3 * flown_m:.1f} mm, where its gains make the fitted vehicle deviate by "
                f"{1e3 * modelled_m:.1f} mm: it flew with other gains or parameters",
            )
        here = space_within(self._log.loop.space, self._experiment, box)
        rules = self._log.loop.rules(self._log.throttle_mean)
        return self.found(here, list(rules.values()))

    def errors(self, gains: Matrix) -> Vector:
        return self.merits(gains)

    def rounded(self, gains: Vector) -> Vector:
        return np.array([float(f"{value:.{_DIGITS}g}") for value in gains])

    def predict(self, gains: Vector) -> FlightPrediction:
        experiment, loop = self._experiment, self.loop(gains)
        predicted = self._all.predict_curve(loop)
        grid_s = experiment.grid_s
        followed = experiment.followed_m
        after = grid_s >= predicted.time_s[0]
        reach = interval_reach() * predicted.elsewhen_m.std(axis=0)
        curve, low, high = (followed.copy() for _ in range(3))
        mean = predicted.altitudes_m.mean(axis=0)
        for whole, part in ((curve, mean), (low, mean - reach), (high, mean + reach)):
            whole[after] = np.interp(grid_s[after], predicted.time_s, part)
        return FlightPrediction(
            trajectory=with_band(experiment, curve, low, high),
            error=predicted.prediction.error_m,
            interval=_interval(predicted.prediction),
            models=self._values,
            errors=predicted.errors_m,
        )

    def notes(self, gains: Vector) -> tuple[str, ...]:
        """The hover throttle to set, the limits, and what the likeliest vehicle would fly with the sets that are set
        without a model. Those are as good that are not above the interval of `gains`: no flight would tell them
        apart."""
        hover = () if self._hover is None else (self._hover.reason,)
        as_good_m = _interval(self._all.predict(self.loop(gains))).upper
        found = [self._rule_note(*rule, as_good_m=as_good_m) for rule in self._rules]
        return (*hover, *self.limits(gains), f"For comparison, the model predicts {'; '.join(found)}.")

    def _rule_note(self, name: str, error_m: float, margin: float, *, as_good_m: float) -> str:
        remark = ", which is predicted as good" if error_m <= as_good_m else ""
        remark = ", which lacks the margin" if margin < REQUIRED_MARGIN else remark
        return f"{short(error_m)} {self._experiment.error_unit} with {name.removeprefix('For comparison: ')}{remark}"

    @cached_property
    def _rules(self) -> Sequence[tuple[str, float, float]]:
        """Name, predicted error and margin of each of these sets."""
        rules = self._log.loop.rules(self._log.throttle_mean)
        loops = {name: self._log.loop.with_gains(gains) for name, gains in rules.items()}
        return [
            (name, self._likeliest.fly(loop)[0], gain_margin(loop, self.vehicles[0])) for name, loop in loops.items()
        ]


def _unlike(number: int, reason: str) -> TrajectoryError:
    return TrajectoryError(
        f"Flight {number} cannot be modelled.",
        hint=f"Mark flight {number} invalid, and fly again with the gains of the campaign in weaker wind.",
        problems=(Problem("trajectory", f"The flight {reason}."),),
    )


def _interval(predicted: Prediction) -> Interval:
    """The interval of a flight in other weather, wider by the model's own error."""
    reach = interval_reach() * _MODEL_ERROR * predicted.error_m
    below, above = (np.hypot(end - predicted.error_m, reach) for end in (predicted.low_m, predicted.high_m))
    return positive_interval(predicted.error_m - float(below), predicted.error_m + float(above))


def _read(experiment: CopterSteps, flight: Flight) -> LoggedFlight:
    gains = experiment.space.vector(flight.gains)
    try:
        return experiment.exactly_under(flight.parameters).read(flight.trajectory.as_stored(), gains)
    except InputError as error:
        raise TrajectoryError(
            f"Flight {flight.number} cannot be fitted.",
            hint=f"{error.hint} Mark flight {flight.number} invalid, and fly again.",
            problems=error.problems,
        ) from error


def space_within(space: GainSpace, experiment: CopterSteps, box: Box) -> GainSpace:
    """The gains of an analysis within a box; where they do not meet, the end of the box that is nearest."""
    low, high = experiment.space.by_name(box.low), experiment.space.by_name(box.high)
    bounds: Mapping[str, tuple[float, float]] = {
        name: (float(np.clip(ends[0], low[name], high[name])), float(np.clip(ends[1], low[name], high[name])))
        for name, ends in space.bounds.items()
    }
    return replace(space, bounds=bounds)
