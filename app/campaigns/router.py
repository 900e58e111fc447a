"""Campaigns and their proposals over HTTP."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, status

from app.api.deps import CursorText, Id, IdempotentPost, Limit, Reader, RequestContextDep, Writer, json_only
from app.campaigns import promoting, rehearsing, service
from app.campaigns.schemas import (
    Campaign,
    CampaignEdit,
    CampaignStatistics,
    CampaignSummary,
    Clone,
    Finish,
    NewCampaign,
    NextFlight,
    Promotion,
    Sort,
)
from app.campaigns.statistics import campaign_statistics
from app.common.schemas import Page
from app.common.states import CampaignState
from app.fleet.schemas import Vehicle

router = APIRouter(prefix="/api/campaigns", tags=["campaigns"], dependencies=[Depends(json_only)])


@router.get("")
def list_campaigns(
    session: Reader,
    search: Annotated[str, Query(max_length=200, description="part of the name")] = "",
    state: Annotated[list[CampaignState] | None, Query()] = None,
    vehicle: Annotated[list[str] | None, Query(description="kinds of vehicle")] = None,
    sort: Sort = Sort.NEWEST,
    limit: Limit = 50,
    cursor: CursorText = None,
) -> Page[CampaignSummary]:
    """Campaigns as summaries for the list."""
    return service.list_campaigns(
        session, search=search, states=state or [], vehicles=vehicle or [], sort=sort, limit=limit, cursor=cursor
    )


@router.post("", status_code=status.HTTP_201_CREATED)
def create_campaign(act: IdempotentPost, body: NewCampaign) -> Campaign:
    """Create a campaign; its first gains are then computed, and it becomes ready."""
    return act(Campaign, lambda session: service.create_campaign(session, body))


@router.get("/{campaign_id}")
def get_campaign(session: Reader, campaign_id: Id) -> Campaign:
    return service.get_campaign(session, campaign_id)


@router.patch("/{campaign_id}")
def edit_campaign(session: Writer, campaign_id: Id, body: CampaignEdit) -> Campaign:
    """Rename a campaign at any time; change its definition or vehicle before the first flight."""
    return service.edit_campaign(session, campaign_id, body)


@router.delete("/{campaign_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_campaign(
    session: Writer, campaign_id: Id, version: Annotated[int, Query(ge=1, description="the version, as last read")]
) -> None:
    """Delete a campaign in which no flight was begun."""
    service.delete_campaign(session, campaign_id, version)


@router.post("/{campaign_id}/finish")
def finish_campaign(act: IdempotentPost, campaign_id: Id, body: Finish | None = None) -> Campaign:
    """Finish a campaign between flights, on the operator's decision."""
    reason = (body or Finish()).reason
    return act(Campaign, lambda session: service.finish_campaign(session, campaign_id, reason))


@router.post("/{campaign_id}/archive")
def archive_campaign(act: IdempotentPost, campaign_id: Id) -> Campaign:
    """Archive a finished campaign."""
    return act(Campaign, lambda session: service.archive_campaign(session, campaign_id))


@router.post("/{campaign_id}/clone", status_code=status.HTTP_201_CREATED)
def clone_campaign(act: IdempotentPost, campaign_id: Id, body: Clone | None = None) -> Campaign:
    """Create a campaign with the same definition, linked to this one."""
    return act(Campaign, lambda session: service.clone_campaign(session, campaign_id, body or Clone()))


@router.post("/{campaign_id}/rehearsal", status_code=status.HTTP_201_CREATED)
def rehearse_campaign(act: IdempotentPost, campaign_id: Id) -> Campaign:
    """The rehearsal of a campaign on a real vehicle: the same campaign on a simulation. Created unless there is one
    that is under way or passed."""
    return act(Campaign, lambda session: rehearsing.rehearse(session, campaign_id))


@router.post("/{campaign_id}/promote")
def promote_best(act: IdempotentPost, asking: RequestContextDep, campaign_id: Id, body: Promotion) -> Vehicle:
    """Make the best gains the safe gains of the campaign's registered vehicle, once its flights have shown that they
    are better than the first ones."""
    return act(Vehicle, lambda session: promoting.promote_best(session, campaign_id, body, asking))


@router.get("/{campaign_id}/statistics")
def get_statistics(session: Reader, campaign_id: Id) -> CampaignStatistics:
    """Statistics of the flights: repeats, scatter, better or worse, drift, and how well predictions held."""
    return campaign_statistics(session, campaign_id)


@router.get("/{campaign_id}/proposal")
def get_proposal(session: Reader, campaign_id: Id) -> NextFlight:
    """State of the next proposal, and the proposal once it is there."""
    return service.next_flight(session, campaign_id)


@router.post("/{campaign_id}/proposal", status_code=status.HTTP_202_ACCEPTED)
def compute_proposal(act: IdempotentPost, campaign_id: Id) -> NextFlight:
    """Compute the proposal again."""
    return act(NextFlight, lambda session: service.compute_proposal(session, campaign_id))
