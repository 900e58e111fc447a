"""HTTP API of reproductions."""

from typing import Annotated

from fastapi import APIRouter, Depends, Path, status

from app.common.schemas import Page
from app.figures.base import Card
from app.jobs.service import Job
from app.reproductions import service
from app.reproductions.service import Reproduction, ReproductionSummary, Run
from app.web.dependencies import IdempotentPost, Reader, Theme, json_only

router = APIRouter(prefix="/api/reproductions", tags=["reproductions"], dependencies=[Depends(json_only)])

Name = Annotated[str, Path(max_length=60)]


@router.get("")
def list_reproductions(session: Reader) -> Page[ReproductionSummary]:
    """The experiments, tables and figures of the paper that can be run here."""
    found = service.list_reproductions(session)
    return Page(items=found, total=len(found), next_cursor=None)


@router.get("/{name}")
def get_reproduction(session: Reader, name: Name) -> Reproduction:
    """One reproduction with the rows of its newest result: measured, published, and their ratio."""
    return service.get_reproduction(session, name)


@router.post("/{name}/run", status_code=status.HTTP_202_ACCEPTED)
def run_reproduction(act: IdempotentPost, name: Name, body: Run | None = None) -> Job:
    """Request a run. If one is queued or running already, its job is returned."""
    return act(lambda session: service.request_run(session, name, full=(body or Run()).full))


@router.get("/{name}/figures/{figure}")
def get_reproduction_figure(session: Reader, name: Name, figure: Name, theme: Theme = "light") -> Card:
    """A figure of the newest result."""
    return service.figure(session, name, figure, theme)
