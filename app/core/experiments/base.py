"""Interface of an experiment, its model parameters and their distribution, and the result of a check of a policy. A new
experiment needs one file and one line in the registry.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import count as numbers_from
from itertools import islice
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from app.core.definition import Flight, Option, OptionValue
from app.core.models.set_points import SetPoints
from app.core.policy import Gains, PolicySpace, Vector
from app.core.records.plausibility import ExpectedFlight
from app.core.records.trajectory import Samples, Trajectory


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check: the worst value, in the same measure as the limit, and the gain that caused it.

    `case` names the simulated case of the worst value. `offer` holds the nearest value of each refused gain that would
    pass, if there is one; in the gate's result, a value that passes all checks with such a limit.
    """

    name: str
    passed: bool
    sentence: str
    worst: float
    limit: float
    gain: str = ""
    case: str = ""
    offer: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Limits of a model run: it may rise to `ceiling_m` (m), and may be aborted to `safe_gains` at any instant."""

    ceiling_m: float
    safe_gains: Gains


def halton(dimensions: int, count: int) -> NDArray[np.float64]:
    """The first points of the Halton sequence in the unit cube, shape (count, dimensions).

    Coordinate d of point i is the radical inverse of i in base p, the d-th prime: its digits reversed behind the point
    (Halton, 1960). The same numbers as `scipy.stats.qmc.Halton(dimensions, scramble=False)`, a package that takes
    longer to import than a proposal takes to compute.
    """
    points = np.zeros((count, dimensions))
    for dimension, base in enumerate(_primes(dimensions)):
        remaining, digit_value = np.arange(count), 1.0 / base
        while remaining.any():
            remaining, digit = np.divmod(remaining, base)
            points[:, dimension] += digit * digit_value
            digit_value /= base
    return points


def _primes(count: int) -> list[int]:
    """The first prime numbers."""
    return list(islice((n for n in numbers_from(2) if all(n % divisor for divisor in range(2, n))), count))


WIDEST_SD: Final = 2.0
"""Truncation of the samples, in standard deviations from the mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDistribution:
    """A normal distribution over the model's parameters, in the order of `model_parameters`.

    Truncated at two standard deviations along its principal axes, and at the parameters' own limits. `origin` names its
    source.
    """

    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    origin: str

    def sample(self, experiment: "ModelledExperiment", count: int) -> "Matrix":
        """The mean, then `count` − 1 quasi-random models, shape (count, m); deterministic."""
        unit = halton(len(self.mean), count)[1:]
        return np.vstack((self.models(experiment, np.full((1, len(self.mean)), 0.5)), self.models(experiment, unit)))

    def models(self, experiment: "ModelledExperiment", unit: "Matrix") -> "Matrix":
        """Models from uniformly distributed numbers in 0 … 1, shape (k, m)."""
        from scipy.special import ndtri

        variances, axes = np.linalg.eigh(np.array(self.covariance))
        sd = np.sqrt(np.maximum(variances, 0.0))
        edge = 0.5 - 0.5 * _PROBABILITY_WITHIN
        normal = ndtri(edge + unit * _PROBABILITY_WITHIN)
        return np.asarray(np.clip(np.array(self.mean) + (normal * sd) @ axes.T, *experiment.limits))


_PROBABILITY_WITHIN: Final = 0.9544997361036416


def normal_distribution(mean: Vector, covariance: "Matrix", origin: str) -> ParameterDistribution:
    """The distribution with this mean, shape (m,), and covariance, (m, m)."""
    rows = tuple(tuple(row) for row in covariance.tolist())
    return ParameterDistribution(mean=tuple(mean.tolist()), covariance=rows, origin=origin)


def prior_distribution(experiment: "Experiment") -> ParameterDistribution:
    """Distribution given by the data sheet: each parameter within `known_within` of its nominal value.

    Empty without a model.
    """
    if not isinstance(experiment, ModelledExperiment):
        return ParameterDistribution(mean=(), covariance=(), origin="none: there is no model")
    sd: Vector = np.array([parameter.known_within for parameter in experiment.model_parameters]) / WIDEST_SD
    return normal_distribution(experiment.nominal_model, np.diag(sd**2), origin="the data sheet")


Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ModelParameter:
    """One parameter of the simple model that a fit may change.

    `nominal` is its value in the nominal model, `prior_sd` the prior standard deviation in a fit; `known_within` is the
    error that the gate allows for until flights have shown more. `expected` is the prior mean of a fit where it differs
    from the nominal value, because the data sheet gives the edge of the possible range (no motor has zero lag).
    `flight_sd` is the standard deviation between flights.
    """

    name: str
    title: str
    unit: str
    upper: float
    prior_sd: float
    known_within: float
    nominal: float = 0.0
    lower: float = 0.0
    expected: float | None = None
    flight_sd: float = 0.0

    @property
    def prior_mean(self) -> float:
        return self.nominal if self.expected is None else self.expected


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A fitted parameter of the model with its standard error, in its unit."""

    name: str
    title: str
    unit: str
    value: float
    standard_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter(Fitted):
    """A fitted parameter with its standard error; `nominal` and `prior_sd` are its prior."""

    nominal: float
    prior_sd: float


def fitted_parameters(
    parameters: Sequence[ModelParameter], values: Vector, covariance: Matrix
) -> tuple[FittedParameter, ...]:
    """Values of shape (m,) with their standard errors from a covariance (m, m), together with their priors."""
    errors = np.sqrt(np.diag(covariance))
    return tuple(
        FittedParameter(
            name=parameter.name,
            title=parameter.title,
            unit=parameter.unit,
            value=float(value),
            standard_error=float(error),
            nominal=parameter.prior_mean,
            prior_sd=parameter.prior_sd,
        )
        for parameter, value, error in zip(parameters, values, errors, strict=True)
    )


@dataclass(frozen=True, slots=True)
class Scatter:
    """Prior scatter of the errors of repeated flights.

    `sd` is a standard deviation in the error's unit, counted as `degrees_of_freedom` repeats. If it is not `measured`,
    but taken from another autopilot, it gives an order of magnitude only and decides nothing.
    """

    sd: float
    degrees_of_freedom: float
    measured: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class SimplexSearch:
    """Settings of the Nelder–Mead search on this experiment's model.

    The first step of a gain is `of_gain` of its value plus `of_scale` of its scale plus `constant`. The search ends
    after this many evaluations of the model, or iterations. Without `bounded` the simplex may leave the bounds, and
    only the gains of each run are limited to them.
    """

    of_gain: float = 0.0
    of_scale: float = 0.0
    constant: float = 0.0
    evaluations: int | None = None
    iterations: int | None = None
    bounded: bool = True


class Experiment(ABC):
    """One manoeuvre with its policy space and its performance measure (lower is better)."""

    name: str
    title: str
    curves_title: str = "Takeoff curves"
    """Title of the figure with all its flights."""
    options: tuple[Option, ...]
    """Settings of the experiment itself, for example of its model."""
    space: PolicySpace
    scatter: Scatter
    output: str
    """The scored channel, e.g. `altitude_m`."""
    integrates: bool = False
    """Whether the error is the integral of the absolute deviation over time, rather than its mean."""
    error_unit: str
    window_s: float
    """End of the scored time, s since the command. Errors over different windows are different quantities."""
    grid_hz: float
    """Samples of a model run in a second."""
    scored_from_s: float = 0.0
    """Beginning of the scored time, s since the command."""
    measure: str
    """What is scored, apart from the window: errors of different measures are different quantities."""
    target_channel: str | None = None
    """Recorded channel with which the output is compared; None: the set point."""
    set_points: SetPoints | None = None
    """Altitudes that the vehicle is told to fly to; None for a manoeuvre of its own."""

    @abstractmethod
    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with these settings, the others at their defaults; they must be free of problems."""

    @property
    def reference(self) -> Samples | None:
        """What that channel is in a model run, on its grid, (n,), if a flight may be late in following it: its distance
        from the recorded channel is then what a model run explains. None: model runs explain its output."""
        return None

    @property
    def grid_s(self) -> Samples:
        """Times of a model run from the command to the first instant at or past the end of the window, shape (n,)."""
        return np.arange(int(np.ceil(self.window_s * self.grid_hz)) + 1) / self.grid_hz

    def set_point(self, time_s: Samples) -> Samples:
        """Set point of the scored output, same shape as `time_s`; zero before the command, and without set points."""
        return np.zeros_like(time_s) if self.set_points is None else self.set_points.at(time_s)

    @property
    def expected(self) -> ExpectedFlight | None:
        """What a record from elsewhere must show to be one of its flights. None: nothing but what the score needs."""
        if self.set_points is None:
            return None
        return ExpectedFlight(set_point=self.set_points.at, begin_s=self.scored_from_s, end_s=self.window_s)

    def scored_flight(self, number: int, gains: Gains, trajectory: Trajectory) -> Flight:
        """A valid flight with this record. Raises TrajectoryError if it cannot be scored."""
        error = self.error(trajectory)
        return Flight(number=number, gains=gains, trajectory=trajectory, error=error, outcome="valid")

    @abstractmethod
    def errors(self, outputs: Matrix) -> Vector:
        """Performance of outputs given on `grid_s`: (k, n) → (k,)."""

    @abstractmethod
    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """Performance of a recorded flight on its own time stamps. Raises TrajectoryError if it cannot be scored.

        `accept_gaps`: a person has reviewed the gaps in the record and counts the flight.
        """


class ModelledExperiment(Experiment):
    """An experiment with a simple model of its vehicle, by which flights are predicted. The model depends on no
    parameters of an autopilot unless the experiment says otherwise."""

    model_parameters: tuple[ModelParameter, ...]
    search: SimplexSearch
    difference: float
    """Step of the finite differences of the gradient, as a share of each gain's scale."""

    @property
    def nominal_model(self) -> Vector:
        """Nominal parameters, shape (m,), in the order of `model_parameters`."""
        return np.array([parameter.nominal for parameter in self.model_parameters])

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Lowest and highest parameters, shape (m,) each."""
        parameters = self.model_parameters
        return np.array([each.lower for each in parameters]), np.array([each.upper for each in parameters])

    @property
    def prior_mean(self) -> Vector:
        """Prior means of the parameters in a fit, shape (m,)."""
        return np.array([parameter.prior_mean for parameter in self.model_parameters])

    @property
    def prior_sd(self) -> Vector:
        """Their standard deviations, shape (m,)."""
        return np.array([parameter.prior_sd for parameter in self.model_parameters])

    def least_model_error(self, base: Trajectory) -> float:  # noqa: ARG002 - not without a resolution of its own
        """Standard deviation, in the error's unit, by which a prediction of even a fitted model is wrong, beside a
        relative error, for flights recorded as `base` was."""
        return 0.0

    def informed(self, mean: Vector, sd: Vector) -> Self:
        """The experiment with another vehicle's fitted model as its nominal one; `mean` and `sd`, shape (m,), are in
        place of the data sheet's values."""
        informed, fitted = copy(self), zip(self.model_parameters, mean.tolist(), sd.tolist(), strict=True)
        informed.model_parameters = tuple(
            replace(parameter, nominal=value, prior_sd=spread, known_within=2.0 * spread, expected=None)
            for parameter, value, spread in fitted
        )
        return informed

    def under(self, parameters: Mapping[str, float]) -> Self:  # noqa: ARG002 - the model does not depend on them
        """The experiment on a vehicle whose autopilot has these parameters, by the firmware's names.

        Itself if its model does not depend on them. If the model does not hold with them, it keeps its own, and
        `hazards` refuses every flight.
        """
        return self

    def loop_parameters(self, parameters: Mapping[str, float]) -> dict[str, float]:  # noqa: ARG002 - as for `under`
        """Those of an autopilot's parameters on which the model depends, gains among them."""
        return {}

    @abstractmethod
    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One model run with every channel of the model."""

    @abstractmethod
    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Scored outputs of many policies in one compiled call, each on its own model or all on one.

        gains (k, g), model (k, m) or (m,) → (k, n) on `grid_s`.
        """

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix | None:  # noqa: ARG002
        """Difference between each recorded step and the model's step from the same state and command.

        In the experiment's own layout for `disturbed_outputs`. None if the record lacks the required channels, and for
        an experiment whose flights correct the model of the strategy `calibrated` alone.
        """
        return None

    def disturbed_outputs(self, gains: Matrix, model: Matrix, disturbances: Matrix) -> Matrix:  # noqa: ARG002
        """`outputs` with the disturbances added to the model's state at the same times, inside the control loop."""
        return self.outputs(gains, model)

    @abstractmethod
    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """Hazards of a flight with these gains, inside the bounds or not, on vehicles distributed as `spread`.

        These are the gate's checks that are specific to the experiment. Pure; at most a tenth of a second.
        """
