"""An experiment whose error is known in closed form: 1 + ((a − 30)/10)² + ((b − 40)/10)² + offset, at every instant."""

from typing import Final

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Matrix, ModelParameter
from app.core.policy import Gain, Gains, PolicySpace, Vector
from app.core.trajectory import Samples, Trajectory


class Bowl:
    """Real gain `a` and whole gain `b` in 0 … 100, of scale 10 and 5; the lowest error is at a = 30, b = 40."""

    name: Final = "bowl"
    title: Final = "Bowl"
    output: Final = "depth"
    error_unit: Final = "m"
    space: Final = PolicySpace(
        (
            Gain("a", "A", "1", lower=0, upper=100, scale=10, default=90, integer=False),
            Gain("b", "B", "counts", lower=0, upper=100, scale=5, default=90, integer=True),
        )
    )
    model_parameters: Final = (ModelParameter("offset", "Offset", "m", 0.0, lower=-1.0, upper=1.0, prior_sd=0.1),)
    nominal_model: Final = np.zeros(1)
    grid_s: Final = np.linspace(0.0, 1.0, 11)

    def set_point(self, time_s: Samples) -> Samples:
        return np.zeros_like(time_s)

    def simulate(self, gains: Vector, model: Vector) -> Trajectory:
        return Trajectory(self.grid_s, {"depth": self.outputs(gains[np.newaxis], model)[0]}, "model", "simulation")

    def outputs(self, gains: Matrix, model: Vector) -> Matrix:
        depth = 1.0 + ((gains[:, :1] - 30.0) / 10.0) ** 2 + ((gains[:, 1:] - 40.0) / 10.0) ** 2 + model[0]
        return np.tile(depth, (1, len(self.grid_s)))

    def errors(self, outputs: Matrix) -> Vector:
        return np.asarray(np.abs(outputs).mean(axis=1))

    def error(self, trajectory: Trajectory, *, accept_gaps: bool = False) -> float:
        return float(np.abs(trajectory["depth"]).mean())


def fly(number: int, a: float, b: float, offset: float = 0.25) -> Flight:
    """A flight of the bowl that is `offset` deeper than its model."""
    gains: Gains = {"a": a, "b": b}
    trajectory = Bowl().simulate(Bowl.space.vector(gains), np.array([offset])).as_stored()
    return Flight(number=number, gains=gains, trajectory=trajectory, error=Bowl().error(trajectory), outcome="valid")
