"""A campaign that begins with the takeoffs of a log, or with the gains proposed from one."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import PurePath
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import RequestContext
from app.autopilots.takeoffs import Takeoff
from app.campaigns import service as campaigns
from app.campaigns.schemas import Campaign, Definition, LogEvidence, NewCampaign, Start, StopRule
from app.campaigns.trials.records import plan_and_import
from app.campaigns.trials.schemas import TrialPlan
from app.campaigns.trials.service import evaluate_gate
from app.common.schemas import uploaded_name
from app.core.experiments.takeoff import Takeoff as Experiment
from app.core.tuning.logged_takeoffs import comparable_takeoffs
from app.fleet import service as fleet
from app.fleet.schemas import VehicleChoice
from app.log_analyses.manoeuvres import CopterStart
from app.log_analyses.takeoffs import logged_takeoffs

_UNNAMED: Final = "Log"
_FURTHER_FLIGHTS: Final = 6


def start_campaign(
    session: Session,
    found: Sequence[Takeoff] | CopterStart,
    context: RequestContext,
    *,
    name: str,
    vehicle_id: int | None = None,
) -> Campaign:
    """Create the campaign of a log. `name` is its file name, as uploaded; `vehicle_id` names a registered copter.

    Raises TrajectoryError if no takeoff can be used, InputError that names what a record or the vehicle lacks.
    """
    name = uploaded_name(name, unnamed=_UNNAMED)
    if isinstance(found, CopterStart):
        return _start_steps(session, found, name=name, vehicle_id=vehicle_id)
    return _start_takeoffs(session, found, context, name=name)


def _start_steps(session: Session, found: CopterStart, *, name: str, vehicle_id: int | None) -> Campaign:
    """A draft for a registered vehicle, by default the only one that flies the steps."""
    choice = fleet.registered_for(session, found.experiment, vehicle_id)
    log = LogEvidence(**{**asdict(found.log), "file_name": name})
    definition = Definition(experiment=found.experiment, start=Start(kind="given", gains=dict(found.gains), log=log))
    return campaigns.create_campaign(
        session, NewCampaign(name=PurePath(name).stem.strip() or _UNNAMED, vehicle=choice, definition=definition)
    )


def _start_takeoffs(session: Session, found: Sequence[Takeoff], context: RequestContext, *, name: str) -> Campaign:
    """A campaign of a vehicle flown elsewhere with the takeoffs that an analysis uses, scored over the same window."""
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
        passed = evaluate_gate(session, campaign_id, each.gains).passed  # if not, the record corrects the gains
        planned = dict(each.gains) if passed else Experiment.space.mapping(Experiment.space.default)
        plan = TrialPlan(gains=planned, note=f"Takeoff {each.number} of {name}")
        plan_and_import(session, campaign_id, plan, records[each.number], context, confirmed=True, invalid=False)
    return campaigns.get_campaign(session, campaign_id)
