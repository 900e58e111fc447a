"""Campaigns, their proposals and figures, and the condition of a vehicle over its flights, over HTTP."""

from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Response, status

from app.accounts.permissions import Permission, is_allowed
from app.campaigns import figure_data, flight_predictions, landscapes, proposals, service, vehicle_history
from app.campaigns.parameter_files import parameter_file
from app.campaigns.schemas import (
    Campaign,
    CampaignEdit,
    CampaignSummary,
    Clone,
    ConsideredGains,
    Finish,
    GainsPrediction,
    NewCampaign,
    NextFlight,
    Promotion,
    Sort,
)
from app.campaigns.statistics import CampaignStatistics, campaign_statistics
from app.campaigns.vehicle_history import VehicleCalibration
from app.common.errors import InputError, Problem
from app.common.schemas import Page
from app.common.states import CampaignState
from app.figures import FigureName
from app.figures.base import Card
from app.figures.data import Range
from app.fleet import registration
from app.fleet.schemas import Vehicle, VehicleEdit
from app.web.dependencies import (
    CurrentDatabase,
    Id,
    IdempotentPost,
    Reader,
    ReadVersion,
    RequestContextDep,
    Theme,
    WantedPart,
    Writer,
    described,
    json_only,
    of_app,
)

router = APIRouter(prefix="/api/campaigns", tags=["campaigns"], dependencies=[Depends(json_only)])


@router.get("")
def list_campaigns(
    session: Reader,
    part: WantedPart,
    search: Annotated[str, Query(max_length=200, description="part of the name")] = "",
    state: Annotated[list[CampaignState] | None, Query()] = None,
    vehicle: Annotated[list[str] | None, Query(description="kinds of vehicle")] = None,
    sort: Sort = Sort.NEWEST,
) -> Page[CampaignSummary]:
    """Campaigns as summaries for the list."""
    return service.list_campaigns(session, part, search=search, states=state or [], vehicles=vehicle or [], sort=sort)


@router.post("", status_code=status.HTTP_201_CREATED)
def create_campaign(act: IdempotentPost, body: NewCampaign) -> Campaign:
    """Create a campaign; its first gains are then computed, and it becomes ready."""
    return act(lambda session: service.create_campaign(session, body))


@router.get("/{campaign_id}")
def get_campaign(session: Reader, campaign_id: Id) -> Campaign:
    return service.get_campaign(session, campaign_id)


@router.patch("/{campaign_id}")
def edit_campaign(session: Writer, asking: RequestContextDep, campaign_id: Id, body: CampaignEdit) -> Campaign:
    """Rename a campaign at any time; change its definition or vehicle before the first flight."""
    return service.edit_campaign(session, campaign_id, body, asking)


@router.delete("/{campaign_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_campaign(
    session: Writer,
    asking: RequestContextDep,
    campaign_id: Id,
    version: ReadVersion,
) -> None:
    """Delete a campaign in which no flight was started."""
    service.delete_campaign(session, campaign_id, version, asking)


@router.post("/{campaign_id}/finish")
def finish_campaign(
    act: IdempotentPost, asking: RequestContextDep, campaign_id: Id, body: Finish | None = None
) -> Campaign:
    """Finish a campaign between flights, on the operator's decision."""
    reason = (body or Finish()).reason
    return act(lambda session: service.finish_campaign(session, campaign_id, reason, asking))


@router.post("/{campaign_id}/archive")
def archive_campaign(act: IdempotentPost, asking: RequestContextDep, campaign_id: Id) -> Campaign:
    """Archive a finished campaign."""
    return act(lambda session: service.archive_campaign(session, campaign_id, asking))


@router.post("/{campaign_id}/clone", status_code=status.HTTP_201_CREATED)
def clone_campaign(act: IdempotentPost, campaign_id: Id, body: Clone | None = None) -> Campaign:
    """Create a campaign with the same definition, linked to this one."""
    return act(lambda session: service.clone_campaign(session, campaign_id, body or Clone()))


@router.post("/{campaign_id}/rehearsal", status_code=status.HTTP_201_CREATED)
def rehearse_campaign(act: IdempotentPost, campaign_id: Id) -> Campaign:
    """The rehearsal of a campaign on a real vehicle: the same campaign on a simulation. Created unless there is one
    that is under way or passed."""
    return act(lambda session: service.rehearse(session, campaign_id))


@router.post("/{campaign_id}/promote")
def promote_best(act: IdempotentPost, asking: RequestContextDep, campaign_id: Id, body: Promotion) -> Vehicle:
    """Make the best gains the safe gains of the campaign's registered vehicle, once its flights have shown that they
    are better than the first ones."""
    return act(lambda session: service.promote_best(session, campaign_id, body, asking))


@router.get("/{campaign_id}/parameter-file", response_class=Response, responses=described("text/plain", binary=False))
def get_parameter_file(session: Reader, campaign_id: Id) -> Response:
    """The best gains of a finished campaign as the vehicle's ground station or airframe takes them, with those of the
    first flight as comments; 409 if none are better."""
    name, content = parameter_file(session, campaign_id)
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(content, media_type="text/plain", headers=headers)


@router.get("/{campaign_id}/statistics")
def get_statistics(session: Reader, campaign_id: Id) -> CampaignStatistics:
    """Statistics of the flights: repeats, scatter, better or worse, drift, and how well predictions held."""
    return campaign_statistics(session, campaign_id)


@router.get("/{campaign_id}/proposal")
def get_proposal(session: Reader, campaign_id: Id) -> NextFlight:
    """State of the next proposal, and the proposal once it is computed."""
    return service.next_flight(session, campaign_id)


@router.post("/{campaign_id}/proposal", status_code=status.HTTP_202_ACCEPTED)
def compute_proposal(act: IdempotentPost, campaign_id: Id) -> NextFlight:
    """Compute the proposal again."""
    return act(lambda session: service.compute_proposal(session, campaign_id))


@router.post("/{campaign_id}/prediction")
def predict_gains(
    database: CurrentDatabase,
    predictors: Annotated[flight_predictions.PredictorCache, of_app("predictors")],
    campaign_id: Id,
    body: ConsideredGains,
) -> GainsPrediction:
    """Predict a flight with any gains, by the model that the next proposal comes from. Changes nothing."""
    return flight_predictions.predict_gains(database, predictors, campaign_id, body.gains)


figures_router = APIRouter(prefix="/api", tags=["figures"])


@figures_router.get("/campaigns/{campaign_id}/figures/landscape")
def get_landscape(
    database: CurrentDatabase,
    asking: RequestContextDep,
    campaign_id: Id,
    theme: Theme = "light",
) -> Card:
    """The gains as a path over the error that the strategy's model predicts, two gains at a time.

    A job computes it for each proposal, started at the first request by a client that may make changes; until it is
    done the card is `waiting`.
    """
    with database.read() as session:
        card, is_wanted = landscapes.landscape_card(session, campaign_id, theme)
    if is_wanted and is_allowed(Permission.CHANGE, asking.caller):
        with database.write() as session:
            landscapes.request_landscape(session, campaign_id)
    return card


@figures_router.get("/campaigns/{campaign_id}/figures/{name}")
def get_campaign_figure(
    session: Reader,
    campaign_id: Id,
    name: FigureName,
    theme: Theme = "light",
    from_s: Annotated[float | None, Query(description="start of the displayed time range in seconds")] = None,
    to_s: Annotated[float | None, Query(description="end of the displayed time range in seconds")] = None,
    flight: Annotated[
        int | None, Query(ge=1, le=2**31, description="number of a flight to draw as a separate curve")
    ] = None,
    predicted: Annotated[
        int | None,
        Query(ge=1, le=2**31, description="number of the flight whose prediction is drawn instead of the next one's"),
    ] = None,
) -> Card:
    """All takeoffs over the set point, the error of each flight, or the gains of each flight.

    With more than 30 flights the takeoffs are drawn as an envelope; the first, the best, the latest and that `flight`
    are drawn individually. Between `from_s` and `to_s` the curves are drawn with more points.
    """
    view = figure_data.FigureView(window=_window(from_s, to_s), chosen=flight, predicted=predicted)
    return figure_data.campaign_figure(session, campaign_id, name, theme, view)


def _window(from_s: float | None, to_s: float | None) -> Range | None:
    """Time range of the curves. Raises InputError when it ends before it begins, or has one end only."""
    if from_s is None and to_s is None:
        return None
    if from_s is None or to_s is None or not from_s < to_s:
        raise InputError(
            "Invalid time range.",
            problems=(Problem("to_s", "must be given together with from_s, and be later"),),
            hint="Send both limits in seconds since the command, or neither for the whole flight.",
        )
    return Range(from_s, to_s)


@figures_router.get("/trials/{trial_id}/figure")
def get_flight_figure(session: Reader, trial_id: Id, theme: Theme = "light") -> Card:
    """One flight, with its prediction and its commands."""
    return figure_data.flight_figure(session, trial_id, theme)


vehicles_router = APIRouter(prefix="/api/vehicles", tags=["vehicles"])


@vehicles_router.get("/{vehicle_id}/calibration")
def get_calibration(session: Reader, vehicle_id: Id) -> VehicleCalibration:
    """The model as fitted after each flight, over all campaigns of the vehicle, and whether it should be tuned
    again."""
    return vehicle_history.calibration_of(session, vehicle_id)


@vehicles_router.get("/{vehicle_id}/figures/{name}")
def get_vehicle_figure(
    session: Reader, vehicle_id: Id, name: Literal["calibration", "batteries"], theme: Theme = "light"
) -> Card:
    """The fitted parameters over the vehicle's flights, or the battery voltages before and after each flight."""
    return vehicle_history.vehicle_figure(session, vehicle_id, name, theme)


@vehicles_router.patch("/{vehicle_id}", dependencies=[Depends(json_only)])
def edit_vehicle(session: Writer, asking: RequestContextDep, vehicle_id: Id, body: VehicleEdit) -> Vehicle:
    """Change a registered vehicle's name, settings, battery or safe gains, while it is at rest."""
    edited = registration.edit_vehicle(session, vehicle_id, body, asking)
    if body.safe_gains is not None:
        proposals.safe_gains_changed(session, vehicle_id)
    return edited
