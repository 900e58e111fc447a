"""History of a vehicle over all its campaigns: its calibrations over its flights, whether they show wear, and its
batteries. The gains written to it and what was asked of it are in `fleet.views`."""

from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.common.schemas import Schema
from app.core.experiments.base import Fitted
from app.core.statistics.drift import MONITORED_PARAMETERS, drift
from app.db.models import CampaignRow, ProposalRow
from app.figures.base import Card, card_of
from app.figures.theme import ThemeName
from app.figures.vehicle_history import BatteriesFigure, CalibrationFigure, Point
from app.fleet import service as fleet

_STRATEGY: Final = "calibrated"


class Estimate(Schema):
    """One calibration. `flight` counts the vehicle's flights over all its campaigns."""

    flight: int
    campaign_id: int
    trial_number: int
    proposal_id: int
    at: datetime
    fitted: list[Fitted]


class Retune(Schema):
    """Whether the vehicle should be tuned again; `since` is the flight after which it was last tuned."""

    due: bool
    since: int | None
    drifted: list[str]
    sentence: str


class VehicleCalibration(Schema):
    """The vehicle's calibrations, oldest first, and whether the vehicle has changed since it was tuned."""

    estimates: list[Estimate]
    retune: Retune


def calibration_of(session: Session, vehicle_id: int) -> VehicleCalibration:
    """Calibrations of a vehicle. Raises NotFoundError.

    For a shared simulation only campaigns with its latest settings count, because other settings make another vehicle.
    """
    estimates, ends = _estimates(session, vehicle_id)
    return VehicleCalibration(estimates=estimates, retune=_retune(estimates, ends))


def vehicle_figure(session: Session, vehicle_id: int, name: str, theme: ThemeName) -> Card:
    """Figure of a vehicle: `calibration` or `batteries`. Raises NotFoundError."""
    if name == "batteries":
        fleet.get_vehicle(session, vehicle_id)
        return card_of(BatteriesFigure(tuple(fleet.battery_flights(session, vehicle_id)), theme_name=theme))
    found = calibration_of(session, vehicle_id)
    points = tuple(
        Point(flight=one.flight, campaign_id=one.campaign_id, trial_number=one.trial_number, fitted=_by_name(one))
        for one in found.estimates
    )
    return card_of(CalibrationFigure(points, found.retune.since, found.retune.sentence, theme_name=theme))


def _estimates(session: Session, vehicle_id: int) -> tuple[list[Estimate], list[int]]:
    """The calibrations in the order of the flights, and the flights after which the vehicle counts as tuned."""
    vehicle = fleet.get_vehicle(session, vehicle_id)
    campaigns = repository.of_vehicle(session, vehicle_id)
    if not vehicle.registered and campaigns:
        calibrated = [row for row in campaigns if row.strategy == _STRATEGY]
        latest = (calibrated or campaigns)[-1].vehicle_options
        campaigns = [row for row in campaigns if row.vehicle_options == latest]
    trials = history.trials_of(session, *(row.id for row in campaigns))
    flown = sorted((row for row in trials if row.flown_at is not None), key=lambda row: (str(row.flown_at), row.id))
    counts = {(row.campaign_id, row.number): place for place, row in enumerate(flown, start=1)}
    found = sorted(_fits(session, campaigns, counts), key=lambda one: (one.flight, one.proposal_id))
    over = {row.id for row in campaigns if row.outcome is not None}
    last = {one.campaign_id: one.flight for one in found}
    ends = [one.flight for one in found if one.campaign_id in over and one.flight == last[one.campaign_id]]
    ends += [
        max(before)
        for at in fleet.safe_gains_changes(session, vehicle_id)
        if (before := [one.flight for one in found if one.at <= at])
    ]
    return found, ends


def _fits(session: Session, campaigns: Sequence[CampaignRow], counts: dict[tuple[int, int], int]) -> Iterator[Estimate]:
    """The newest calibration after each flight."""
    for campaign in campaigns:
        if campaign.strategy != _STRATEGY:
            continue
        newest: dict[int, tuple[ProposalRow, int]] = {}
        for row in repository.proposals(session, campaign.id):
            numbers = (row.spread or {}).get("flights") or []
            known = [counts[campaign.id, number] for number in numbers if (campaign.id, number) in counts]
            if known and row.explanation.get("fitted"):
                newest[max(known)] = row, max(numbers)
        for flight, (row, number) in newest.items():
            fitted = {each["name"]: each for each in row.explanation["fitted"]}
            yield Estimate(
                flight=flight,
                campaign_id=row.campaign_id,
                trial_number=number,
                proposal_id=row.id,
                at=row.computed_at,
                fitted=[fitted[name] for name in MONITORED_PARAMETERS if name in fitted],
            )


def _retune(estimates: Sequence[Estimate], ends: Sequence[int]) -> Retune:
    since = max(ends, default=None)
    if not estimates:
        finding = "No data yet: no campaign with the calibrated model has flown on this vehicle."
    elif since is None:
        finding = "No verdict yet: no campaign with the calibrated model is finished on this vehicle."
    else:
        tuned = next(one for one in reversed(estimates) if one.flight == since)
        if tuned is not estimates[-1]:
            return Retune.view_of(drift(_by_name(tuned), _by_name(estimates[-1])), since=since)
        finding = f"Tuned with flight {since}; no campaign with the calibrated model has flown since."
    return Retune(due=False, since=since, drifted=[], sentence=finding)


def _by_name(one: Estimate) -> dict[str, Fitted]:
    return {each.name: each for each in one.fitted}
