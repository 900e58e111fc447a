"""API schemas of jobs."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, Field

from app.common.schemas import Trouble
from app.common.states import JobState


class Job(BaseModel):
    """Numeric work, such as a proposal or a reproduction."""

    id: int
    kind: str
    name: Annotated[str, Field(description="what exactly, for the kinds that have a choice; empty otherwise")]
    state: JobState
    campaign_id: int | None
    problem: Trouble | None
    done_share: Annotated[float | None, Field(description="0 … 1 while it runs, where the kind can tell")]
    doing: Annotated[str, Field(description="what it is at")]
    remaining_s: Annotated[float | None, Field(description="seconds that it will still take, at the pace so far")]
    attempts: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    actions: Annotated[list[str], Field(description="what may be done with it now: cancel, retry")]


class JobLogLine(BaseModel):
    """A line of the worker's log about a job. `exception` is a traceback, empty without one."""

    at: datetime
    level: str
    message: str
    details: dict[str, str]
    exception: str


class JobLog(BaseModel):
    """The last lines about a job, oldest first; `total` counts all that are kept."""

    lines: list[JobLogLine]
    total: int
