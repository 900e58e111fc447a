"""The calibrated model of a vehicle under Paparazzi's vertical loop."""

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np

from app.core.definition import Flight, best_flight
from app.core.experiments.base import FittedParameter, Matrix, ModelledExperiment, ParameterDistribution
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.policy import Vector
from app.core.tuning.calibration import Calibration, calibrate
from app.core.tuning.predictions import FlightPrediction, predict_errors, predict_flight
from app.core.tuning.trust_region import Box, find_robust_optimum, merit

MODELS: Final = 8
ROBUSTNESS_SD: Final = 0.75
"""Distance of the models from the fit in the robust optimisation, in standard deviations. A larger value increases the
error on vehicles that match the fit, a smaller one on those that do not."""


class VerticalModel:
    """A `CampaignModel`. The optimum is the robust one over a few plausible models (`trust_region`)."""

    least_improvement: Final = 0.005

    def __init__(self, experiment: VerticalLoop, flights: Sequence[Flight]) -> None:
        self._experiment: Final = experiment
        self._calibration: Final[Calibration] = calibrate(experiment, flights)
        self.numbers: Final = self._calibration.numbers
        self.base: Final = best_flight([flight for flight in flights if flight.number in self.numbers])

    @property
    def searched(self) -> tuple[str, ...]:
        return self._experiment.space.names

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        return self._calibration.fitted

    @cached_property
    def spread(self) -> ParameterDistribution:
        return self._calibration.spread()

    @cached_property
    def _models(self) -> Matrix:
        return self._calibration.plausible(runs=MODELS, width=ROBUSTNESS_SD)

    def optimum(self, box: Box) -> Vector | None:
        here = self._experiment.space.vector(self.base.gains)
        return find_robust_optimum(self._experiment, box, self._models, box.nearest(here)[np.newaxis])

    def merits(self, gains: Matrix) -> Vector:
        return merit(self._experiment, gains, self._models)

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        now, then = self.merits(np.stack((here, there))).tolist()
        return bool(then <= (1.0 - self.least_improvement) * now)

    def rounded(self, gains: Vector) -> Vector:
        return np.rint(gains)

    def predict(self, gains: Vector) -> FlightPrediction:
        return predict_flight(self._calibration, self.base, gains)

    def errors(self, gains: Matrix) -> Vector:
        return predict_errors(self._calibration, self.base, gains)

    def notes(self, gains: Vector) -> tuple[str, ...]:  # noqa: ARG002 - the gate's checks say what limits them
        return ()


def fit_vertical(experiment: ModelledExperiment, flights: Sequence[Flight]) -> VerticalModel:
    """The model of these flights; at least one must be valid."""
    assert isinstance(experiment, VerticalLoop)
    return VerticalModel(experiment, flights)
