"""Statistics of a campaign's flights, as the API sends them."""

from collections.abc import Sequence
from typing import Annotated, Final

from pydantic import Field
from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.campaigns.definitions import flown_evidence
from app.campaigns.schemas import BestTrial
from app.common.schemas import Gains, Schema
from app.core.experiments.base import Experiment
from app.core.formatting import confidence_text, count, format_gains, percent, plus_minus, short, signed
from app.core.statistics.comparisons import Verdict, drift_of, optimism, trend_of
from app.core.tuning import predictions
from app.core.tuning.evidence import Evidence
from app.core.tuning.stop_rules import verdict_sentence
from app.db.models import TrialRow, VehicleRow
from app.fleet import service as fleet

_SURE: Final = 0.9
_NO_OPTIMISM: Final = 0.05
"""Smaller optimism, as a share of a standard error, is not mentioned."""

_LEAST_OPTIMISM: Final = 1e-9
"""Smaller optimism, in units of the error, is what the numerical integral leaves of zero."""


class RepeatGroup(Schema):
    """The valid flights of one gain set."""

    gains: Gains
    trial_numbers: list[int]
    errors: list[float]
    mean: float
    standard_error: Annotated[float | None, Field(description="from the pooled scatter; null while that is unknown")]
    is_baseline: bool
    is_best: bool


class FlightsToDecide(Schema):
    """Further flights of each gain set after which an unchanged difference would be decided."""

    best: int
    baseline: int


class Comparison(Schema):
    """The best gains compared with the first flight's. `difference` is best − baseline; `confidence` that of the
    likelier direction, with the allowance for having chosen the best among several. While the scatter of flights is
    unknown, the verdict is `not known yet`, without confidence and standard error."""

    verdict: Verdict
    confidence: float | None
    difference: float
    standard_error: float | None
    further: FlightsToDecide | None
    sentence: str


class Drift(Schema):
    """Change of the error with the same gains over the campaign: `confidence` that anything has changed; `resolved`
    from 90 % on."""

    first_trial: int
    last_trial: int
    difference: float
    standard_error: float
    confidence: float
    resolved: bool
    sentence: str


class Trend(Schema):
    """Slope of the error of the gains flown most often against the battery voltage, with its 90 % interval."""

    unit: str
    slope: float
    lower: float
    upper: float
    sentence: str


class TrackRecord(Schema):
    """How well the predictions held."""

    inside: int
    of: int
    share: float | None
    agreeing: int
    disagreeing: int
    trustworthy: bool
    sentence: str


class CampaignStatistics(Schema):
    """Statistics of the campaign's flights. `sigma` is the flight-to-flight scatter, pooled over all repeats and the
    experiment's prior; null while unknown, that is before the first repeat under an autopilot whose scatter was never
    measured, and zero if all repeats gave the same error. `scatter_source` states its source. `optimism` is how
    much the best is expected to look better than it is because it was chosen, and `shrunk_error` its error corrected
    for that."""

    error_unit: str
    confidence: float
    sigma: float | None
    degrees_of_freedom: float
    scatter_source: str
    groups: list[RepeatGroup]
    comparison: Comparison | None
    drift: Drift | None
    battery_trend: Trend | None
    optimism: float
    shrunk_error: float | None
    track_record: TrackRecord
    notes: list[str]


def campaign_statistics(session: Session, campaign_id: int) -> CampaignStatistics:
    """Statistics of a campaign. Raises NotFoundError."""
    row = repository.get_campaign(session, campaign_id)
    trials = history.trials_of(session, campaign_id)
    now = flown_evidence(row, trials)
    experiment, groups, scatter = now.experiment, now.groups, now.scatter
    expected = 0.0
    if groups and scatter.reported is not None:
        bias = optimism([group.mean for group in groups], [group.standard_error(scatter) for group in groups])
        expected = bias if bias >= _LEAST_OPTIMISM else 0.0
    record = predictions.track_record(now.flights)
    drift = None if scatter.identical else _drift(now)
    return CampaignStatistics(
        error_unit=experiment.error_unit,
        confidence=now.definition.stop.confidence,
        sigma=0.0 if scatter.identical else scatter.reported,
        degrees_of_freedom=scatter.degrees_of_freedom if scatter.known else 0.0,
        scatter_source=_scatter_source(now, row.vehicle),
        groups=[
            RepeatGroup.view_of(
                group,
                trial_numbers=group.numbers,
                standard_error=group.known_error(scatter),
                is_baseline=group is now.baseline,
                is_best=group is now.winner,
            )
            for group in groups
        ],
        comparison=_comparison(now),
        drift=drift,
        battery_trend=_battery_trend(now, trials),
        optimism=expected,
        shrunk_error=now.winner.mean + expected if groups and scatter.reported is not None else None,
        track_record=TrackRecord.model_validate(record, from_attributes=True),
        notes=_notes(now, expected, drift, record) if groups else [],
    )


def _scatter_source(now: Evidence[Experiment], vehicle: VehicleRow) -> str:
    """What the scatter of one flight was estimated from: repeats, prior, or both."""
    prior, scatter, repeats = now.experiment.scatter, now.scatter, sum(group.size - 1 for group in now.groups)
    estimate = f"prior estimate of {prior.sd:.3g} {now.experiment.error_unit}"
    if not scatter.known:
        return "Not measured for this autopilot, and no gain set has two valid flights. Fly a gain set again."
    if scatter.identical:
        finding = f"{count(repeats, 'repeat')} gave the same error"
        if vehicle.is_real or not fleet.can_fly(vehicle):
            return f"{finding}, to the last digit. Check that no log was imported twice."
        assumed = f" Comparisons still assume the {estimate}." if prior.measured else ""
        return f"No scatter in this simulation: {finding}.{assumed}"
    if not prior.measured:
        return f"From {count(repeats, 'repeat')}."
    worth = f"{prior.degrees_of_freedom:g} degrees of freedom"
    if not repeats:
        return f"From a {estimate} ({worth}): no gain set has two valid flights."
    return f"From {count(repeats, 'repeat')} and a {estimate} ({worth})."


def best_trial(trials: Sequence[TrialRow], now: Evidence[Experiment]) -> BestTrial | None:
    """The valid trial with the lowest error and the mean of its gains."""
    best = history.best_of(trials)
    if best is None:
        return None
    group = next(group for group in now.groups if best.number in group.numbers)
    return BestTrial.view_of(
        best,
        trial_id=best.id,
        trial_number=best.number,
        mean=group.mean,
        standard_error=group.known_error(now.scatter),
        flights=group.size,
    )


def _comparison(now: Evidence[Experiment]) -> Comparison | None:
    comparison = now.comparison
    if comparison is None:
        return None
    return Comparison.view_of(
        comparison,
        further=None
        if comparison.further is None
        else FlightsToDecide(best=comparison.further.first, baseline=comparison.further.second),
        sentence=verdict_sentence(now),
    )


def _drift(now: Evidence[Experiment]) -> Drift | None:
    found = drift_of(now.groups, now.scatter)
    if found is None:
        return None
    unit, is_resolved = now.experiment.error_unit, found.confidence >= _SURE
    amount = plus_minus(found.difference, found.standard_error, unit, sign="+")
    sentence = (
        f"{'The vehicle has drifted' if is_resolved else 'No drift resolved'}: from flight {found.first_number} to "
        f"{found.last_number} the trend of the error with the same gains is {amount} "
        f"({confidence_text(found.confidence)} confidence)."
    )
    return Drift.view_of(
        found,
        first_trial=found.first_number,
        last_trial=found.last_number,
        resolved=is_resolved,
        sentence=sentence,
    )


def _battery_trend(now: Evidence[Experiment], trials: Sequence[TrialRow]) -> Trend | None:
    """Slope of the error of the gains flown most often by battery voltage, where that was measured."""
    if not now.groups:
        return None
    group = max(now.groups, key=lambda group: group.size)
    voltages = {row.number: row.landing_battery_v for row in trials}
    measured = [
        (volts, error)
        for number, error in zip(group.numbers, group.errors, strict=True)
        if (volts := voltages[number]) is not None
    ]
    found = trend_of([volts for volts, _ in measured], [error for _, error in measured], _SURE)
    if found is None:
        return None
    unit = f"{now.experiment.error_unit} per V"
    relation = "changes with" if found.is_resolved else "shows no dependence on"
    return Trend.view_of(
        found,
        unit=unit,
        sentence=f"The error {relation} the battery voltage: {signed(found.slope)} {unit}, {percent(_SURE)} interval "
        f"{signed(found.lower)} … {signed(found.upper)} {unit}.",
    )


def _notes(
    now: Evidence[Experiment], expected: float, drift: Drift | None, record: predictions.TrackRecord
) -> list[str]:
    unit = now.experiment.error_unit
    notes = [verdict_sentence(now)]
    if expected > _NO_OPTIMISM * now.winner.standard_error(now.scatter):
        notes.append(
            f"The best of {len(now.groups)} gain sets ({format_gains(now.winner.gains)}) looks better than it is "
            f"by {short(expected)} {unit} on average, because the lowest was selected. "
            f"Its expected error is closer to {short(now.winner.mean + expected)} {unit}."
        )
    if drift is not None:
        notes.append(drift.sentence)
    if not record.trustworthy:
        notes.append(record.sentence)
    return notes
