"""An experiment whose error is known in closed form: 1 + ((a − 30)/10)² + ((b − 40)/10)² + offset, at every instant."""

from collections.abc import Mapping
from typing import Final, Self

import numpy as np

from app.core.definition import Flight, OptionValue
from app.core.experiments.base import (
    Check,
    Envelope,
    Matrix,
    ModelledExperiment,
    ModelParameter,
    ParameterDistribution,
    Scatter,
    SimplexSearch,
)
from app.core.policy import Gain, Gains, PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory

OFFSET: Final = ModelParameter("offset", "Offset", "m", upper=1.0, prior_sd=0.1, known_within=0.5, lower=-1.0)


class QuadraticExperiment(ModelledExperiment):
    """Real gain `a` and whole gain `b` in 0 … 100, of scale 10 and 5; the lowest error is at a = 30, b = 40."""

    name = "bowl"
    title = "Bowl"
    output = "depth"
    error_unit = "m"
    space = PolicySpace(
        (
            Gain("a", "A", "1", lower=0, upper=100, scale=10, default=90, integer=False),
            Gain("b", "B", "counts", lower=0, upper=100, scale=5, default=90, integer=True),
        )
    )
    options = ()
    model_parameters = (OFFSET,)
    scatter = Scatter(sd=0.01, degrees_of_freedom=4.0)
    search = SimplexSearch(of_gain=0.3, constant=20.0, evaluations=300)
    difference = 0.1
    window_s = 1.0
    measure = "a bowl"

    @property
    def grid_s(self) -> Samples:
        return np.linspace(0.0, 1.0, 11)

    def configured(self, options: Mapping[str, OptionValue]) -> Self:
        return self

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        return Trajectory(self.grid_s, {"depth": self.outputs(gains[np.newaxis], model)[0]}, "model", "simulation")

    def outputs(self, gains: Matrix, model: Matrix) -> Matrix:
        depth = 1.0 + ((gains[:, :1] - 30.0) / 10.0) ** 2 + ((gains[:, 1:] - 40.0) / 10.0) ** 2 + model[..., :1]
        return np.tile(depth, (1, len(self.grid_s)))

    def hazards(self, gains: Vector, spread: ParameterDistribution, envelope: Envelope) -> tuple[Check, ...]:
        return ()

    def errors(self, outputs: Matrix) -> Vector:
        return np.asarray(np.abs(outputs).mean(axis=1))

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        return float(np.abs(trajectory["depth"]).mean())


def fly(number: int, a: float, b: float, offset: float = 0.25) -> Flight:
    """A flight of the bowl that is `offset` deeper than its model."""
    gains: Gains = {"a": a, "b": b}
    trajectory = QuadraticExperiment().simulate(QuadraticExperiment.space.vector(gains), np.array([offset])).as_stored()
    return Flight(
        number=number,
        gains=gains,
        trajectory=trajectory,
        error=QuadraticExperiment().error(trajectory),
        outcome="valid",
    )
