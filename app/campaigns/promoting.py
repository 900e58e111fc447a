"""Promotion of a campaign's best gains to its vehicle's safe gains, once flights have shown that they are better."""

from sqlalchemy.orm import Session

from app.accounts.permissions import RequestContext
from app.campaigns import repository
from app.campaigns.schemas import Promotion
from app.campaigns.service import safe_gains_changed
from app.campaigns.statistics import standing_within_bounds_of
from app.common.errors import ConflictError
from app.core.confirming import ComparisonState
from app.core.strategies.history import format_gains
from app.core.wording import percent
from app.db.models import CampaignRow
from app.fleet.registering import promote_gains
from app.fleet.schemas import Vehicle
from app.fleet.service import get_vehicle
from app.trials import history


def promote_best(session: Session, campaign_id: int, asked: Promotion, context: RequestContext) -> Vehicle:
    """Make the best gains the vehicle's safe gains; the act that records this names the flights.

    Raises ConflictError while the best gains are not shown to be better than the first ones, and when the vehicle is
    shared, not at rest, under another operator's control, or was changed meanwhile.
    """
    row = repository.get_one(session, campaign_id)
    now = standing_within_bounds_of(row, history.trials_of(session, campaign_id))
    if now is None or now.comparison is None:
        raise _not_shown(row, "it has no gains that are better than its first ones")
    said = now.comparison
    if said.verdict != "better":
        raise _not_shown(
            row, f"whether {format_gains(now.winner.gains)} is better than its first gains is {said.verdict}"
        )
    gains = dict(now.winner.gains)
    promote_gains(session, row.vehicle, gains, version=asked.version, reason=_because(row, now, asked), context=context)
    safe_gains_changed(session, row.vehicle_id)
    session.flush()
    return get_vehicle(session, row.vehicle_id)


def _because(row: CampaignRow, now: ComparisonState, asked: Promotion) -> str:
    assert now.comparison is not None
    assert now.comparison.confidence is not None
    flights = ", ".join(map(str, now.winner.numbers))
    sure = percent(now.comparison.confidence)
    return f"{asked.statement} (campaign {row.id}, flights {flights}: better, {sure} confidence)"


def _not_shown(row: CampaignRow, why: str) -> ConflictError:
    return ConflictError(
        f"No gains of campaign {row.id} can be promoted: {why}.",
        hint="Fly the best gains and the first ones again until the statistics say “better”.",
    )
