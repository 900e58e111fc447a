"""The paper's strategy: descend the corrected model's error along its gradient.

The base is the best flight so far. The model, corrected by it outside the loop, gives the gradient (central
differences) and the error at every step of a geometric ladder along its negative; the best step is flown. A flight that
does not improve leaves the base, and with it the line, where it was: the next one goes half as far along it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight
from app.core.experiments.base import Experiment
from app.core.policy import PolicySpace, Vector
from app.core.strategies.base import Explanation, LadderStep, Option, Proposal, Strategy
from app.core.strategies.bias import CorrectedModel, corrected_by
from app.core.strategies.history import best_flight, describe, was_flown
from app.core.strategies.line_search import Line, try_lengths

SCALED_LADDER: Final = tuple(2.0**power for power in range(3, -13, -1))
RAW_LADDER: Final = tuple(10.0 ** (tenths / 10) for tenths in range(30, -1, -1))
MIN_DIFFERENCE: Final = 2.0
_HALVINGS: Final = 24


@dataclass(frozen=True, slots=True)
class _Metric:
    """How lengths are measured: the scale of each gain, shape (n,), and the ladder of lengths tried."""

    scale: Vector
    ladder: tuple[float, ...]


def gradient(model: CorrectedModel, space: PolicySpace, base: Vector, scale: Vector) -> Vector:
    """∂error/∂gain at `base`, shape (n,): central differences over a tenth of the scale to each side, at least 2 counts
    for integer gains, cut off at the bounds; zero where the bounds pin a gain."""
    integer = np.array([gain.integer for gain in space.gains])
    steps = np.where(integer, np.maximum(np.rint(scale / 10), MIN_DIFFERENCE), scale / 10)
    above, below = np.minimum(base + steps, space.upper), np.maximum(base - steps, space.lower)
    ups = np.where(np.eye(len(base), dtype=bool), above, base)
    downs = np.where(np.eye(len(base), dtype=bool), below, base)
    errors = model.errors(np.concatenate((ups, downs)))
    rise, run = errors[: len(base)] - errors[len(base) :], above - below
    return np.asarray(np.divide(rise, run, out=np.zeros_like(rise), where=run != 0.0))


def propose(definition: Definition, experiment: Experiment, space: PolicySpace, flights: Sequence[Flight]) -> Proposal:
    """The next gains on the line from the best flight. At least one flight must be valid."""
    metric = (
        _Metric(space.scale, SCALED_LADDER)
        if definition.options.get("scaled", True)
        else _Metric(np.ones(len(space.gains)), RAW_LADDER)
    )
    base = best_flight(flights)
    base_gains = space.vector(base.gains)
    model = corrected_by(experiment, base)
    slopes = gradient(model, space, base_gains, metric.scale)
    steepness = float(np.linalg.norm(slopes * metric.scale))
    direction = -slopes * metric.scale**2 / (steepness or 1.0)
    line = Line(space, base_gains, direction, *space.reachable(base_gains, definition.step_fraction))
    ladder = try_lengths(line, metric.ladder, model)
    best = min(ladder, key=lambda step: step.predicted_error)
    now = float(model.errors(base_gains[np.newaxis])[0])
    chosen = _first_not_flown(line, best, base, flights, model) if best.predicted_error < now else None
    explanation = Explanation(
        summary=_summary(experiment, base, best, chosen, len(ladder)),
        base_flight=base.number,
        gradient=_named(space, slopes),
        direction=_named(space, direction),
        ladder=ladder,
        chosen_length=chosen.length if chosen else None,
        clipped=chosen.clipped if chosen else (),
        notes=_notes(chosen),
    )
    if chosen is None:
        trajectory, error = model.predict(base_gains)
        return Proposal(
            kind="none",
            gains=space.mapping(base_gains),
            predicted=trajectory,
            predicted_error=error,
            explanation=explanation,
        )
    trajectory, error = model.predict(space.vector(chosen.gains))
    return Proposal(
        kind="step" if chosen is best else "shorter step",
        gains=chosen.gains,
        predicted=trajectory,
        predicted_error=error,
        explanation=explanation,
    )


def _first_not_flown(
    line: Line, best: LadderStep, base: Flight, flights: Sequence[Flight], model: CorrectedModel
) -> LadderStep | None:
    """The best step, or half of it, or half of that …: the first whose gains were not flown yet.

    What was flown did not improve on the base, which is the best of all flights. None once a step rounds to the base.
    """
    for length in _halvings(best.length):
        gains = line.space.mapping(line.at(length))
        if gains == dict(base.gains):
            return None
        if not was_flown(gains, flights):
            return best if length == best.length else try_lengths(line, (length,), model)[0]
    return None


def _halvings(length: float) -> Iterator[float]:
    return (length / 2**halvings for halvings in range(_HALVINGS))


def _named(space: PolicySpace, values: Vector) -> dict[str, float]:
    return {name: float(value) for name, value in zip(space.names, values, strict=True)}


def _summary(experiment: Experiment, base: Flight, best: LadderStep, chosen: LadderStep | None, tried: int) -> str:
    unit = experiment.error_unit
    origin = f"The best flight so far is {base.number} ({describe(base.gains)}), error {base.error:.4f} {unit}."
    if chosen is None:
        return f"{origin} Along its gradient the corrected model finds nothing better that was not flown yet."
    if chosen is best:
        return (
            f"{origin} Of {tried} step sizes along the negative gradient of the model, corrected by that flight, "
            f"{chosen.length:.4g} promises most: {chosen.predicted_error:.4f} {unit}."
        )
    return (
        f"{origin} The longer step along the same line did not improve on it, so the next one goes less far, "
        f"{chosen.length:.4g} instead of {best.length:.4g}; predicted {chosen.predicted_error:.4f} {unit}."
    )


def _notes(chosen: LadderStep | None) -> tuple[str, ...]:
    outside = "The correction is added outside the control loop, as a bias over time."
    if chosen and chosen.clipped:
        return (outside, f"A bound or the step limit stopped {', '.join(chosen.clipped)}.")
    return (outside,)


GRADIENT: Final = Strategy(
    name="gradient",
    title="Gradient on the corrected model",
    line="The paper's method: the model, corrected by the best flight, gives the direction and the step.",
    options=(
        Option(
            name="scaled",
            title="Measure each gain in its own scale (off: raw counts, as the paper)",
            default=True,
            choices=(True, False),
        ),
    ),
    propose=propose,
)
