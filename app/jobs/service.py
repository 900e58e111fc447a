"""Jobs: numeric work as rows, written in the transaction that needs it, carried out by a worker, repeated after a
crash.

For a worker: `claim_job`, then `heartbeat_job` or `report_progress` while it computes, then `finish_job` or `fail_job`;
`requeue_job` when it has to end before that.
"""

from collections.abc import Collection
from datetime import datetime, timedelta
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field
from sqlalchemy import ColumnElement, Select, select, update
from sqlalchemy.orm import Session

from app.common.conflict_checks import allowed, check_action, check_transition
from app.common.errors import GainlineError
from app.common.logging import LogLine, lines_of_job
from app.common.schemas import Page, Schema, Trouble
from app.common.states import JOB_ACTIONS, JOB_TRANSITIONS, JobState
from app.db.base import JsonObject, added, existing, utc_now
from app.db.models import JobRow
from app.db.pages import Order, Part, page_of


class Job(Schema):
    """Numeric work, such as a proposal or a reproduction."""

    id: int
    kind: str
    name: Annotated[str, Field(description="variant, for the kinds that have several; empty otherwise")]
    state: JobState
    campaign_id: int | None
    campaign_name: str | None
    problem: Trouble | None
    done_share: Annotated[float | None, Field(description="0 … 1 while it runs, if the kind reports progress")]
    doing: Annotated[str, Field(description="current step")]
    remaining_s: Annotated[float | None, Field(description="estimated remaining seconds")]
    attempts: int
    created_at: datetime
    started_at: datetime | None
    finished_at: datetime | None
    actions: Annotated[list[str], Field(description="allowed actions: cancel, retry")]


class JobLog(Schema):
    """The last lines about a job, oldest first; `total` counts all that are kept."""

    lines: list[LogLine]
    total: int


LEAST_PACE_S: Final = 30.0
LEAST_PACE_SHARE: Final = 0.1
"""Until this many seconds or this share, the remaining time is not estimated, because the start takes time too."""

MAX_ATTEMPTS: Final = 3
"""A job that lost its worker this many times has probably killed it, and is failed."""

_NEWEST_FIRST: Final = Order("-id", JobRow.id.expression, descending=True)


class SupersededError(GainlineError):
    """The job's result is no longer needed, because a newer state has replaced what it was for. Not a failure."""


def enqueue_job(
    session: Session, kind: str, *, campaign_id: int | None = None, order: JsonObject | None = None
) -> JobRow:
    """Queue a job, or return a queued one of the same kind for the same campaign.

    `order` describes the work; `latest_ordered` finds the job by its `name`.
    """
    if campaign_id is not None:
        same = _newest(kind).where(JobRow.campaign_id == campaign_id, JobRow.state == JobState.QUEUED)
        if (waiting := session.scalar(same)) is not None:
            return waiting
    return added(session, JobRow(kind=kind, state=JobState.QUEUED, campaign_id=campaign_id, order=order))


def claim_job(session: Session, *, worker: str, kinds: Collection[str], lease_s: float) -> JobRow | None:
    """Claim the oldest queued job for this worker until the lease ends; None when there is none."""
    waiting = select(JobRow).where(JobRow.state == JobState.QUEUED, JobRow.kind.in_(kinds))
    if (row := session.scalar(waiting.order_by(JobRow.id).limit(1))) is None:
        return None
    _move(row, JobState.RUNNING)
    row.worker, row.attempts = worker, row.attempts + 1
    row.started_at, row.finished_at, row.problem = utc_now(), None, None
    row.lease_until = utc_now() + timedelta(seconds=lease_s)
    return row


def heartbeat_job(session: Session, job_id: int, *, worker: str, lease_s: float) -> bool:
    """Extend the lease. False when the job is no longer held by this worker, which must then stop it."""
    if _held_by(session, job_id, worker) is None:
        return False
    # Not through the row: a heartbeat alone must not publish a change event.
    session.execute(
        update(JobRow)
        .where(JobRow.id == job_id)
        .values(lease_until=utc_now() + timedelta(seconds=lease_s))
        .execution_options(synchronize_session=False)
    )
    return True


def report_progress(session: Session, job_id: int, share: float, doing: str, *, worker: str, lease_s: float) -> bool:
    """Report progress: a share of 0 … 1 and a few words; extends the lease too.

    False when the job is no longer held by this worker, which must then stop it.
    """
    row = _held_by(session, job_id, worker)
    if row is None:
        return False
    row.done_share, row.doing = share, doing
    row.lease_until = utc_now() + timedelta(seconds=lease_s)
    return True


def finish_job(session: Session, job_id: int, *, worker: str, result: JsonObject | None = None) -> bool:
    """Finish a job; only the newest result of each order is kept.

    False, without a change, when the job was cancelled, deleted or given to another worker meanwhile.
    """
    row = _held_by(session, job_id, worker)
    if row is None:
        return False
    _move(row, JobState.DONE)
    if result is not None:
        row.result, row.done_share, row.doing = result, 1.0, ""
        older = (JobRow.kind == row.kind, _is_order(_ordered(row)), JobRow.id < row.id)
        session.execute(update(JobRow).where(*older).values(result=None).execution_options(synchronize_session=False))
    return True


def requeue_job(session: Session, job_id: int, *, worker: str, its_process_died: bool = False) -> None:
    """Queue the job again, if this worker holds it: as if it had not been started, because the worker shuts down; or
    because its process died, and fail it when that has happened too often."""
    if (row := _held_by(session, job_id, worker)) is not None:
        if not its_process_died:
            row.attempts -= 1
        _requeue(row)


def fail_job(session: Session, job_id: int, error: GainlineError, *, worker: str) -> None:
    """Fail the job, or cancel one whose result is no longer needed, and store the error for a person; if this worker
    holds it."""
    if (row := _held_by(session, job_id, worker)) is not None:
        _end(row, error)


def is_withdrawn(row: JobRow) -> bool:
    """Whether it was cancelled because it was superseded, and not by a person."""
    return row.state == JobState.CANCELLED and row.problem is not None


def requeue_running_jobs(session: Session, *, expired: bool = False) -> list[int]:
    """Queue all running jobs again at a worker's start, when no other worker can be running; or those whose lease has
    `expired`. Returns their ids."""
    rows = session.scalars(_RUNNING.where(JobRow.lease_until < utc_now()) if expired else _RUNNING).all()
    for row in rows:
        _requeue(row)
    return [row.id for row in rows]


def latest_job(session: Session, campaign_id: int, kind: str) -> JobRow | None:
    """The newest job of that kind for a campaign, in any state."""
    return session.scalar(_newest(kind).where(JobRow.campaign_id == campaign_id))


def latest_ordered(session: Session, kind: str, name: str, states: Collection[JobState]) -> JobRow | None:
    """The newest job of that kind whose order has that name, in one of the states."""
    return session.scalar(_newest(kind).where(_is_order(name), JobRow.state.in_(states)))


def list_jobs(session: Session, part: Part, *, states: Collection[JobState], campaign_id: int | None) -> Page[Job]:
    """Page of jobs, newest first."""
    wanted = select(JobRow)
    if states:
        wanted = wanted.where(JobRow.state.in_(states))
    if campaign_id is not None:
        wanted = wanted.where(JobRow.campaign_id == campaign_id)
    return page_of(session, wanted, _NEWEST_FIRST, part, lambda rows: [job_view(row) for row in rows])


def get_job(session: Session, job_id: int) -> Job:
    return job_view(_one(session, job_id))


def get_log(session: Session, job_id: int, data_dir: Path, *, limit: int) -> JobLog:
    """Log lines of a job. Raises NotFoundError."""
    row = _one(session, job_id)
    lines, total = lines_of_job(data_dir, job_id, since=row.created_at, limit=limit)
    return JobLog(lines=lines, total=total)


def cancel_job(session: Session, job_id: int) -> Job:
    """Cancel a job. Raises ConflictError when it has ended already."""
    row = _one(session, job_id)
    check_action(JOB_ACTIONS, "cancel", row.state, _name(row))
    _move(row, JobState.CANCELLED)
    return job_view(row)


def retry_job(session: Session, job_id: int) -> Job:
    """Queue a job again. Raises ConflictError unless it failed or was cancelled."""
    row = _one(session, job_id)
    check_action(JOB_ACTIONS, "retry", row.state, _name(row))
    _move(row, JobState.QUEUED)
    row.attempts, row.problem, row.finished_at = 0, None, None
    return job_view(row)


def job_view(row: JobRow) -> Job:
    return Job.view_of(
        row,
        name=_ordered(row),
        campaign_name=None if row.campaign is None else row.campaign.name,
        remaining_s=_remaining_s(row),
        actions=allowed(JOB_ACTIONS, row.state),
    )


def job_problem(row: JobRow) -> Trouble | None:
    """Why a job failed or was superseded."""
    return None if row.problem is None else Trouble.model_validate(row.problem)


def _remaining_s(row: JobRow) -> float | None:
    """Remaining time at the pace so far, s; None before it can be estimated."""
    if row.state != JobState.RUNNING or row.started_at is None or not row.done_share:
        return None
    elapsed_s = (utc_now() - row.started_at).total_seconds()
    if elapsed_s < LEAST_PACE_S and row.done_share < LEAST_PACE_SHARE:
        return None
    return elapsed_s * (1.0 - row.done_share) / row.done_share


def _one(session: Session, job_id: int) -> JobRow:
    """The job with that id. Raises NotFoundError."""
    return existing(session, JobRow, job_id, "job")


def _held_by(session: Session, job_id: int, worker: str) -> JobRow | None:
    """The job, if it is running and held by this worker."""
    return session.scalar(_RUNNING.where(JobRow.id == job_id, JobRow.worker == worker))


_RUNNING: Final = select(JobRow).where(JobRow.state == JobState.RUNNING).order_by(JobRow.id)


def _newest(kind: str) -> Select[JobRow]:
    return select(JobRow).where(JobRow.kind == kind).order_by(JobRow.id.desc()).limit(1)


def _is_order(name: str) -> ColumnElement[bool]:
    name_of: ColumnElement[str] = JobRow.order["name"].as_string()
    return name_of == name


def _ordered(row: JobRow) -> str:
    """Name in the job's order; empty without an order."""
    return str((row.order or {}).get("name", ""))


def _requeue(row: JobRow) -> None:
    if row.attempts >= MAX_ATTEMPTS:
        happened = f"The worker stopped {row.attempts} times during this job."
        _end(row, GainlineError(happened, hint="Read its log on the Jobs page, then retry it."))
    else:
        _move(row, JobState.QUEUED)
        row.worker, row.lease_until = None, None


def _end(row: JobRow, error: GainlineError) -> None:
    _move(row, JobState.CANCELLED if isinstance(error, SupersededError) else JobState.FAILED)
    detail = "; ".join(f"{problem.field}: {problem.reason}" for problem in error.problems)
    row.problem = {"title": error.message, "detail": detail, "hint": error.hint}


def _move(row: JobRow, to: JobState) -> None:
    """Change the state. What waits or begins has no progress yet; what has ended has no lease."""
    row.state = check_transition(JOB_TRANSITIONS, row.state, to, _name(row))
    if to in {JobState.QUEUED, JobState.RUNNING}:
        row.done_share, row.doing = None, ""
    else:
        row.finished_at, row.lease_until = utc_now(), None


def _name(row: JobRow) -> str:
    return f"Job {row.id}"
