"""Fit the model to all flights, then choose its optimal gains.

The choice is the robust optimum over a few plausible models inside a trust region around the best flight
(`trust_region`). A step that the gate would refuse is halved until it passes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from app.core.definition import Definition, Flight, aborted_by_gains, best_flight, was_flown
from app.core.experiments.base import Matrix, ModelledExperiment
from app.core.experiments.vertical_loop import VerticalLoop
from app.core.formatting import count, format_gains, named_flights, percent, plus_minus, short
from app.core.policy import PolicySpace, Vector
from app.core.tuning.calibration import Calibration, calibrate
from app.core.tuning.gate import allows
from app.core.tuning.predictions import FlightPrediction, predict_errors, predict_flight
from app.core.tuning.strategy import ErrorsOf, Explanation, Kind, ModelPrediction, PredictionOf, Proposal, Strategy
from app.core.tuning.trust_region import Box, find_robust_optimum, merit, trust_fraction

MODELS: Final = 8
ROBUSTNESS_SD: Final = 0.75
"""Distance of the models from the fit in the robust optimisation, in standard deviations. A larger value increases the
error on vehicles that match the fit, a smaller one on those that do not."""
MIN_IMPROVEMENT: Final = 0.005
"""A step predicted to improve the error by less than this share is not worth a flight."""

_HALVINGS: Final = 5
_DIFFERENCE: Final = 0.1


@dataclass(frozen=True, slots=True)
class _ChosenGains:
    """Gains to fly, shape (n,), how they were chosen, and the unshortened optimum."""

    kind: Kind
    gains: Vector
    optimum: Vector
    notes: tuple[str, ...] = ()


def propose(
    definition: Definition, experiment: ModelledExperiment, space: PolicySpace, flights: Sequence[Flight]
) -> Proposal:
    """Propose the robust optimum of the calibrated model, within the trust region. At least one flight must be valid.

    Raises TypeError for experiments that are not under the vertical loop.
    """
    if not isinstance(experiment, VerticalLoop):
        raise TypeError(f"calibrated works only under the vertical loop, not with {experiment.name}")
    calibration, base = _calibrated(experiment, flights)
    models = calibration.plausible(runs=MODELS, width=ROBUSTNESS_SD)
    fraction = min(trust_fraction(flights), definition.step_fraction)
    box = Box(*space.reachable(space.vector(base.gains), fraction))
    choice = _choose(definition, experiment, space, flights, calibration, base, models, box)
    prediction = predict_flight(calibration, base, choice.gains)
    clipped = space.names_where((choice.optimum <= box.low) | (choice.optimum >= box.high))
    explanation = Explanation(
        summary=_summary(experiment, base, choice, prediction, len(calibration.numbers))
        + _describe_limit(fraction, flights),
        base_flight=base.number,
        gradient=_gradient(experiment, space, space.nearest(space.vector(base.gains)), models),
        direction=space.by_name(choice.gains - space.vector(base.gains)),
        clipped=clipped,
        notes=(*choice.notes, "The deviation of the best flight from the model is added inside the control loop."),
        lesson=_describe_lesson(calibration, prediction),
        fitted=calibration.fitted,
        trust_fraction=fraction,
    )
    return Proposal(
        kind=choice.kind,
        gains=space.mapping(choice.gains),
        predicted=prediction.trajectory,
        predicted_error=prediction.error,
        explanation=explanation,
        interval=prediction.interval,
        spread=calibration.spread(),
    )


def error_model(_definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> ErrorsOf:
    """The errors predicted by the calibrated model. At least one flight must be valid."""
    return partial(predict_errors, *_calibrated(experiment, flights))


def flight_model(_definition: Definition, experiment: ModelledExperiment, flights: Sequence[Flight]) -> PredictionOf:
    """The flights predicted by the calibrated model. At least one flight must be valid."""
    return partial(_predict, *_calibrated(experiment, flights))


def _calibrated(experiment: ModelledExperiment, flights: Sequence[Flight]) -> tuple[Calibration, Flight]:
    """The calibration, and the best of its flights."""
    calibration = calibrate(experiment, flights)
    return calibration, best_flight([flight for flight in flights if flight.number in calibration.numbers])


def _predict(calibration: Calibration, base: Flight, gains: Vector) -> ModelPrediction:
    found = predict_flight(calibration, base, gains)
    return ModelPrediction(found.trajectory, found.error, found.interval)


def _choose(
    definition: Definition,
    experiment: VerticalLoop,
    space: PolicySpace,
    flights: Sequence[Flight],
    calibration: Calibration,
    base: Flight,
    models: Matrix,
    box: Box,
) -> _ChosenGains:
    here = space.nearest(space.vector(base.gains))
    optimum = find_robust_optimum(experiment, box, models, here[np.newaxis])
    now, then = merit(experiment, np.stack((here, optimum)), models).tolist()
    if then > (1.0 - MIN_IMPROVEMENT) * now and was_flown(space.mapping(here), flights):
        return _ChosenGains("none", here, optimum)
    for halvings in range(_HALVINGS):
        gains = box.nearest(here + (optimum - here) / 2**halvings)
        if was_flown(space.mapping(gains), [flight for flight in flights if flight.outcome == "valid"]):
            break
        if was_flown(space.mapping(gains), flights):
            continue
        if allows(definition, experiment, gains, calibration.spread()):
            if halvings == 0:
                return _ChosenGains("step", gains, optimum)
            note = (
                f"The full step, to {format_gains(space.mapping(optimum))}, was aborted before or is refused by the "
                "gate."
            )
            return _ChosenGains("shorter step", gains, optimum, (note,))
    note = f"Every step towards {format_gains(space.mapping(optimum))} was flown before or is refused by the gate."
    return _ChosenGains("none", here, optimum, (note,))


def _gradient(experiment: VerticalLoop, space: PolicySpace, base: Vector, models: Matrix) -> dict[str, float]:
    """∂merit/∂gain at the best flight by central differences; zero for a pinned gain."""
    steps = np.diag(np.maximum(np.rint(_DIFFERENCE * experiment.space.scale), 1.0))
    above, below = np.minimum(base + steps, space.upper), np.maximum(base - steps, space.lower)
    errors = merit(experiment, np.concatenate((above, below)), models)
    run = np.diag(above - below)
    rise = errors[: len(base)] - errors[len(base) :]
    return space.by_name(np.divide(rise, run, out=np.zeros_like(rise), where=run != 0.0))


def _summary(
    experiment: ModelledExperiment, base: Flight, choice: _ChosenGains, prediction: FlightPrediction, flights: int
) -> str:
    unit = experiment.error_unit
    subject = f"The model, calibrated on {count(flights, 'flight')},"
    best = f"flight {base.number} ({format_gains(base.gains)}, error {short(base.error)} {unit})"
    if choice.kind == "none":
        return f"{subject} predicts no allowed gains that are better than {best} by {percent(MIN_IMPROVEMENT, 1)}."
    low, high = prediction.interval.lower, prediction.interval.upper
    assert base.error is not None
    share = 1.0 - prediction.error / base.error
    return (
        f"{subject} predicts {short(prediction.error)} {unit} ({percent(prediction.interval.confidence)} interval "
        f"{short(low)} … {short(high)} {unit}), {percent(abs(share))} {'less' if share >= 0.0 else 'more'} error than "
        f"{best}."
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


def _describe_lesson(calibration: Calibration, prediction: FlightPrediction) -> str:
    """The parameter to which the predicted error is most sensitive, as a sentence."""
    values = prediction.models - prediction.models.mean(axis=0)
    errors = prediction.errors - prediction.errors.mean()
    spread = np.linalg.norm(values, axis=0)
    shares = np.divide(np.abs(errors @ values), spread, out=np.zeros_like(spread), where=spread > 0.0)
    most = calibration.fitted[int(np.argmax(np.round(shares, 9)))]
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
    predict_errors=error_model,
    predict_flight=flight_model,
    experiments=("takeoff", "altitude-steps"),
)
