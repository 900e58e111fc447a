"""Fit the model to all flights, then choose its optimal gains.

The model is that of the experiment (`app.core.tuning.campaign_models`). The choice is its optimum over a few plausible
vehicles inside a trust region around the best flight. A step that the gate would refuse is halved until it passes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.definition import Flight, aborted_by_gains, was_flown
from app.core.experiments.base import ModelledExperiment
from app.core.formatting import count, format_gains, named_flights, percent, percent_of, plus_minus, short
from app.core.policy import Box, PolicySpace, Vector
from app.core.tuning.campaign_models import FITTED, CampaignModel, fit
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import allows
from app.core.tuning.predictions import FlightPrediction
from app.core.tuning.strategy import Explanation, Kind, Proposal, Strategy, proposal_of

_HALVINGS: Final = 5
_DIFFERENCE: Final = 0.1
_SHRINK: Final = 0.5
_GROW: Final = 2.0


@dataclass(frozen=True, slots=True)
class _ChosenGains:
    """Gains to fly, shape (n,), how they were chosen, and the unshortened optimum."""

    kind: Kind
    gains: Vector
    optimum: Vector
    notes: tuple[str, ...] = ()


def propose(evidence: Evidence[ModelledExperiment]) -> Proposal:
    """Propose the optimum of the calibrated model, within the trust region. At least one flight must be valid.

    Raises TypeError for experiments without such a model, and TrajectoryError if a record does not suffice for it.
    """
    space, flights, model = evidence.space, evidence.flights, fit(evidence)
    base = model.base
    fraction = min(trust_fraction(flights), evidence.definition.step_fraction)
    box = Box(*space.reachable(space.vector(base.gains), fraction))
    choice = _choose(evidence, model, box)
    prediction = model.predict(choice.gains)
    at_end = space.names_where((choice.optimum <= box.low) | (choice.optimum >= box.high))
    explanation = Explanation(
        summary=_summary(evidence.experiment, model, choice, prediction) + _describe_limit(fraction, flights),
        base_flight=base.number,
        gradient=_gradient(space, space.nearest(space.vector(base.gains)), model),
        direction=space.by_name(choice.gains - space.vector(base.gains)),
        clipped=tuple(name for name in at_end if name in model.searched),
        notes=(
            *choice.notes,
            *model.notes(choice.gains),
            "The deviation of the best flight from the model is added inside the control loop.",
        ),
        lesson=_describe_lesson(model, prediction),
        fitted=model.fitted,
        trust_fraction=fraction,
    )
    return proposal_of(choice.kind, space.mapping(choice.gains), prediction, explanation, spread=model.spread)


def trust_fraction(flights: Sequence[Flight]) -> float:
    """Allowed step as a share of each gain's range, at most 1, from the flights in order.

    Starts at the whole range. Halved after a flight aborted because of its gains, and after one whose error exceeds its
    predicted interval; doubled after one inside the interval. The first valid flight is ignored, because its prediction
    did not come from a calibrated model.
    """
    fraction, is_calibrated = 1.0, False
    for flight in flights:
        if flight.outcome == "aborted":
            fraction *= _SHRINK if flight.against_gains else 1.0
        elif is_calibrated and flight.error is not None and flight.predicted and flight.predicted.interval:
            if flight.error > flight.predicted.interval.upper:
                fraction *= _SHRINK
            elif flight.error in flight.predicted.interval:
                fraction = min(fraction * _GROW, 1.0)
        is_calibrated = is_calibrated or flight.outcome == "valid"
    return fraction


def _choose(evidence: Evidence[ModelledExperiment], model: CampaignModel, box: Box) -> _ChosenGains:
    space, flights = evidence.space, evidence.flights
    here = space.nearest(space.vector(model.base.gains))
    optimum = model.optimum(box)
    if optimum is None:
        return _ChosenGains("none", here, here, (_NONE_ALLOWED,))
    if not model.is_worth_a_flight(here, optimum) and was_flown(space.mapping(here), flights):
        return _ChosenGains("none", here, optimum)
    for halvings in range(_HALVINGS):
        gains = np.clip(model.rounded(here + (optimum - here) / 2**halvings), box.low, box.high)
        if was_flown(space.mapping(gains), evidence.valid):
            break
        if was_flown(space.mapping(gains), flights):
            continue
        if allows(evidence, gains, model.spread):
            if halvings == 0:
                return _ChosenGains("step", gains, optimum)
            note = (
                f"The full step, to {format_gains(space.mapping(optimum))}, was aborted before or is refused by the "
                "gate."
            )
            return _ChosenGains("shorter step", gains, optimum, (note,))
    note = f"Every step towards {format_gains(space.mapping(optimum))} was flown before or is refused by the gate."
    return _ChosenGains("none", here, optimum, (note,))


_NONE_ALLOWED: Final = (
    "No gains that may be flown next keep the margin from ringing on every likely vehicle. Choose gentler gains, or "
    "reduce the lags of motors and filters."
)


def _gradient(space: PolicySpace, base: Vector, model: CampaignModel) -> dict[str, float]:
    """∂merit/∂gain at the best flight by central differences; zero for a pinned gain."""
    steps = _DIFFERENCE * space.scale
    whole = [gain.integer for gain in space.gains]
    return space.by_name(space.slopes(model.merits, base, np.where(whole, np.maximum(np.rint(steps), 1.0), steps)))


def _summary(
    experiment: ModelledExperiment, model: CampaignModel, choice: _ChosenGains, prediction: FlightPrediction
) -> str:
    unit, base = experiment.error_unit, model.base
    subject = f"The model, calibrated on {count(len(model.numbers), 'flight')},"
    best = f"flight {base.number} ({format_gains(base.gains)}, error {short(base.error)} {unit})"
    if choice.kind == "none":
        return (
            f"{subject} predicts no allowed gains that are better than {best} by {percent(model.least_improvement, 1)}."
        )
    low, high = prediction.interval.lower, prediction.interval.upper
    assert base.error is not None
    gained = base.error - prediction.error
    amount = f"{percent_of(gained, base.error)} {'less' if gained >= 0.0 else 'more'} error than {best}".strip()
    return (
        f"{subject} predicts {short(prediction.error)} {unit} ({percent(prediction.interval.confidence)} interval "
        f"{short(low)} … {short(high)} {unit}), {amount}."
    )


def _describe_limit(fraction: float, flights: Sequence[Flight]) -> str:
    """What the aborts that count against their gains leave of the trust region, as a further sentence."""
    aborted = [flight.number for flight in aborted_by_gains(flights)]
    if not aborted or fraction >= 1.0:
        return ""
    halved = "halved" if len(aborted) == 1 else "each halved"
    return (
        f" {named_flights(aborted).capitalize()} counted against the gains and {halved} the largest allowed step: now "
        f"{percent(fraction)} of each gain's range."
    )


def _describe_lesson(model: CampaignModel, prediction: FlightPrediction) -> str:
    """The parameter to which the predicted error is most sensitive, as a sentence."""
    values = prediction.models - prediction.models.mean(axis=0)
    errors = prediction.errors - prediction.errors.mean()
    spread = np.linalg.norm(values, axis=0)
    shares = np.divide(np.abs(errors @ values), spread, out=np.zeros_like(spread), where=spread > 0.0)
    most = model.fitted[int(np.argmax(np.round(shares, 9)))]
    return (
        f"Mostly {most.title.lower()}, now {plus_minus(most.value, most.standard_error, most.unit)}: it contributes "
        "most to the uncertainty of the predicted error."
    )


CALIBRATED: Final = Strategy(
    name="calibrated",
    title="Calibrated model",
    line="Fits the model to all flights and flies its robust optimum. Typically two flights.",
    options=(),
    propose=propose,
    model=fit,
    kinds=FITTED,
)
