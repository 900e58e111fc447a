"""API views of reproductions."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from app.common.schemas import Request, Schema
from app.jobs.service import Job
from app.reproductions.results import Row


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
