"""Creation of rehearsals: the same campaign on a simulation, for a campaign on a real vehicle."""

from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import repository
from app.campaigns.rehearsals import notify_rehearsed_campaign, rehearsal_of
from app.campaigns.schemas import Campaign, Definition
from app.campaigns.service import add_campaign
from app.campaigns.views import campaign_view
from app.common.errors import ConflictError
from app.db.models import CampaignRow, RehearsalRow
from app.fleet import service as fleet
from app.fleet.schemas import VehicleChoice

_NAME_ROOM: Final = 100


def rehearse(session: Session, campaign_id: int) -> Campaign:
    """Return the rehearsal of this campaign: the one that is under way or passed, else a new draft on a simulation with
    the same definition and safe gains.

    Raises ConflictError where no rehearsal is needed, and where no simulation can fly the experiment.
    """
    row = repository.get_one(session, campaign_id)
    said = rehearsal_of(session, row)
    if said.state == "not needed":
        why = f": {said.reason}" if said.reason else f", {row.vehicle.name} is not a real vehicle flown from here"
        raise ConflictError(f"Campaign {row.id} needs no rehearsal{why}.", hint="Fly it.")
    if said.campaign_id is not None and said.state != "failed":
        return campaign_view(session, repository.get_one(session, said.campaign_id))
    made = add_campaign(
        session,
        f"Rehearsal: {row.name[:_NAME_ROOM]}",
        Definition.model_validate(row.definition),
        _simulation_of(session, row),
        parent_id=row.id,
        safe_gains=dict(row.vehicle.safe_gains if row.safe_gains is None else row.safe_gains),
    )
    session.add(RehearsalRow(rehearsal_id=made.id, campaign_id=row.id))
    session.flush()
    notify_rehearsed_campaign(session, made)
    return campaign_view(session, made)


def _simulation_of(session: Session, row: CampaignRow) -> VehicleChoice:
    if (found := fleet.simulation_for(session, row.experiment, row.vehicle.safe_gains)) is None:
        raise ConflictError(
            f"No simulation flies the experiment {row.experiment} of campaign {row.id}.",
            hint="Start `gainline sim-drone` with the same autopilot, register it as a simulated vehicle and connect "
            "it; then rehearse on it.",
        )
    return found
