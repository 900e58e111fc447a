"""What was recorded of a flight, where the model has its own."""

import numpy as np

from app.core.definition import Flight
from app.core.experiments.base import Experiment
from app.core.trajectory import Samples


def resample_to_grid(experiment: Experiment, flight: Flight) -> Samples:
    """The flight's scored output at the instants of a model run, taken as the database keeps it.

    Beyond the flight's samples its nearest one holds.
    """
    measured = flight.trajectory.as_stored()
    return np.interp(experiment.grid_s, measured.time_s, measured[experiment.output])
