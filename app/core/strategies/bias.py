"""The simple model, corrected by one flight."""

from dataclasses import dataclass

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Matrix, ModelledExperiment
from app.core.policy import Vector
from app.core.recorded import resample_to_grid
from app.core.trajectory import Samples, Trajectory


@dataclass(frozen=True, slots=True)
class CorrectedModel:
    """Model output plus a time-dependent bias, outside the control loop: ŷ(t; gains) = model(t; gains) + b(t).

    `bias` is given on the experiment's grid, shape (n,).
    """

    experiment: ModelledExperiment
    model: Vector
    bias: Samples

    def outputs(self, gains: Matrix) -> Matrix:
        """Gains (k, g) → predicted outputs (k, n)."""
        return self.experiment.outputs(gains, self.model) + self.bias

    def errors(self, gains: Matrix) -> Vector:
        """Gains (k, g) → predicted errors (k,)."""
        return self.experiment.errors(self.outputs(gains))

    def predict(self, gains: Vector) -> tuple[Trajectory, float]:
        """Predicted output of one policy and its error."""
        outputs = self.outputs(gains[np.newaxis])
        trajectory = Trajectory(self.experiment.grid_s, {self.experiment.output: outputs[0]}, "model", "simulation")
        return trajectory, float(self.experiment.errors(outputs)[0])


@dataclass(frozen=True, slots=True)
class DisturbedModel(CorrectedModel):
    """The model with a flight's disturbances added to its state at the same times, inside the control loop.

    Abbeel et al. 2006, the paper's step 4; `bias` is zero.
    """

    disturbances: Matrix

    def outputs(self, gains: Matrix) -> Matrix:
        """Gains (k, g) → predicted outputs (k, n)."""
        return self.experiment.disturbed_outputs(gains, self.model, self.disturbances)


def uncorrected_model(experiment: ModelledExperiment) -> CorrectedModel:
    """The nominal model without a correction, used before the first flight."""
    return CorrectedModel(experiment, experiment.nominal_model, np.zeros_like(experiment.grid_s))


def correct_by_bias(experiment: ModelledExperiment, flight: Flight) -> CorrectedModel:
    """The nominal model with the bias of a flight: b(t) = measured(t) − model(t; flown gains)."""
    flown = experiment.outputs(experiment.space.vector(flight.gains)[np.newaxis], experiment.nominal_model)[0]
    return CorrectedModel(experiment, experiment.nominal_model, resample_to_grid(experiment, flight) - flown)


def correct_in_loop(experiment: ModelledExperiment, flight: Flight) -> DisturbedModel | None:
    """The nominal model with the flight's disturbances inside the loop, from the trajectory as stored.

    None if its record lacks a state or the command.
    """
    disturbances = experiment.disturbances(
        flight.trajectory.as_stored(), experiment.space.vector(flight.gains), experiment.nominal_model
    )
    if disturbances is None:
        return None
    return DisturbedModel(experiment, experiment.nominal_model, np.zeros_like(experiment.grid_s), disturbances)
