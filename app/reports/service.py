"""Collects the content of a report: the API's own views, without computing anything new."""

from collections.abc import Callable, Iterator
from typing import Final, TypeVar

from sqlalchemy.orm import Session

from app import __version__
from app.campaigns import figure_data
from app.campaigns import service as campaigns
from app.campaigns.landscapes import landscape_card
from app.campaigns.schemas import Campaign
from app.campaigns.statistics import campaign_statistics
from app.campaigns.trials import service as trials_service
from app.campaigns.trials.schemas import Trial
from app.common.schemas import Page
from app.db.trajectories import damaged_trials
from app.db.types import utc_now
from app.figures import CAMPAIGN_FIGURES
from app.figures.base import card_of
from app.fleet import service as fleet
from app.fleet.views import acts_view, ledger_view
from app.reports import sections
from app.reports.sections import (
    Anomaly,
    Report,
    describe_method,
    describe_safe_gains,
    describe_vehicle,
    experiment_of,
)

_PAGE: Final = 200
T = TypeVar("T")


def report_of(session: Session, campaign_id: int) -> Report:
    """Collect all data of a campaign, as for one reader. Raises NotFoundError."""
    campaign = campaigns.get_campaign(session, campaign_id)
    statistics = campaign_statistics(session, campaign_id)
    trials = tuple(_all(lambda cursor: trials_service.list_trials(session, campaign_id, limit=_PAGE, cursor=cursor)))
    experiment = experiment_of(campaign)
    vehicle = fleet.get_vehicle(session, campaign.vehicle.id)
    past = figure_data.history_of(session, campaign_id, curves=True)
    landscape = landscape_card(session, campaign_id, "light", stacked=True).card
    return Report(
        campaign=campaign,
        statistics=statistics,
        trials=trials,
        experiment=experiment.title,
        gains=experiment.space.gains,
        what=describe_vehicle(
            campaign,
            experiment,
            vehicle.identity,
            describe_safe_gains(campaigns.get_row(session, campaign_id).safe_gains, vehicle.safe_gains),
        ),
        how=describe_method(campaign, experiment),
        cards=(
            *(card_of(figure(past, "light")) for figure in CAMPAIGN_FIGURES.values()),
            *((landscape,) if landscape.state == "ready" else ()),  # only if it has been computed already
        ),
        remarks=tuple(sections.remarks_on(session, campaign_id, trials)),
        photo_bytes=sections.MAX_BYTES,
        anomalies=tuple(_anomalies(session, campaign, trials, statistics.error_unit)),
        version=__version__,
        made_at=utc_now(),
    )


def _anomalies(session: Session, campaign: Campaign, trials: tuple[Trial, ...], unit: str) -> Iterator[Anomaly]:
    yield from sections.of_flights(trials, unit)
    yield from (Anomaly(row.number, "Damaged record", sections.DAMAGED) for row in damaged_trials(session, campaign.id))
    if not campaign.vehicle.registered:
        return
    vehicle_id = campaign.vehicle.id
    yield from sections.of_vehicle(
        campaign,
        fleet.get_vehicle(session, vehicle_id),
        _all(lambda cursor: acts_view(session, vehicle_id, limit=_PAGE, cursor=cursor)),
        _all(lambda cursor: ledger_view(session, vehicle_id, limit=_PAGE, cursor=cursor)),
        trials,
    )


def _all(page_after: Callable[[str | None], Page[T]]) -> Iterator[T]:
    """All items of a paginated list."""
    cursor = None
    while True:
        page = page_after(cursor)
        yield from page.items
        if (cursor := page.next_cursor) is None:
            return
