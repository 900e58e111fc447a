"""The error landscape of a campaign over HTTP: a figure that is computed when it is first requested."""

from typing import Annotated

from fastapi import APIRouter, Query

from app.accounts.permissions import Permission, is_allowed
from app.api.deps import CurrentDatabase, Id, RequestContextDep
from app.api.figures import FigureCard, Theme, figure_card
from app.campaigns import landscapes

router = APIRouter(prefix="/api", tags=["figures"])


@router.get("/campaigns/{campaign_id}/figures/landscape")
def get_landscape(
    database: CurrentDatabase,
    asking: RequestContextDep,
    campaign_id: Id,
    theme: Theme = "light",
    stacked: Annotated[bool, Query(description="slices one below the other, for a narrow page")] = False,
) -> FigureCard:
    """The gains as a path over the error that the strategy's model predicts, two gains at a time.

    A job computes it for each proposal, started at the first request by a client that may make changes; until it is
    done the card is `waiting`.
    """
    with database.read() as session:
        asked = landscapes.landscape_card(session, campaign_id, theme, stacked=stacked)
    if asked.wanted and is_allowed(Permission.CHANGE, asking.caller):
        with database.write() as session:
            landscapes.request_landscape(session, campaign_id)
    return figure_card(asked.card)
