"""Services for reproductions: request a run, read its result."""

from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from typing import Annotated, Final

from pydantic import Field, ValidationError
from sqlalchemy.orm import Session

from app.common.errors import GainlineError, NotFoundError
from app.common.schemas import Request, Schema
from app.common.states import JobState
from app.db.models import JobRow
from app.figures.base import Card, card_of
from app.figures.panels import PanelsFigure
from app.figures.theme import ThemeName
from app.jobs import service as jobs
from app.jobs.service import Job
from app.reproductions.registry import REPRODUCTIONS
from app.reproductions.registry import Reproduction as Entry
from app.reproductions.results import STORED, Result, Row


class Run(Request):
    """How to run a reproduction."""

    full: Annotated[bool, Field(description="the long version, if there is one")] = False


class ReproductionFigure(Schema):
    """A figure of a reproduction, and its title in the paper."""

    name: str
    title: str


class LatestRun(Schema):
    """The newest finished run; its job records when it was started."""

    job_id: int
    full: bool
    finished_at: datetime
    seconds: float


class ReproductionSummary(Schema):
    """One experiment, table or figure of the paper. `line` describes what is done here, `paper` what the paper shows.

    `job` is the newest run that is queued or running, or that failed or was cancelled after the `latest` one.
    """

    name: str
    title: str
    line: str
    paper: str
    long_form: Annotated[str, Field(description="contents of the long version; empty if there is none")]
    figures: list[ReproductionFigure]
    job: Job | None
    latest: LatestRun | None


class Reproduction(ReproductionSummary):
    """A reproduction with the rows of its newest result, empty before the first."""

    rows: list[Row]
    notes: list[str]


REPRODUCTION_JOB: Final = "reproduction"
ACTIVE_STATES: Final = (JobState.QUEUED, JobState.RUNNING)
CAME_TO_NOTHING: Final = (JobState.FAILED, JobState.CANCELLED)


class Order(Run):
    """Parameters of a reproduction job."""

    name: str


def read_order(order: object) -> Order:
    """Parse a job's order. Raises GainlineError for a job of another version of the program."""
    try:
        found = Order.model_validate(order)
    except ValidationError as error:
        raise GainlineError(
            f"The job's request {order!r} cannot be read.", hint="Run the reproduction again."
        ) from error
    if found.name not in REPRODUCTIONS:
        raise GainlineError(f"The reproduction {found.name} no longer exists.", hint="Run another reproduction.")
    return found


def list_reproductions(session: Session) -> list[ReproductionSummary]:
    """All reproductions, in the order of the registry, without their rows."""
    return [ReproductionSummary.view_of(each, **_summary(session, each)) for each in REPRODUCTIONS.values()]


def get_reproduction(session: Session, name: str) -> Reproduction:
    """One reproduction with the rows of its newest result. Raises NotFoundError."""
    each, result = _registered(name), _result(session, name)
    return Reproduction.view_of(each, **_summary(session, each), rows=list(result.rows), notes=list(result.notes))


def request_run(session: Session, name: str, *, full: bool) -> Job:
    """Request a run; a queued or running one is reused. Raises NotFoundError."""
    _registered(name)
    row = jobs.latest_ordered(session, REPRODUCTION_JOB, name, ACTIVE_STATES) or jobs.enqueue_job(
        session, REPRODUCTION_JOB, order={"name": name, "full": full}
    )
    return jobs.job_view(row)


def figure(session: Session, name: str, figure_name: str, theme: ThemeName) -> Card:
    """A figure of the newest result, or a waiting card if there is none. Raises NotFoundError."""
    each = _registered(name)
    if figure_name not in each.figures:
        raise NotFoundError(f"figure {figure_name} of", name, hint=f"Available: {', '.join(each.figures)}.")
    title, result = each.figures[figure_name], _result(session, name)
    if figure_name not in result.figures:
        return Card(name=figure_name, title=title, state="waiting", reason="Run this reproduction to see its figures.")
    card = card_of(PanelsFigure(result.figures[figure_name], theme_name=theme))
    return replace(card, name=figure_name, title=f"{title}: {card.title}")


def _registered(name: str) -> Entry:
    if name not in REPRODUCTIONS:
        raise NotFoundError("reproduction", name, hint=f"Available: {', '.join(REPRODUCTIONS)}.")
    return REPRODUCTIONS[name]


def _summary(session: Session, each: Entry) -> dict[str, object]:
    """What the registry does not know of a reproduction."""
    latest = jobs.latest_ordered(session, REPRODUCTION_JOB, each.name, {JobState.DONE})
    return {
        "figures": [{"name": figure_name, "title": title} for figure_name, title in each.figures.items()],
        "job": _open_job(session, each, latest),
        "latest": None if latest is None else _latest_run(latest),
    }


def _open_job(session: Session, each: Entry, latest: JobRow | None) -> Job | None:
    """The job to show beside the result: the current run, or a later one that failed or was cancelled."""
    if (row := jobs.latest_ordered(session, REPRODUCTION_JOB, each.name, ACTIVE_STATES)) is None:
        row = jobs.latest_ordered(session, REPRODUCTION_JOB, each.name, CAME_TO_NOTHING)
        if row is None or (latest is not None and row.id < latest.id):
            return None
    return jobs.job_view(row)


def _latest_run(row: JobRow) -> LatestRun | None:
    if row.started_at is None or row.finished_at is None:
        return None
    return LatestRun(
        job_id=row.id,
        full=read_order(row.order).full,
        finished_at=row.finished_at,
        seconds=(row.finished_at - row.started_at).total_seconds(),
    )


def _result(session: Session, name: str) -> Result:
    """The newest result; an empty one without any, or if it is of another version of the program."""
    row = jobs.latest_ordered(session, REPRODUCTION_JOB, name, {JobState.DONE})
    if row is not None:
        with suppress(ValidationError):
            return STORED.validate_python(row.result)
    return Result(rows=(), figures={})
