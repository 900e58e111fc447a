"""Nelder–Mead on the nominal model alone: the paper's starting point, and also a strategy."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np

from app.core.definition import Definition, Flight
from app.core.experiments.base import ModelledExperiment, SimplexSearch
from app.core.policy import PolicySpace, Vector
from app.core.strategies.base import ErrorsOf, Explanation, Proposal, Strategy
from app.core.strategies.bias import uncorrected_model
from app.core.strategies.history import best_flight, format_gains, was_flown
from app.core.wording import short

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

_UNLIMITED: Final = 1_000_000


def _first_steps(search: SimplexSearch, space: PolicySpace, start: Vector) -> Vector:
    """The search's first steps, upward, or downward where the bounds leave more room."""
    step = search.of_gain * start + search.of_scale * space.scale + search.constant
    up, down = np.minimum(step, space.upper - start), np.minimum(step, start - space.lower)
    return np.where(up >= down, up, -down)


@dataclass(frozen=True, slots=True)
class Optimum:
    """Result of a search on the model.

    `gains` have shape (n,), `error` is the model's there; `course` is the lowest error after each iteration.
    """

    gains: Vector
    error: float
    evaluations: int
    course: tuple[float, ...] = ()


def model_optimum(experiment: ModelledExperiment, space: PolicySpace, start: Vector) -> Optimum:
    """Nelder–Mead with reflection 1, expansion 2, contraction ½ and shrinkage ½ (the library's defaults).

    First steps, bounds and budget come from the experiment. Gains are rounded before each model run; a rounded set is
    run once.
    """
    from scipy.optimize import minimize

    model, search = uncorrected_model(experiment), experiment.search

    @cache
    def rounded_error(gains: tuple[float, ...]) -> float:
        return float(model.errors(np.array(gains)[np.newaxis])[0])

    def error(gains: Vector) -> float:
        return rounded_error(tuple(space.nearest(gains).tolist()))

    course: list[float] = []

    def follow(intermediate_result: "OptimizeResult") -> None:
        course.append(float(intermediate_result.fun))

    simplex = np.vstack((start, start + np.diag(_first_steps(search, space, start))))
    found = minimize(
        error,
        start,
        method="Nelder-Mead",
        callback=follow,
        bounds=list(zip(space.lower, space.upper, strict=True)) if search.bounded else None,
        options={
            "initial_simplex": simplex,
            "maxfev": search.evaluations or _UNLIMITED,
            "maxiter": search.iterations or _UNLIMITED,
            "xatol": 0.0,
            "fatol": 0.0,
        },
    )
    return Optimum(space.nearest(found.x), float(found.fun), int(found.nfev), tuple(course))


def propose(
    definition: Definition, experiment: ModelledExperiment, space: PolicySpace, flights: Sequence[Flight]
) -> Proposal:
    """Propose the nominal model's optimum, within the step limit around the best flight.

    At least one flight must be valid.
    """
    start = space.vector(definition.start.gains) if definition.start.gains else space.nearest(space.default)
    optimum = model_optimum(experiment, space, start)
    base = best_flight(flights)
    low, high = space.reachable(space.vector(base.gains), definition.step_fraction)
    target = np.clip(optimum.gains, low, high)
    is_flown = was_flown(space.mapping(target), flights)
    gains = space.nearest(space.vector(base.gains)) if is_flown else target
    trajectory, error = uncorrected_model(experiment).predict(gains)
    stopped = tuple(name for name, is_stopped in zip(space.names, target != optimum.gains, strict=True) if is_stopped)
    found = (
        f"{optimum.evaluations} runs of the nominal model end at {format_gains(space.mapping(optimum.gains))}, "
        f"model error {short(optimum.error)} {experiment.error_unit}."
    )
    summary = f"{found} That was flown; the model alone offers nothing more." if is_flown else found
    return Proposal(
        kind="none" if is_flown else "step",
        gains=space.mapping(gains),
        predicted=trajectory,
        predicted_error=error,
        explanation=Explanation(
            summary=summary,
            base_flight=base.number,
            clipped=stopped,
            notes=("Flights do not change this strategy's model.",),
        ),
    )


def foresee(_definition: Definition, experiment: ModelledExperiment, _flights: Sequence[Flight]) -> ErrorsOf:
    """The errors of the nominal model, which flights do not change."""
    return uncorrected_model(experiment).errors


SIMPLEX: Final = Strategy(
    name="simplex",
    title="Simplex on the model",
    line="Nelder–Mead on the nominal model alone, then that one set is flown.",
    options=(),
    propose=propose,
    predict_errors=foresee,
    corrects_model=False,
)
