"""Flights over HTTP: plan and fly, stage, take off, abort."""

from fastapi import APIRouter, Depends, status
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from app.campaigns.trials import service as trials
from app.campaigns.trials.router import TrialPredictorDep
from app.campaigns.trials.schemas import Abort, AbortAnswer, FlightOrder, NewTrial, Trial
from app.flights import service
from app.flights.readiness import TrialReadiness
from app.web.dependencies import CurrentDatabase, Id, IdempotentPost, Live, Reader, RequestContextDep, json_only

router = APIRouter(prefix="/api", tags=["trials"], dependencies=[Depends(json_only)])


@router.post("/campaigns/{campaign_id}/trials", status_code=status.HTTP_201_CREATED)
def create_trial(
    act: IdempotentPost, asking: RequestContextDep, predictor: TrialPredictorDep, campaign_id: Id, body: NewTrial
) -> Trial:
    """Plan a trial of the proposal, a variant or custom gains and, with `fly`, request its flight at once."""

    def plan(session: Session) -> Trial:
        trial = trials.create_trial(session, campaign_id, body, asking, predictor=predictor)
        return trial if body.fly is None else service.fly_new_trial(session, trial.id, body.fly, asking)

    return act(plan, ahead=lambda session: trials.prepare_trial(session, campaign_id, body, predictor))


@router.post("/trials/{trial_id}/fly", status_code=status.HTTP_202_ACCEPTED)
def fly_trial(act: IdempotentPost, asking: RequestContextDep, trial_id: Id, body: FlightOrder | None = None) -> Trial:
    """Request the flight of a planned trial without staging. Refused when the vehicle has a flight already, and always
    for a real vehicle, which has to be staged."""
    return act(
        lambda session: service.fly_trial(session, trial_id, asking, speed=(body or FlightOrder()).speed),
        ahead=lambda session: service.warm_gate_cache(session, trial_id),
    )


@router.post("/trials/{trial_id}/stage", status_code=status.HTTP_202_ACCEPTED)
def stage_trial(act: IdempotentPost, asking: RequestContextDep, trial_id: Id) -> Trial:
    """Write the gains of a planned trial to a registered vehicle, read them back, and wait for its operator."""
    return act(
        lambda session: service.fly_trial(session, trial_id, asking, mode="stage"),
        ahead=lambda session: service.warm_gate_cache(session, trial_id),
    )


@router.post("/trials/{trial_id}/unstage", status_code=status.HTTP_202_ACCEPTED)
def unstage_trial(act: IdempotentPost, asking: RequestContextDep, trial_id: Id) -> Trial:
    """Restore the safe gains of a staged vehicle instead of flying; the trial is then planned again."""
    return act(lambda session: service.unstage_trial(session, trial_id, asking))


@router.post("/trials/{trial_id}/take-off", status_code=status.HTTP_202_ACCEPTED)
def take_off_trial(act: IdempotentPost, asking: RequestContextDep, live: Live, trial_id: Id) -> Trial:
    """Take off with a staged vehicle: the operator's own act. For a real vehicle, accepted only from the dashboard's
    own page on this computer, with the token of the operator in control. Refused while the vehicle is not ready."""
    return act(lambda session: service.take_off_trial(session, trial_id, asking, live.report))


@router.get("/trials/{trial_id}/readiness")
def get_readiness(session: Reader, asking: RequestContextDep, live: Live, trial_id: Id) -> TrialReadiness:
    """How far a flight has come, and which steps are lost at this moment, and why. It changes without an event: read it
    again every second before a takeoff."""
    return service.trial_readiness(session, trial_id, asking, live.report)


@router.post("/trials/{trial_id}/abort", status_code=status.HTTP_202_ACCEPTED)
async def abort_trial(live: Live, database: CurrentDatabase, trial_id: Id, body: Abort | None = None) -> AbortAnswer:
    """End a flight now. Goes straight to the worker without waiting for storage; may be repeated."""
    reason = (body or Abort()).reason
    if live.client.connected and (await live.client.abort(trial_id, reason)).accepted:
        return AbortAnswer(
            trial_id=trial_id, accepted=True, sentence="The worker ends the flight and restores the safe gains."
        )
    return await run_in_threadpool(_withdraw, database, trial_id, reason)


def _withdraw(database: CurrentDatabase, trial_id: int, reason: str) -> AbortAnswer:
    with database.write() as session:
        return service.withdraw_flight(session, trial_id, reason)
