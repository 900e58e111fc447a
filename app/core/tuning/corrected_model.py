"""The simple model corrected by one flight, its optimum, and the gains of a campaign's first flight."""

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Experiment, Matrix, ModelledExperiment, SimplexSearch
from app.core.policy import PolicySpace, Vector
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.evidence import Evidence, has_model
from app.core.tuning.strategy import ModelPrediction


def resample_to_grid(experiment: Experiment, flight: Flight) -> Samples:
    """The flight's scored output on the grid of a model run, from the trajectory as stored.

    Outside the recorded time, the nearest sample holds. Over a link a set point takes effect some hundredths of a
    second before or after its time in a model run: the distance from the recorded reference is that from the model's.
    """
    measured, reference = flight.trajectory.as_stored(), experiment.reference
    output = np.interp(experiment.grid_s, measured.time_s, measured[experiment.output])
    channel = experiment.target_channel
    if reference is None or channel is None or channel not in measured.channels:
        return output
    return reference + output - np.interp(experiment.grid_s, measured.time_s, measured[channel])


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

    def predict(self, gains: Vector) -> ModelPrediction:
        """Predicted output of one policy, shape (g,), and its error."""
        outputs = self.outputs(gains[np.newaxis])
        trajectory = Trajectory(self.experiment.grid_s, {self.experiment.output: outputs[0]}, "model", "simulation")
        return ModelPrediction(trajectory=trajectory, error=float(self.experiment.errors(outputs)[0]))


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
    """The nominal model with the bias of a flight: b(t) = measured(t) − model(t; flown gains), the latter under the
    parameters that the flight's autopilot had."""
    then = experiment.under(flight.parameters)
    flown = then.outputs(then.space.vector(flight.gains)[np.newaxis], then.nominal_model)[0]
    return CorrectedModel(experiment, experiment.nominal_model, resample_to_grid(then, flight) - flown)


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


_UNLIMITED: Final = 1_000_000


def _first_steps(search: SimplexSearch, space: PolicySpace, start: Vector) -> Vector:
    """The search's first steps, upward, or downward where the bounds leave more room."""
    step = search.of_gain * start + search.of_scale * space.scale + search.constant
    up, down = np.minimum(step, space.upper - start), np.minimum(step, start - space.lower)
    return np.where(up >= down, up, -down)


@dataclass(frozen=True, slots=True)
class Optimum:
    """Result of a search on the model.

    `gains` have shape (n,), `error` is the model's there; `course` is the lowest error after each iteration.
    """

    gains: Vector
    error: float
    evaluations: int
    course: tuple[float, ...] = ()


def model_optimum(experiment: ModelledExperiment, space: PolicySpace, start: Vector) -> Optimum:
    """Nelder–Mead with reflection 1, expansion 2, contraction ½ and shrinkage ½ (the library's defaults).

    First steps, bounds and budget come from the experiment. Gains are rounded before each model run; a rounded set is
    run once.
    """
    from scipy.optimize import minimize

    model, search = uncorrected_model(experiment), experiment.search

    @cache
    def rounded_error(gains: tuple[float, ...]) -> float:
        return float(model.errors(np.array(gains)[np.newaxis])[0])

    def error(gains: Vector) -> float:
        return rounded_error(tuple(space.nearest(gains).tolist()))

    simplex = np.vstack((start, start + np.diag(_first_steps(search, space, start))))
    found = minimize(
        error,
        start,
        method="Nelder-Mead",
        bounds=list(zip(space.lower, space.upper, strict=True)) if search.bounded else None,
        options={
            "initial_simplex": simplex,
            "maxfev": search.evaluations or _UNLIMITED,
            "maxiter": search.iterations or _UNLIMITED,
            "xatol": 0.0,
            "fatol": 0.0,
            "return_all": True,
        },
    )
    return Optimum(space.nearest(found.x), float(found.fun), int(found.nfev), tuple(map(error, found.allvecs[1:])))


def start_gains(evidence: Evidence[Experiment]) -> dict[str, float]:
    """Gains of the first flight: given ones, the nominal model's optimum, or the experiment's defaults.

    Given gains are those in the definition, its own or the best of another campaign. The optimum is searched from the
    default gains, if there is a model.
    """
    start, space = evidence.definition.start, evidence.space
    if start.gains is not None:
        return space.check(start.gains, field="start.gains")
    if start.kind == "simplex" and has_model(evidence):
        return space.mapping(model_optimum(evidence.experiment, space, space.nearest(space.default)).gains)
    return space.mapping(space.default)
