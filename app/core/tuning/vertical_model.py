"""The calibrated models of a vehicle under Paparazzi's vertical loop."""

from collections.abc import Sequence
from functools import cached_property
from typing import Final, Generic, TypeVar

import numpy as np

from app.core.analysis.linear_guidance import LinearGuidance
from app.core.analysis.loop import GainSpace
from app.core.definition import Flight, best_flight
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.experiments.base import FittedParameter, Matrix, ParameterDistribution
from app.core.experiments.copter_steps_hazards import COPTERS
from app.core.experiments.takeoff import Takeoff
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.policy import Vector
from app.core.tuning.calibration import Calibration, calibrate
from app.core.tuning.limited_model import LimitedModel
from app.core.tuning.predictions import MODELS as PLAUSIBLE
from app.core.tuning.predictions import FlightPrediction, predict_errors, predict_flight
from app.core.tuning.trust_region import Box, find_robust_optimum, merit

MODELS: Final = 8
ROBUSTNESS_SD: Final = 0.75
"""Distance of the models from the fit in the robust optimisation, in standard deviations. A larger value increases the
error on vehicles that match the fit, a smaller one on those that do not."""

_ZEROS: Final = {"kp": 40.0, "ki": 10.0, "kd": 4.0}
"""Added to the gains of altitude steps, of which the search takes the logarithm: a hundredth of their ranges."""
_STARTS: Final = (0.25, 0.5, 0.75, 1.0)
"""Where that search may start between the lowest and the highest gains: the best ones are often near the highest."""

_E = TypeVar("_E", bound=VerticalLoop)


class VerticalModel(Generic[_E]):
    """The part of a `CampaignModel` that both experiments share: the calibration, and what it predicts.

    `numbers` are the flights that were fitted; `base` is the best of them, by whose deviation from the model every
    prediction is corrected.
    """

    def __init__(self, experiment: _E, flights: Sequence[Flight]) -> None:
        self._experiment: Final = experiment
        self._calibration: Final[Calibration] = calibrate(experiment, flights)
        self.numbers: Final = self._calibration.numbers
        self.base = best_flight([flight for flight in flights if flight.number in self.numbers])

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the gains that the optimum may change."""
        return self._experiment.space.names

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        return self._calibration.fitted

    @cached_property
    def spread(self) -> ParameterDistribution:
        return self._calibration.spread()

    def rounded(self, gains: Vector) -> Vector:
        """The nearest gains that a flight uses."""
        return np.rint(gains)

    def predict(self, gains: Vector) -> FlightPrediction:
        return predict_flight(self._calibration, self.base, gains)

    def errors(self, gains: Matrix) -> Vector:
        return predict_errors(self._calibration, self.base, gains)


class TakeoffModel(VerticalModel[Takeoff]):
    """A `CampaignModel`. The optimum is the robust one over a few plausible models (`trust_region`)."""

    least_improvement: Final = 0.005
    """Relative improvement below which a step is not worth a flight."""

    @cached_property
    def _models(self) -> Matrix:
        return self._calibration.plausible(runs=MODELS, width=ROBUSTNESS_SD)

    def optimum(self, box: Box) -> Vector | None:
        here = self._experiment.space.vector(self.base.gains)
        return find_robust_optimum(self._experiment, box, self._models, box.nearest(here)[np.newaxis])

    def merits(self, gains: Matrix) -> Vector:
        """What `optimum` minimises, in the error's unit: (c, n) → (c,)."""
        return merit(self._experiment, gains, self._models)

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        """Whether the step from `here`, which was flown, is predicted to pay."""
        now, then = self.merits(np.stack((here, there))).tolist()
        return bool(then <= (1.0 - self.least_improvement) * now)

    def notes(self, gains: Vector) -> tuple[str, ...]:  # noqa: ARG002 - the gate's checks say what limits them
        """Sentences about what limits these gains."""
        return ()


class StepsModel(VerticalModel[AltitudeSteps], LimitedModel[Vector]):
    """A `CampaignModel`, whose gains are searched as those of ArduCopter and PX4, with the disturbances of the best
    flight. The error is the mean over plausible vehicles in another flight: the likeliest alone could do without
    integral gain."""

    def __init__(self, experiment: AltitudeSteps, flights: Sequence[Flight]) -> None:
        super().__init__(experiment, flights)
        self._limit_by(experiment.space, flights)

    @cached_property
    def vehicles(self) -> Sequence[Vector]:
        return list(self.spread.sample(self._experiment, COPTERS))

    def loop(self, gains: Vector) -> LinearGuidance:
        return LinearGuidance(gains)

    @cached_property
    def _weather(self) -> tuple[Matrix, Vector, Matrix]:
        """Plausible models, the best flight's own one, and its disturbances."""
        own = self._calibration.own_models[self.numbers.index(self.base.number)]
        gains = self._experiment.space.vector(self.base.gains)
        models = self._calibration.plausible(runs=PLAUSIBLE, next_flight=True)
        return models, own, self._experiment.disturbances(self.base.trajectory.as_stored(), gains, own)

    def flown(self, gains: Vector) -> tuple[float, float]:
        return self._experiment.flown(gains, *self._weather)

    def optimum(self, box: Box) -> Vector | None:
        space, ends = self.policy_space, zip(box.low.tolist(), box.high.tolist(), strict=True)
        bounds = dict(zip(space.names, ends, strict=True))
        along = [space.mapping(box.low + share * (box.high - box.low)) for share in _STARTS]
        return self.found(GainSpace(bounds=bounds, gentle=space.mapping(space.default), zeros=_ZEROS), along)

    def notes(self, gains: Vector) -> tuple[str, ...]:
        return self.limits(gains)
