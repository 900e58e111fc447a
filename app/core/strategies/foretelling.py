"""What a calibrated model expects of a flight: its curve with a band, its error with an interval.

The remaining bias is kept inside the loop: what the best flight did beyond its own calibrated model in every step acts
on the new gains as well, so that gains which hold against gusts are credited with it. Where the record lacks the climb
rate or the thrust command, it is added outside the loop, the less the further the gains are from the flown ones.
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
"""Gain sets that are flown together: their curves are held in memory."""
_MODEL_ERROR: Final = 0.02
"""Share of the error that even the best simple model is off."""
_GUST_VARIATION: Final = 0.5
"""Share by which the next flight's gusts cost more or less than the last one's did."""


@dataclass(frozen=True, slots=True)
class FlightPrediction:
    """The expected curve with its band, the expected error with its interval, and the models it was made with: (k, m),
    with their errors (k,)."""

    trajectory: Trajectory
    error: float
    interval: Interval
    models: Matrix
    errors: Vector


def predict_flight(calibration: Calibration, base: Flight, gains: Vector) -> FlightPrediction:
    """A flight of `gains`, shape (n,); `base` is the best of the calibrated flights."""
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
    """The errors that `foretell` gives to many gain sets, a few at a time: (c, n) → (c,)."""
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
    """What a flight of `gains`, shape (n,), is expected to do beyond the calibrated model, on the grid."""
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
    """1 at the flown gains, 0.6 one scale away from them."""
    return float(np.exp(-0.5 * np.sum(((gains - flown) / experiment.space.scale) ** 2)))
