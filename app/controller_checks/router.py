"""Controller checks over HTTP."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, status

from app.autopilots.loop_check import FigureName
from app.common.schemas import Page
from app.controller_checks import service
from app.controller_checks.service import ControllerCheck, ControllerCheckSummary
from app.figures.base import Card
from app.web.dependencies import (
    REQUEST_BODY,
    CursorText,
    Id,
    IdempotentPost,
    Limit,
    Reader,
    Record,
    Theme,
    Writer,
    json_only,
)

PREFIX = "/api/controller-checks"

router = APIRouter(prefix=PREFIX, tags=["controller checks"], dependencies=[Depends(json_only)])
recordings = APIRouter(prefix=PREFIX, tags=["controller checks"])
"""A router of its own, because the request bodies are not JSON."""


@router.get("")
def list_controller_checks(
    session: Reader, limit: Limit = 50, cursor: CursorText = None
) -> Page[ControllerCheckSummary]:
    """Checks of recordings against the replica, newest first."""
    return service.list_checks(session, limit=limit, cursor=cursor)


@recordings.post("", status_code=status.HTTP_201_CREATED, openapi_extra=REQUEST_BODY)
def check_controller(
    record: Record,
    gains: Annotated[
        str | None, Query(max_length=40, description="KP,KI,KD flown, if the log does not contain them")
    ] = None,
) -> ControllerCheck:
    """Compare a recording of the vertical loop with the replica of its autopilot: Paparazzi's .data file with VERT_LOOP
    (its .log as the form field `companion`), ArduCopter's .bin log, or a trace with a row for every step, .csv or
    .csv.gz. The recording itself is not kept."""
    result = service.check_upload(record.content(), name=record.name, companion=record.read_companion(), gains=gains)
    return record.once(lambda session: service.store_check(session, record.name, result))


@router.post("/example", status_code=status.HTTP_201_CREATED)
def check_example_controller(act: IdempotentPost) -> ControllerCheck:
    """Check the example recording: a takeoff that comes with Gainline, recorded from the autopilot's own code."""
    result = service.examine_example()
    return act(lambda session: service.store_example(session, result))


@router.get("/{check_id}")
def get_controller_check(session: Reader, check_id: Id) -> ControllerCheck:
    return service.get_check(session, check_id)


@router.get("/{check_id}/figures/{name}")
def get_controller_check_figure(session: Reader, check_id: Id, name: FigureName, theme: Theme = "light") -> Card:
    """The signals of the reference model and the integrator, or the commands; recording and replica overlaid."""
    return service.figure(session, check_id, name, theme)


@router.delete("/{check_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_controller_check(session: Writer, check_id: Id) -> None:
    """Delete a check; it can be repeated from its recording."""
    service.delete_check(session, check_id)
