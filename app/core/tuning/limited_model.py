"""What models of a campaign share whose gains are limited by more than the error: altitude steps.

The error alone drives the gains to their bounds. So the throttle may move little more than with the gains of the first
flight, and no likely vehicle may ring (`app.core.analysis.proposal`).
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Final, Generic, TypeVar

import numpy as np

from app.core.analysis.loop import GainSpace, LinearLoop
from app.core.analysis.margin import (
    EXTRA_LAG_S,
    LARGEST_MARGIN,
    REQUIRED_MARGIN,
    RINGING_DAMPING,
    gain_margin,
    robust_damping,
)
from app.core.analysis.proposal import LARGEST_ACTIVITY, search
from app.core.definition import Flight
from app.core.experiments.base import Matrix
from app.core.policy import PolicySpace, Vector

_V = TypeVar("_V")


class LimitedModel(ABC, Generic[_V]):
    """A part of a `CampaignModel`; gains have shape (n,). `base` is the best flight, `first_gains` are those of the
    first one."""

    least_improvement: Final = 0.05
    base: Flight
    first_gains: Vector
    policy_space: PolicySpace

    def _limit_by(self, space: PolicySpace, flights: Sequence[Flight]) -> None:
        """The gains, and the first of the flights that are valid."""
        first = next(flight for flight in flights if flight.outcome == "valid")
        self.policy_space, self.first_gains = space, space.vector(first.gains)

    @property
    @abstractmethod
    def vehicles(self) -> Sequence[_V]:
        """Those of the gate, for which gains are searched: the likeliest one first."""

    @abstractmethod
    def loop(self, gains: Vector) -> LinearLoop[_V]:
        """The loop with these gains."""

    @abstractmethod
    def flown(self, gains: Vector) -> tuple[float, float]:
        """Predicted error, m, and throttle activity of the likeliest vehicle, in the weather of the best flight."""

    def merits(self, gains: Matrix) -> Vector:
        """Errors of many gain sets: (c, n) → (c,)."""
        return np.array([self.flown(each)[0] for each in gains])

    def is_worth_a_flight(self, here: Vector, there: Vector) -> bool:
        """Whether a step pays, or leaves gains that ring."""
        now, then = self.merits(np.stack((here, there))).tolist()
        before, after = (robust_damping(self.loop(gains), self.vehicles) for gains in (here, there))
        return bool(then <= (1.0 - self.least_improvement) * now) or before < RINGING_DAMPING <= after

    def found(self, space: GainSpace, starts: Sequence[Mapping[str, float]]) -> Vector | None:
        """The best allowed gains of the space, of which those that it lacks are the best flight's; None if there are
        none."""

        def whole(gains: Mapping[str, float]) -> Vector:
            return self.policy_space.vector({**self.base.gains, **gains})

        gains = search(
            space,
            [self.base.gains, *starts],
            self.policy_space.mapping(self.first_gains),
            fly=lambda gains: self.flown(whole(gains)),
            loop_of=lambda gains: self.loop(whole(gains)),
            vehicles=self.vehicles,
        )
        return None if gains is None else whole(gains)

    def limits(self, gains: Vector) -> tuple[str, str]:
        """Sentences about throttle activity and margin."""
        loop = self.loop(gains)
        activity = self.flown(gains)[1] / self.flown(self.first_gains)[1]
        margin = gain_margin(loop, self.vehicles[0])
        beyond = "at least " if margin == LARGEST_MARGIN else ""
        moves = (
            f"The throttle moves {activity:.2f} times as much as with the gains of the first flight; "
            f"{LARGEST_ACTIVITY:g} times is allowed."
        )
        rings = (
            f"With {1e3 * EXTRA_LAG_S:.0f} ms more {loop.texts.lateness}, the altitude begins to ring with {beyond}"
            f"{margin:.1f} times the {loop.texts.fast_gains}; {REQUIRED_MARGIN:g} times is required."
        )
        return moves, rings
