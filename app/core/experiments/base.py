"""What an experiment offers to strategies, figures and pages. A new one is one file and one line in the registry."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from app.core.checks import Check, Envelope
from app.core.definition import OptionValue
from app.core.options import Option
from app.core.policy import PolicySpace, Vector
from app.core.spread import ParameterDistribution
from app.core.trajectory import Samples, Trajectory

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ModelParameter:
    """One number of the simple model that a fit may move: its nominal value, and the standard deviation of the truth
    around it, as a fit takes it; `known_within` is how far the gate lets it be off before a flight has shown more.

    `expected` is where a fit takes the truth to lie, where the data sheet's figure is the edge of what is possible (no
    motor is without lag); `flight_sd` how much it differs from one flight to the next.
    """

    name: str
    title: str
    unit: str
    nominal: float
    lower: float
    upper: float
    prior_sd: float
    known_within: float
    expected: float | None = None
    flight_sd: float = 0.0

    @property
    def prior_mean(self) -> float:
        return self.nominal if self.expected is None else self.expected


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedParameter:
    """A number of the model as the flights have it, with its standard error; `nominal` and `prior_sd` are what was
    known before them."""

    name: str
    title: str
    unit: str
    value: float
    standard_error: float
    nominal: float
    prior_sd: float


def fitted_parameters(
    parameters: Sequence[ModelParameter], values: Vector, covariance: Matrix
) -> tuple[FittedParameter, ...]:
    """Values of shape (m,) with their standard errors from a covariance (m, m), beside what was known before."""
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


def informed_parameters(parameters: Sequence[ModelParameter], mean: Vector, sd: Vector) -> tuple[ModelParameter, ...]:
    """The same parameters known better: `mean` and `sd`, shape (m,), take the place of the data sheet."""
    return tuple(
        replace(
            parameter, nominal=float(value), prior_sd=float(spread), known_within=2.0 * float(spread), expected=None
        )
        for parameter, value, spread in zip(parameters, mean, sd, strict=True)
    )


@dataclass(frozen=True, slots=True)
class Scatter:
    """How much errors of repeated flights scatter, as known before any: a standard deviation in the error's unit, worth
    as much as `degrees_of_freedom` repeats. One that is not `measured`, but taken over from another autopilot, gives an
    order of magnitude and decides nothing."""

    sd: float
    degrees_of_freedom: float
    measured: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class SimplexSearch:
    """How Nelder–Mead searches this experiment's model: the first step of a gain is `of_gain` of its value plus
    `of_scale` of its scale plus `constant`; it ends after so many evaluations of the model, or iterations. Without
    `bounded` the simplex may leave the bounds, and only the gains of each run are held inside."""

    of_gain: float = 0.0
    of_scale: float = 0.0
    constant: float = 0.0
    evaluations: int | None = None
    iterations: int | None = None
    bounded: bool = True


class Experiment(Protocol):
    """One manoeuvre with its policy space and its performance measure (lower is better)."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def options(self) -> tuple[Option, ...]:
        """Settings of the experiment itself, of its model for instance."""
        ...

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        """The experiment with these settings, the others at their defaults; they must be free of problems."""
        ...

    @property
    def modelled(self) -> "ModelledExperiment | None":
        """The same with its simple model; None where there is none, so that nothing can be foretold."""
        ...

    @property
    def space(self) -> PolicySpace: ...
    @property
    def scatter(self) -> Scatter: ...
    @property
    def output(self) -> str:
        """The channel that is scored, e.g. `altitude_m`."""
        ...

    @property
    def integrates(self) -> bool:
        """Whether the error is the integral of the absolute deviation over time, rather than its mean."""
        ...

    @property
    def error_unit(self) -> str: ...
    @property
    def grid_s(self) -> Samples:
        """Shape (n,): the instants of a model run, from the command on."""
        ...

    def set_point(self, time_s: Samples) -> Samples:
        """What the output is scored against, shape of `time_s`; zero before the command."""
        ...

    def errors(self, outputs: Matrix) -> Vector:
        """Performance of outputs given on `grid_s`: (k, n) → (k,)."""
        ...

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """Performance of a recorded flight on its own time stamps. Raises TrajectoryError when it cannot be scored.

        `accept_gaps`: somebody has looked at the gaps inside the record and counts the flight all the same.
        """
        ...


class ModelledExperiment(Experiment, Protocol):
    """An experiment with a simple model of its vehicle."""

    def informed(self, mean: Vector, sd: Vector) -> Self:
        """The experiment with another vehicle's fitted model as its nominal one: both of shape (m,)."""
        ...

    @property
    def model_parameters(self) -> tuple[ModelParameter, ...]: ...
    @property
    def nominal_model(self) -> Vector:
        """Shape (m,), in the order of `model_parameters`."""
        ...

    @property
    def search(self) -> SimplexSearch: ...
    @property
    def difference(self) -> float:
        """Step of the gradient's differences, as a share of each gain's scale."""
        ...

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One model run with every channel the model knows."""
        ...

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        """Scored output of many policies, each on its own model or all on one: gains (k, g), model (k, m) or (m,)
        → (k, n) on `grid_s`, one compiled call."""
        ...

    def disturbances(self, trajectory: Trajectory, gains: Vector, model: Vector) -> Matrix | None:
        """What the state did in every recorded step beyond the model's step from the recorded state and command, in the
        experiment's own layout for `disturbed_outputs`. None where the record does not hold what it takes."""
        ...

    def disturbed_outputs(self, gains: Matrix, model: Matrix, disturbances: Matrix) -> Matrix:
        """`outputs` of the model with these added to its state at the same instants, inside the control loop."""
        ...

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        """What could go wrong in a flight with these gains, inside the bounds or not, on vehicles as `spread` has them:
        the checks of the gate that only the experiment can make. Pure; a tenth of a second at most."""
        ...
