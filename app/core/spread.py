"""Probability distribution of a model's parameters."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from app.core.policy import Vector
from app.core.quasi_random import halton

if TYPE_CHECKING:  # experiments compute their hazards over a distribution
    from app.core.experiments.base import Experiment, Matrix, ModelledExperiment

WIDEST_SD: Final = 2.0
"""Truncation of the samples, in standard deviations from the mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterDistribution:
    """A normal distribution over the model's parameters, in the order of `model_parameters`.

    Truncated at two standard deviations along its principal axes, and at the parameters' own limits. `origin` names its
    source.
    """

    mean: tuple[float, ...]
    covariance: tuple[tuple[float, ...], ...]
    origin: str

    def sample(self, experiment: "ModelledExperiment", count: int) -> "Matrix":
        """The mean, then `count` − 1 quasi-random models, shape (count, m); deterministic."""
        unit = halton(len(self.mean), count)[1:]
        return np.vstack((self._models(experiment, np.full((1, len(self.mean)), 0.5)), self._models(experiment, unit)))

    def draw_random(self, experiment: "ModelledExperiment", count: int, seed: int) -> "Matrix":
        """Random models from the same distribution, shape (count, m)."""
        return self._models(experiment, np.random.default_rng(seed).random((count, len(self.mean))))

    def _models(self, experiment: "ModelledExperiment", unit: "Matrix") -> "Matrix":
        """Models from uniformly distributed numbers in 0 … 1, shape (k, m)."""
        from scipy.special import ndtri

        variances, axes = np.linalg.eigh(np.array(self.covariance))
        sd = np.sqrt(np.maximum(variances, 0.0))
        edge = 0.5 - 0.5 * _PROBABILITY_WITHIN
        normal = ndtri(edge + unit * _PROBABILITY_WITHIN)
        lower = [parameter.lower for parameter in experiment.model_parameters]
        upper = [parameter.upper for parameter in experiment.model_parameters]
        return np.asarray(np.clip(np.array(self.mean) + (normal * sd) @ axes.T, lower, upper))


_PROBABILITY_WITHIN: Final = 0.9544997361036416


NO_PARAMETERS: Final = ParameterDistribution(mean=(), covariance=(), origin="nothing: there is no model")


def prior_distribution(experiment: "Experiment") -> ParameterDistribution:
    """Distribution given by the data sheet: each parameter within `known_within` of its nominal value.

    Empty without a model.
    """
    modelled = experiment.modelled
    if modelled is None:
        return NO_PARAMETERS
    sd: Vector = np.array([parameter.known_within for parameter in modelled.model_parameters]) / WIDEST_SD
    return ParameterDistribution(
        mean=tuple(float(value) for value in modelled.nominal_model),
        covariance=tuple(tuple(row) for row in np.diag(sd**2).tolist()),
        origin="the data sheet",
    )
