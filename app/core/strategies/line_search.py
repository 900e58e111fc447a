"""Line search: evaluates step sizes along one direction on a model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.core.policy import PolicySpace, Vector
from app.core.strategies.base import LadderStep
from app.core.strategies.bias import CorrectedModel


@dataclass(frozen=True, slots=True)
class SearchLine:
    """Flyable gains along `direction` (gains per unit of length) from `base`, each limited to `low` … `high`.

    All have shape (n,).
    """

    space: PolicySpace
    base: Vector
    direction: Vector
    low: Vector
    high: Vector

    def at(self, length: float) -> Vector:
        return np.clip(self.space.nearest(self.base + length * self.direction), self.low, self.high)

    def clipped(self, length: float) -> tuple[str, ...]:
        """Gains that are limited by a bound or the step limit at this length."""
        wanted = self.base + length * self.direction
        wanted = np.where([gain.integer for gain in self.space.gains], np.rint(wanted), wanted)
        stopped = (wanted < self.low) | (wanted > self.high)
        return tuple(name for name, is_stopped in zip(self.space.names, stopped, strict=True) if is_stopped)


def evaluate_lengths(line: SearchLine, lengths: Sequence[float], model: CorrectedModel) -> tuple[LadderStep, ...]:
    """The model's error at each length, in the order of `lengths`."""
    candidates = np.array([line.at(length) for length in lengths])
    return tuple(
        LadderStep(
            length=length, gains=line.space.mapping(gains), predicted_error=float(error), clipped=line.clipped(length)
        )
        for length, gains, error in zip(lengths, candidates, model.errors(candidates), strict=True)
    )
