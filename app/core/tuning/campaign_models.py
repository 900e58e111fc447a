"""The models that are fitted to a campaign's flights, and what the flights tell of the vehicle; among them the
calibrated models of a vehicle under Paparazzi's vertical loop."""

from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import Final, Generic, TypeVar

import numpy as np

from app.core.analysis.loop import GainSpace
from app.core.definition import Flight, best_flight
from app.core.errors import InputError
from app.core.experiments.altitude_steps import AltitudeSteps, LinearGuidance
from app.core.experiments.base import (
    Experiment,
    FittedParameter,
    Matrix,
    ModelledExperiment,
    ParameterDistribution,
    halton,
    prior_distribution,
)
from app.core.experiments.copter_steps import COPTERS, CopterSteps
from app.core.experiments.takeoff import COARSE_S, Takeoff
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.policy import Box, Vector
from app.core.tuning.calibration import Calibration, calibrate
from app.core.tuning.copter_model import CopterModel, LimitedModel
from app.core.tuning.evidence import Evidence
from app.core.tuning.predictions import MODELS as PLAUSIBLE
from app.core.tuning.predictions import FlightPrediction, predict_errors, predict_flight

MODELS: Final = 8
ROBUSTNESS_SD: Final = 0.75
"""Distance of the models from the fit in the robust optimisation, in standard deviations. A larger value increases the
error on vehicles that match the fit, a smaller one on those that do not."""

_POINTS: Final = 64
_EVALUATIONS: Final = (60, 40)

_ZEROS: Final = {"kp": 40.0, "ki": 10.0, "kd": 4.0}
"""Added to the gains of altitude steps, of which the search takes the logarithm: a hundredth of their ranges."""
_STARTS: Final = (0.25, 0.5, 0.75, 1.0)
"""Where that search may start between the lowest and the highest gains: the best ones are often near the highest."""

_E = TypeVar("_E", bound=VerticalLoop)


class VerticalModel(Generic[_E]):
    """The part of a `CampaignModel` that Paparazzi's takeoffs and altitude steps share: the calibration, and what it
    predicts.

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
    """A `CampaignModel`. The optimum is the robust one over a few plausible models (`find_robust_optimum`)."""

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
        return self._experiment.merits(gains, self._models)

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        """Whether the step from `here`, which was flown, is predicted to pay."""
        now, then = self.merits(np.stack((here, there))).tolist()
        return bool(then <= (1.0 - self.least_improvement) * now)

    def notes(self, gains: Vector) -> tuple[str, ...]:  # noqa: ARG002 - the gate's checks say what limits them
        """Sentences about what limits these gains."""
        return ()


def find_robust_optimum(experiment: Takeoff, box: Box, models: Matrix, known: Matrix) -> Vector:
    """The gains with the least merit found in the box, shape (n,); `known` (c, n) are included in the first points.

    A fixed set of points spread over the box is evaluated first, on shorter flights and on half the models; then
    Nelder–Mead on integer counts starts from the best two.
    """
    spread = box.low + halton(len(box.low), _POINTS + 1)[1:] * (box.high - box.low)
    points = box.nearest(np.vstack((known, spread)))
    first = experiment.merits(points, models[::2], COARSE_S)
    starts = points[np.argsort(first, kind="stable")[: len(_EVALUATIONS)]]

    @cache
    def flown(counts: tuple[float, ...]) -> float:
        return float(experiment.merits(np.array([counts]), models)[0])

    def fine(gains: Vector) -> float:
        return flown(tuple(box.nearest(gains).tolist()))

    steps = (box.high - box.low) / 10.0
    ends = [
        box.nearest(minimise_in_box(fine, start, steps, box, evaluations=evaluations, tolerance=1.0))
        for start, evaluations in zip(starts, _EVALUATIONS, strict=True)
    ]
    return ends[int(np.argmin([fine(end) for end in ends]))]


def minimise_in_box(
    error: Callable[[Vector], float], start: Vector, steps: Vector, box: Box, *, evaluations: int, tolerance: float
) -> Vector:
    """Minimise `error` within the box and return the final point, shape (n,).

    The initial simplex is `start` and its `steps` (positive) away from the nearer bound. The search ends when the
    simplex is `tolerance` wide and its errors differ by 1e-6, or after `evaluations`.
    """
    from scipy.optimize import minimize

    inward = np.where(start > (box.low + box.high) / 2.0, -steps, steps)
    found = minimize(
        error,
        start,
        method="Nelder-Mead",
        bounds=list(zip(box.low, box.high, strict=True)),
        options={
            "initial_simplex": np.vstack((start, start + np.diag(inward))),
            "maxfev": evaluations,
            "xatol": tolerance,
            "fatol": 1e-6,
        },
    )
    return np.asarray(found.x)


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


CampaignModel = TakeoffModel | StepsModel | CopterModel
"""A model of one vehicle, fitted to a campaign's flights, as the strategy `calibrated` takes it."""

CALIBRATED: Final = (Takeoff, AltitudeSteps)
"""Experiments the parameters of whose model are found by `app.core.tuning.calibration`."""
FITTED: Final = (*CALIBRATED, CopterSteps)
"""Experiments whose model is fitted to flights."""


def fit(evidence: Evidence[Experiment]) -> CampaignModel:
    """The model of these flights; at least one must be valid.

    Raises TypeError for an experiment whose model is not fitted, and TrajectoryError if a record does not suffice.
    """
    experiment, flights = evidence.experiment, evidence.flights
    if isinstance(experiment, Takeoff):
        return TakeoffModel(experiment, flights)
    if isinstance(experiment, AltitudeSteps):
        return StepsModel(experiment, flights)
    if isinstance(experiment, CopterSteps):
        return CopterModel(experiment, flights)
    raise TypeError(f"calibrated does not work with {experiment.name}")


def known_distribution(evidence: Evidence[Experiment]) -> ParameterDistribution:
    """Distribution of the vehicle's parameters: the data sheet's until a flight is valid, then that of the fit.

    Experiments without a fit, and flights that do not suffice for one, use the data sheet; without a model the
    distribution is empty.
    """
    experiment = evidence.experiment
    if not isinstance(experiment, FITTED) or all(flight.error is None for flight in evidence.flights):
        return prior_distribution(experiment)
    try:
        return fit(evidence).spread
    except InputError:
        return prior_distribution(experiment)


def as_flown(experiment: ModelledExperiment, flights: Sequence[Flight]) -> ModelledExperiment:
    """The experiment with the autopilot's parameters of the last flight that recorded any on which its model
    depends."""
    recorded = [own for flight in flights if (own := experiment.loop_parameters(flight.parameters))]
    return experiment.under(recorded[-1]) if recorded else experiment


def changed_parameters(evidence: Evidence[ModelledExperiment]) -> str:
    """A sentence that names the autopilot's parameters beside the gains that differ, in three digits, from those of the
    first valid flight that recorded them; empty if none do."""
    experiment = evidence.experiment
    recorded = [
        (flight.number, own) for flight in evidence.valid if (own := experiment.loop_parameters(flight.parameters))
    ]
    if not recorded:
        return ""
    (first, before), *later = recorded
    changed = {
        name: f"{name} was {before[name]:g} in flight {first} and {own[name]:g} in flight {number}"
        for number, own in later
        for name in before
        if name in own and name not in experiment.space.names and f"{own[name]:.3g}" != f"{before[name]:.3g}"
    }
    if not changed:
        return ""
    return f"The errors are compared as if only the gains had changed, but {', '.join(changed.values())}."
