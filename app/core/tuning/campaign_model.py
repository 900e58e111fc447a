"""Interface of a model that is fitted to the flights of a campaign, as the strategy `calibrated` takes it."""

from typing import Protocol

from app.core.definition import Flight
from app.core.experiments.base import FittedParameter, Matrix, ParameterDistribution
from app.core.policy import Vector
from app.core.tuning.predictions import FlightPrediction
from app.core.tuning.trust_region import Box


class CampaignModel(Protocol):
    """A model of one vehicle, fitted to flights; gains have shape (n,)."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """The flights that were fitted."""
        ...

    @property
    def base(self) -> Flight:
        """The best of them, by whose deviation from the model every prediction is corrected."""
        ...

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the gains that the optimum may change."""
        ...

    @property
    def fitted(self) -> tuple[FittedParameter, ...]:
        """What was fitted."""
        ...

    @property
    def spread(self) -> ParameterDistribution:
        """The vehicle's parameters, as far as the flights tell."""
        ...

    def optimum(self, box: Box) -> Vector | None:
        """The best gains within the box on several plausible vehicles; None if the strategy allows none there."""
        ...

    def merits(self, gains: Matrix) -> Vector:
        """What `optimum` minimises, in the error's unit: (c, n) → (c,)."""
        ...

    @property
    def least_improvement(self) -> float:
        """Relative improvement below which a step is not worth a flight."""
        ...

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        """Whether the step from `here`, which was flown, is predicted to pay."""
        ...

    def rounded(self, gains: Vector) -> Vector:
        """The nearest gains that a flight uses."""
        ...

    def predict(self, gains: Vector) -> FlightPrediction:
        """A flight with these gains."""
        ...

    def errors(self, gains: Matrix) -> Vector:
        """Predicted errors of many gain sets: (c, n) → (c,)."""
        ...

    def notes(self, gains: Vector) -> tuple[str, ...]:
        """Sentences about what limits these gains."""
        ...
