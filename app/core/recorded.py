"""Recorded outputs, resampled to the model's time grid."""

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Experiment
from app.core.trajectory import Samples


def resample_to_grid(experiment: Experiment, flight: Flight) -> Samples:
    """The flight's scored output on the grid of a model run, from the trajectory as stored.

    Outside the recorded time, the nearest sample holds.
    """
    measured = flight.trajectory.as_stored()
    return np.interp(experiment.grid_s, measured.time_s, measured[experiment.output])
