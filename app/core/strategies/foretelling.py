"""Predictions of a calibrated model: a flight's curve with a band, and its error with an interval.

The remaining bias acts inside the loop: the disturbances of the best flight relative to its own calibrated model are
applied to the new gains as well, so that gains which reject gusts are credited for it. If the record lacks the climb
rate or the thrust command, the bias is added outside the loop, and fades with the distance from the flown gains.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.calibration import Calibration
from app.core.definition import Flight
from app.core.experiments.base import Matrix, ModelledExperiment
from app.core.plants.vertical_disturbed import ENTERED
from app.core.policy import Vector
from app.core.strategies.base import Interval, band_channels
from app.core.trajectory import Samples, Trajectory

CONFIDENCE: Final = 0.9

_MODELS: Final = 16
_AT_ONCE: Final = 8
"""Number of gain sets simulated together, limited because their curves are held in memory."""
_MODEL_ERROR: Final = 0.02
"""Relative error of even the best simple model."""
_GUST_VARIATION: Final = 0.5
"""Relative variation of the error caused by gusts between flights."""


@dataclass(frozen=True, slots=True)
class FlightPrediction:
    """Prediction of a flight: its curve with a band, and its error with an interval.

    `models` are the models used, (k, m), with their `errors` (k,).
    """

    trajectory: Trajectory
    error: float
    interval: Interval
    models: Matrix
    errors: Vector


def predict_flight(calibration: Calibration, base: Flight, gains: Vector) -> FlightPrediction:
    """Predict a flight with `gains`, shape (n,); `base` is the best of the calibrated flights."""
    from scipy.special import ndtri

    experiment = calibration.experiment
    bias = remaining_bias(calibration, base, gains)
    models = calibration.plausible(runs=_MODELS, next_flight=True)
    clean = experiment.outputs(np.tile(gains, (_MODELS, 1)), models)
    outputs = clean + bias
    errors = experiment.errors(outputs)
    weather = _GUST_VARIATION * float(np.mean(errors - experiment.errors(clean)))
    error = float(np.mean(errors))
    sd = float(np.sqrt(np.var(errors) + weather**2 + (_MODEL_ERROR * error) ** 2))
    curve = outputs.mean(axis=0)
    noise = float(np.sqrt(np.mean(bias**2)))
    reach = float(ndtri(0.5 + CONFIDENCE / 2.0))
    half = reach * np.sqrt(outputs.var(axis=0) + noise**2)
    lower, upper = band_channels(experiment.output)
    channels = {experiment.output: curve, lower: curve - half, upper: curve + half}
    return FlightPrediction(
        trajectory=Trajectory(experiment.grid_s, channels, "model", "simulation"),
        error=error,
        interval=Interval(lower=max(error - reach * sd, 0.0), upper=error + reach * sd, confidence=CONFIDENCE),
        models=models,
        errors=errors,
    )


def predict_errors(calibration: Calibration, base: Flight, gains: Matrix) -> Vector:
    """Errors as predicted by `predict_flight` for many gain sets, a few at a time: (c, n) → (c,)."""
    experiment = calibration.experiment
    models = calibration.plausible(runs=_MODELS, next_flight=True)
    errors = np.empty(len(gains))
    for first in range(0, len(gains), _AT_ONCE):
        some = gains[first : first + _AT_ONCE]
        clean = experiment.outputs(np.repeat(some, _MODELS, axis=0), np.tile(models, (len(some), 1)))
        beyond = np.repeat(remaining_biases(calibration, base, some), _MODELS, axis=0)
        errors[first : first + len(some)] = experiment.errors(clean + beyond).reshape(-1, _MODELS).mean(axis=1)
    return errors


def remaining_bias(calibration: Calibration, base: Flight, gains: Vector) -> Samples:
    """Expected deviation of a flight with `gains`, shape (n,), from the calibrated model, on the grid."""
    return np.asarray(remaining_biases(calibration, base, gains[np.newaxis])[0])


def remaining_biases(calibration: Calibration, base: Flight, gains: Matrix) -> Matrix:
    """The same for many gain sets: (c, n) → (c, samples)."""
    experiment = calibration.experiment
    flown = experiment.space.vector(base.gains)
    own = calibration.own_models[calibration.numbers.index(base.number)]
    disturbances = experiment.disturbances(base.trajectory.as_stored(), flown, own)
    if disturbances is None:
        return np.stack([calibration.residual * _similarity(experiment, some, flown) for some in gains])
    calm = np.zeros_like(disturbances)
    calm[:, ENTERED] = disturbances[:, ENTERED]
    disturbed, undisturbed = (experiment.disturbed_outputs(gains, own, acting) for acting in (disturbances, calm))
    beyond: Matrix = disturbed - undisturbed
    return beyond


def _similarity(experiment: ModelledExperiment, gains: Vector, flown: Vector) -> float:
    """1 at the flown gains, 0.6 at a distance of one scale."""
    return float(np.exp(-0.5 * np.sum(((gains - flown) / experiment.space.scale) ** 2)))
