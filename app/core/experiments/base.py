"""What an experiment offers to strategies, figures and pages. A new one is one file and one line in the registry."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.core.policy import PolicySpace, Vector
from app.core.trajectory import Samples, Trajectory

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ModelParameter:
    """One number of the simple model that a fit may move: its nominal value and the spread expected around it."""

    name: str
    title: str
    unit: str
    nominal: float
    lower: float
    upper: float
    prior_sd: float


class Experiment(Protocol):
    """One manoeuvre with its policy space, its simple model, and its performance measure (lower is better)."""

    @property
    def name(self) -> str: ...
    @property
    def title(self) -> str: ...
    @property
    def space(self) -> PolicySpace: ...
    @property
    def model_parameters(self) -> tuple[ModelParameter, ...]: ...
    @property
    def nominal_model(self) -> Vector:
        """Shape (m,), in the order of `model_parameters`."""
        ...

    @property
    def output(self) -> str:
        """The channel that is scored, e.g. `altitude_m`."""
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

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        """One model run with every channel the model knows."""
        ...

    def outputs(self, gains: Matrix, model: Vector) -> Matrix:
        """Scored output of many policies on one model: gains (k, g) → (k, n) on `grid_s`, one compiled call."""
        ...

    def errors(self, outputs: Matrix) -> Vector:
        """Performance of outputs given on `grid_s`: (k, n) → (k,)."""
        ...

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        """Performance of a recorded flight on its own time stamps. Raises TrajectoryError when it cannot be scored.

        `accept_gaps`: somebody has looked at the gaps inside the record and counts the flight all the same.
        """
        ...
