"""Jobs over HTTP."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query

from app.common.schemas import Page
from app.common.states import JobState
from app.jobs import service
from app.web.dependencies import CurrentSettings, Id, IdempotentPost, Limit, Reader, WantedPart, json_only

router = APIRouter(prefix="/api/jobs", tags=["jobs"], dependencies=[Depends(json_only)])


@router.get("")
def list_jobs(
    session: Reader,
    part: WantedPart,
    state: Annotated[list[JobState] | None, Query()] = None,
    campaign_id: Annotated[int | None, Query(ge=1, le=2**63 - 1)] = None,
) -> Page[service.Job]:
    """Jobs, newest first."""
    return service.list_jobs(session, part, states=state or [], campaign_id=campaign_id)


@router.get("/{job_id}")
def get_job(session: Reader, job_id: Id) -> service.Job:
    return service.get_job(session, job_id)


@router.get("/{job_id}/log")
def get_job_log(session: Reader, settings: CurrentSettings, job_id: Id, limit: Limit = 100) -> service.JobLog:
    """The last lines of the worker's log about a job."""
    return service.get_log(session, job_id, settings.data_dir, limit=limit)


@router.post("/{job_id}/cancel")
def cancel_job(act: IdempotentPost, job_id: Id) -> service.Job:
    """Cancel a job that is queued or running; what it has computed is discarded."""
    return act(lambda session: service.cancel_job(session, job_id))


@router.post("/{job_id}/retry")
def retry_job(act: IdempotentPost, job_id: Id) -> service.Job:
    """Queue a failed or cancelled job again."""
    return act(lambda session: service.retry_job(session, job_id))
