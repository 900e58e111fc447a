"""The predicted error as a function of the gains, two of them at a time.

A slice through a gain set g₀ varies the gains i and j and holds the others:

    E_ij(x, y) = E(g₀ with gᵢ = x, gⱼ = y),

where E is the error predicted by the strategy's own model, corrected or calibrated as for the proposal
(`Strategy.model`; before the first valid flight, the nominal model or the one corrected by the donor's
flight). With more than three gains, those with the largest share of the gradient, |∂E/∂gᵢ|·scaleᵢ, are varied: the
change of the error over one scale of the gain.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import isfinite
from typing import Final

import numpy as np

from app.core.experiments.base import Experiment, Matrix
from app.core.policy import Gain, Gains, PolicySpace, Vector
from app.core.tuning.evidence import Evidence, has_model
from app.core.tuning.proposals import model_of
from app.core.tuning.transfer import transfer

ErrorsOf = Callable[[Matrix], Vector]
"""Gains (k, g) → the errors a model predicts for them, (k,)."""

POINTS: Final = 17
"""Largest number of values of a gain in a slice; integer gains may have fewer."""
MAX_SLICES: Final = 3
_MARGIN: Final = 0.35
_LEAST_WIDTH: Final = 1.5
"""`_MARGIN`: a slice extends beyond its marks by this share of their range on either side. `_LEAST_WIDTH`: its minimum
width in scales of the gain."""
_DIFFERENCE: Final = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Slice:
    """Predicted errors over the gains named `x` and `y`.

    `errors[i][j]` belongs to `y_values[i]` and `x_values[j]`, in the error's unit; None where the model gives no finite
    error.
    """

    x: str
    y: str
    x_values: tuple[float, ...]
    y_values: tuple[float, ...]
    errors: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Landscape:
    """The slices through `centre`; `still` names the gains that no slice varies."""

    centre: dict[str, float]
    slices: tuple[Slice, ...]
    still: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LandscapeGrid:
    """Inputs for computing the slices in chunks.

    The model, the gains through which the slices go, shape (n,), the pairs of gains that are varied, and the values of
    each gain.
    """

    space: PolicySpace
    predict_errors: ErrorsOf
    centre: Vector
    pairs: tuple[tuple[int, int], ...]
    values: tuple[Vector, ...]

    def points(self) -> Matrix:
        """Every gain set of every slice, row by row: shape (p, n)."""
        return np.concatenate([self._points(pair) for pair in self.pairs])

    def landscape(self, errors: Vector) -> Landscape:
        """Assemble the slices from the errors at `points`, shape (p,)."""
        sizes = [len(self.values[x]) * len(self.values[y]) for x, y in self.pairs]
        parts = np.split(errors, np.cumsum(sizes)[:-1])
        shown = {place for pair in self.pairs for place in pair}
        return Landscape(
            centre=self.space.mapping(self.centre),
            slices=tuple(self._slice(pair, part) for pair, part in zip(self.pairs, parts, strict=True)),
            still=tuple(gain.name for place, gain in enumerate(self.space.gains) if place not in shown),
        )

    def _points(self, pair: tuple[int, int]) -> Matrix:
        across, up = np.meshgrid(self.values[pair[0]], self.values[pair[1]])
        gains: Matrix = np.tile(self.centre, (across.size, 1))
        gains[:, pair[0]], gains[:, pair[1]] = across.ravel(), up.ravel()
        return gains

    def _slice(self, pair: tuple[int, int], errors: Vector) -> Slice:
        x, y = pair
        rows = errors.reshape(len(self.values[y]), len(self.values[x])).tolist()
        return Slice(
            x=self.space.names[x],
            y=self.space.names[y],
            x_values=tuple(self.values[x].tolist()),
            y_values=tuple(self.values[y].tolist()),
            errors=tuple(tuple(error if isfinite(error) else None for error in row) for row in rows),
        )


def plan_grid(campaign: Evidence[Experiment], around: Gains, marks: Sequence[Gains]) -> LandscapeGrid | None:
    """Return the model and the grid of slices through the gains `around`, which contain `marks`; None without a model,
    or with fewer than two free gains.

    Pure; a calibration takes up to a second.
    """
    space = campaign.space
    if not has_model(campaign) or free_gains(space) < 2:
        return None
    predict_errors = model_of(transfer(campaign).evidence).errors
    centre = space.nearest(space.vector(around))
    marked = np.array([space.vector(gains) for gains in (*marks, space.mapping(centre))])
    return LandscapeGrid(
        space=space,
        predict_errors=predict_errors,
        centre=centre,
        pairs=tuple(_pairs(space, centre, predict_errors)),
        values=tuple(_values(gain, column) for gain, column in zip(space.gains, marked.T, strict=True)),
    )


def free_gains(space: PolicySpace) -> int:
    """Number of gains that are not pinned by their bounds."""
    return sum(gain.span > 0.0 for gain in space.gains)


def _pairs(space: PolicySpace, centre: Vector, predict_errors: ErrorsOf) -> list[tuple[int, int]]:
    """Pairs of free gains, those with the largest shares of the gradient first; each pair in the order of the gains."""
    free = [place for place, gain in enumerate(space.gains) if gain.span > 0.0]
    pairs = list(combinations(free, 2))
    if len(pairs) <= MAX_SLICES:
        return pairs
    shares = np.abs(space.slopes(predict_errors, centre, _DIFFERENCE * space.scale)) * space.scale
    return sorted(pairs, key=lambda pair: -(shares[pair[0]] + shares[pair[1]]))[:MAX_SLICES]


def _values(gain: Gain, marks: Vector) -> Vector:
    """Values of one gain in its slices, increasing, around `marks` (k,), within its bounds."""
    low, high = float(marks.min()), float(marks.max())
    reach = max((1.0 + 2.0 * _MARGIN) * (high - low), _LEAST_WIDTH * gain.scale) / 2.0
    middle = (low + high) / 2.0
    even = np.linspace(max(gain.lower, middle - reach), min(gain.upper, middle + reach), POINTS)
    return np.unique(np.rint(even)) if gain.integer else even
