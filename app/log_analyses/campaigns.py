"""A campaign that begins with the takeoffs of a log."""

from collections.abc import Sequence
from pathlib import PurePath
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import RequestContext
from app.campaigns import service as campaigns
from app.campaigns.schemas import Campaign, Definition, NewCampaign, StopRule
from app.campaigns.trials.records import plan_and_import
from app.campaigns.trials.schemas import TrialPlan
from app.campaigns.trials.service import evaluate_gate
from app.common.schemas import uploaded_name
from app.core.experiments.takeoff import Takeoff as Experiment
from app.core.policy import Gains
from app.core.tuning.logged_takeoffs import comparable_takeoffs
from app.fleet.schemas import VehicleChoice
from app.log_analyses.takeoffs import logged_takeoffs
from app.logs.takeoffs import Takeoff

_UNNAMED: Final = "Log"
_FURTHER_FLIGHTS: Final = 6


def start_campaign(session: Session, found: Sequence[Takeoff], context: RequestContext, *, name: str) -> Campaign:
    """Create a campaign of a vehicle flown elsewhere with the takeoffs that an analysis of the log uses, scored over
    the same window. `name` is the log's file name, as uploaded.

    Raises TrajectoryError if no takeoff can be used, InputError that names what a record lacks.
    """
    name = uploaded_name(name, unnamed=_UNNAMED)
    used, window_s = comparable_takeoffs(logged_takeoffs(found, name=name))
    records = {each.number: each for each in found}
    campaign_id = campaigns.create_ready_campaign(
        session,
        NewCampaign(
            name=PurePath(name).stem.strip() or _UNNAMED,
            vehicle=VehicleChoice(kind="import"),
            definition=Definition(
                experiment_options={"window_s": window_s}, stop=StopRule(max_flights=len(used) + _FURTHER_FLIGHTS)
            ),
        ),
    )
    for each in used:
        plan = TrialPlan(gains=_planned(session, campaign_id, each.gains), note=f"Takeoff {each.number} of {name}")
        plan_and_import(session, campaign_id, plan, records[each.number], context, confirmed=True, invalid=False)
    return campaigns.get_campaign(session, campaign_id)


def _planned(session: Session, campaign_id: int, flown: Gains) -> dict[str, float]:
    """The gains to plan: those flown, or the default ones where the gate refuses these; the record corrects them."""
    passed = evaluate_gate(session, campaign_id, flown).passed
    return dict(flown if passed else Experiment.space.mapping(Experiment.space.default))
