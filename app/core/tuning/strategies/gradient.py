"""The paper's strategy: gradient descent on the corrected model.

The base is the best flight so far. The model, corrected by it outside the loop (or inside, as an option), gives the
gradient (central differences) and the error at every step of a geometric ladder along the negative gradient; the best
step is flown. A flight that does not improve leaves the base and the line unchanged, and the next step is half as long.
A step that the gate would refuse is halved in the same way. With the option of a diminishing step size, the ladder ends
below the last successful step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.definition import Flight, Option, aborted_by_gains, best_flight, was_flown
from app.core.experiments.base import ModelledExperiment
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.formatting import format_gains, short
from app.core.policy import PolicySpace, Vector
from app.core.tuning.campaign_models import known_distribution
from app.core.tuning.corrected_model import CorrectedModel, correct_by_bias, correct_in_loop
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import allows
from app.core.tuning.strategy import Explanation, Kind, LadderStep, Proposal, Strategy, proposal_of


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
        return self.space.names_where((wanted < self.low) | (wanted > self.high))


def evaluate_lengths(line: SearchLine, lengths: Sequence[float], model: CorrectedModel) -> tuple[LadderStep, ...]:
    """The model's error at each length, in the order of `lengths`."""
    candidates = np.array([line.at(length) for length in lengths])
    return tuple(
        LadderStep(
            length=length, gains=line.space.mapping(gains), predicted_error=float(error), clipped=line.clipped(length)
        )
        for length, gains, error in zip(lengths, candidates, model.errors(candidates), strict=True)
    )


SCALED_LADDER: Final = tuple(2.0**power for power in range(3, -13, -1))
RAW_LADDER: Final = tuple(10.0 ** (tenths / 10) for tenths in range(30, -1, -1))
"""Step lengths in gains' units if one is an integer; for real gains alone, a step of 1 may be far too long."""
MIN_DIFFERENCE: Final = 2.0
_HALVINGS: Final = 24
_OUTSIDE: Final = "The correction is added outside the control loop, as a bias over time"


@dataclass(frozen=True, slots=True)
class _Metric:
    """How step lengths are measured: the scale of each gain, shape (n,), the ladder of lengths, and the name of their
    unit."""

    scale: Vector
    ladder: tuple[float, ...]
    unit: str

    def describe(self, length: float) -> str:
        """`1 gain scale`, `0.25 gain scales`."""
        return f"{length:.4g} {self.unit}{'' if length == 1.0 else 's'}"


def gradient(model: CorrectedModel, space: PolicySpace, base: Vector, scale: Vector) -> Vector:
    """∂error/∂gain at `base`, shape (n,), by central differences.

    The step to each side is the experiment's share of `scale`, at least 2 counts for integer gains, and limited by the
    bounds; zero where the bounds pin a gain.
    """
    wanted = model.experiment.difference * scale
    whole = [gain.integer for gain in space.gains]
    return space.slopes(model.errors, base, np.where(whole, np.maximum(np.rint(wanted), MIN_DIFFERENCE), wanted))


def _metric(space: PolicySpace, *, scaled: bool) -> _Metric:
    if scaled:
        return _Metric(space.scale, SCALED_LADDER, "gain scale")
    whole = any(gain.integer for gain in space.gains)
    return _Metric(np.ones(len(space.gains)), RAW_LADDER if whole else SCALED_LADDER, "gain unit")


def longest_step(space: PolicySpace, scale: Vector, flights: Sequence[Flight]) -> float | None:
    """Largest length of successful step k, in units of `scale`: (k − 1)/k of the last one's. None for the first.

    A step is successful if it flew a new best error. If every step succeeds and is as long as allowed, α_k = α₁/k: the
    conditions of the paper's footnote 3, Σα = ∞ and Σα² < ∞ (Robbins and Monro 1951), hold.
    """
    valid = [flight for flight in flights if flight.outcome == "valid" and flight.error is not None]
    bests = [flight for number, flight in enumerate(valid, 1) if best_flight(valid[:number]) is flight]
    if len(bests) < 2:
        return None
    last = (space.vector(bests[-1].gains) - space.vector(bests[-2].gains)) / scale
    return float(np.linalg.norm(last)) * (len(bests) - 1) / len(bests)


def propose(evidence: Evidence[ModelledExperiment]) -> Proposal:
    """Propose the next gains on the line from the best flight. At least one flight must be valid."""
    definition, space, flights = evidence.definition, evidence.space, evidence.flights
    metric = _metric(space, scaled=bool(definition.options.get("scaled", True)))
    limit = longest_step(space, metric.scale, flights) if definition.options.get("step_size") == "diminishing" else None
    if limit is not None:
        metric = replace(metric, ladder=(limit, *(length for length in metric.ladder if length < limit)))
    base = evidence.best
    base_gains = space.nearest(space.vector(base.gains))
    model, correction = _corrected(evidence)
    slopes = gradient(model, space, base_gains, metric.scale)
    steepness = float(np.linalg.norm(slopes * metric.scale))
    direction = -slopes * metric.scale**2 / (steepness or 1.0)
    line = SearchLine(space, base_gains, direction, *space.reachable(base_gains, definition.step_fraction))
    ladder = evaluate_lengths(line, metric.ladder, model)
    best = min(ladder, key=lambda step: step.predicted_error)
    now = float(model.errors(base_gains[np.newaxis])[0])
    spread = known_distribution(evidence)

    def passes(gains: Vector) -> bool:
        return allows(evidence, gains, spread)

    chosen, refused = (
        _first_allowed_step(line, best, flights, model, passes) if best.predicted_error < now else (None, ())
    )
    notes = [correction, f"Step sizes are in {metric.unit}s: one is {format_gains(space.by_name(metric.scale))}."]
    if limit is not None:
        notes.append(f"After the last successful step this one is at most {metric.describe(limit)}.")
    if refused:
        notes.append(f"The gate refuses {'; '.join(format_gains(step.gains) for step in refused)}.")
    explanation = Explanation(
        summary=_summary(evidence, best, chosen, metric, refused),
        base_flight=base.number,
        gradient=space.by_name(slopes),
        direction=space.by_name(direction),
        ladder=ladder,
        chosen_length=chosen.length if chosen else None,
        clipped=chosen.clipped if chosen else (),
        notes=tuple(notes),
    )
    gains = space.mapping(base_gains) if chosen is None else chosen.gains
    kind: Kind = "none" if chosen is None else "step" if chosen is best else "shorter step"
    return proposal_of(kind, gains, model.predict(space.vector(gains)), explanation, spread=spread)


def corrected_model(evidence: Evidence[ModelledExperiment]) -> CorrectedModel:
    """The model corrected by the best flight. At least one flight must be valid."""
    return _corrected(evidence)[0]


def _first_allowed_step(
    line: SearchLine,
    best: LadderStep,
    flights: Sequence[Flight],
    model: CorrectedModel,
    passes: Callable[[Vector], bool],
) -> tuple[LadderStep | None, tuple[LadderStep, ...]]:
    """Halve the best step until it was not flown yet and passes the gate; also return the steps that did not pass.

    Gains already flown did not improve on the base, which is the best of all flights. None once a step rounds to the
    base.
    """
    refused: list[LadderStep] = []
    for length in (best.length / 2**halvings for halvings in range(_HALVINGS)):
        gains = line.at(length)
        if np.array_equal(gains, line.base):
            break
        if was_flown(line.space.mapping(gains), flights):
            continue
        step = best if length == best.length else evaluate_lengths(line, (length,), model)[0]
        if passes(gains):
            return step, tuple(refused)
        refused.append(step)
    return None, tuple(refused)


def _summary(
    evidence: Evidence[ModelledExperiment],
    best: LadderStep,
    chosen: LadderStep | None,
    metric: _Metric,
    refused: Sequence[LadderStep],
) -> str:
    unit, base = evidence.experiment.error_unit, evidence.best
    best_so_far = f"flight {base.number} ({format_gains(base.gains)}), error {short(base.error)} {unit}"
    origin = f"The best flight so far is {best_so_far}."
    if chosen is None:
        may = " and pass the gate" if refused else ""
        return (
            f"{origin} Along its gradient the corrected model predicts no better gains that have not been flown{may}."
        )
    if chosen is best:
        return (
            f"{origin} Of {len(metric.ladder)} step sizes along the negative gradient of the model, corrected by that "
            f"flight, a step of {metric.describe(chosen.length)} gives the lowest predicted error: "
            f"{short(chosen.predicted_error)} {unit}."
        )
    aborted = aborted_by_gains(evidence.flights, best.gains)
    why = "is refused by the gate" if refused else "was aborted" if aborted else "did not improve on it"
    return (
        f"{origin} The longer step in the same direction {why}, so the next one is shorter, {chosen.length:.4g} "
        f"instead of {metric.describe(best.length)}; predicted error {short(chosen.predicted_error)} {unit}."
    )


def _corrected(evidence: Evidence[ModelledExperiment]) -> tuple[CorrectedModel, str]:
    """The corrected model, and a sentence about how it is corrected."""
    experiment, base = evidence.experiment, evidence.best
    if evidence.definition.options.get("bias") != "inside":
        return correct_by_bias(experiment, base), f"{_OUTSIDE}."
    if (inside := correct_in_loop(experiment, base)) is not None:
        return inside, "The correction is added to the state in every step, inside the control loop."
    missing = f"flight {base.number} was recorded without all of its state and its command"
    return correct_by_bias(experiment, base), f"{_OUTSIDE}: inside is impossible because {missing}."


GRADIENT: Final = Strategy(
    name="gradient",
    title="Gradient on the corrected model",
    line="The paper's method: the model, corrected by the best flight, gives the direction and the step.",
    options=(
        Option(
            name="scaled",
            title="Scale each gain (off: unscaled, as in the paper)",
            default=True,
            choices=(True, False),
        ),
        Option(
            name="bias",
            title="Correction added outside or inside the control loop",
            default="outside",
            choices=("outside", "inside"),
        ),
        Option(
            name="step_size",
            title="Step size from the line search alone, or limited and diminishing with every iteration",
            default="line-search",
            choices=("line-search", "diminishing"),
        ),
    ),
    propose=propose,
    model=corrected_model,
    kinds=(VerticalLoop, PitchTracking),
)
