"""What a job looks like from outside."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, Field

from app.jobs.states import JobState
from app.schemas import Trouble


class Job(BaseModel):
    """Numeric work: a proposal, a study, a report."""

    id: int
    kind: str
    state: JobState
    campaign_id: int | None
    problem: Trouble | None
    attempts: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    actions: Annotated[list[str], Field(description="what may be done with it now: cancel, retry")]
