"""Queries on jobs."""

from collections.abc import Collection, Iterable, Sequence
from datetime import datetime

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from app.common.errors import NotFoundError
from app.common.states import JobState
from app.db.models import CampaignRow, JobRow


def get_one(session: Session, job_id: int) -> JobRow:
    """The job with that id. Raises NotFoundError."""
    if (row := session.get(JobRow, job_id)) is None:
        raise NotFoundError("job", job_id)
    return row


def held_by_or_none(session: Session, job_id: int, worker: str) -> JobRow | None:
    """The job, if it is running and held by this worker."""
    return session.scalar(
        select(JobRow).where(JobRow.id == job_id, JobRow.worker == worker, JobRow.state == JobState.RUNNING)
    )


def page(
    session: Session, *, states: Collection[JobState], campaign_id: int | None, before_id: int | None, limit: int
) -> tuple[Sequence[JobRow], int]:
    """The newest `limit` + 1 jobs before that id, and the total count."""
    wanted = select(JobRow)
    if states:
        wanted = wanted.where(JobRow.state.in_(states))
    if campaign_id is not None:
        wanted = wanted.where(JobRow.campaign_id == campaign_id)
    total = session.scalar(select(func.count()).select_from(wanted.subquery())) or 0
    if before_id is not None:
        wanted = wanted.where(JobRow.id < before_id)
    return session.scalars(wanted.order_by(JobRow.id.desc()).limit(limit + 1)).all(), total


def campaign_names(session: Session, rows: Iterable[JobRow]) -> dict[int, str]:
    """Names of the jobs' campaigns by id."""
    ids = {row.campaign_id for row in rows if row.campaign_id is not None}
    named = session.execute(select(CampaignRow.id, CampaignRow.name).where(CampaignRow.id.in_(ids)))
    return {row.id: row.name for row in named}


def first_waiting(session: Session, kinds: Collection[str]) -> JobRow | None:
    """The oldest queued job of these kinds."""
    return session.scalar(
        select(JobRow).where(JobRow.state == JobState.QUEUED, JobRow.kind.in_(kinds)).order_by(JobRow.id).limit(1)
    )


def running(session: Session, *, lease_before: datetime | None = None) -> Sequence[JobRow]:
    """Running jobs; with `lease_before`, those whose lease ended before that time."""
    wanted = select(JobRow).where(JobRow.state == JobState.RUNNING)
    if lease_before is not None:
        wanted = wanted.where(JobRow.lease_until < lease_before)
    return session.scalars(wanted.order_by(JobRow.id)).all()


def latest_of_order(
    session: Session, kind: str, name: str, states: Collection[JobState], *, with_result: bool = False
) -> JobRow | None:
    """The newest job whose order has that name, in one of the states; `with_result`: of those that have a result."""
    wanted = select(JobRow).where(
        JobRow.kind == kind, JobRow.order["name"].as_string() == name, JobRow.state.in_(states)
    )
    if with_result:
        wanted = wanted.where(JobRow.result.is_not(None))
    return session.scalar(wanted.order_by(JobRow.id.desc()).limit(1))


def drop_older_results(session: Session, row: JobRow, name: str) -> None:
    """Drop all but the newest result of an order."""
    session.execute(
        update(JobRow)
        .where(JobRow.kind == row.kind, JobRow.order["name"].as_string() == name, JobRow.id < row.id)
        .values(result=None)
        .execution_options(synchronize_session=False)
    )


def latest_of_campaign(session: Session, campaign_id: int, kind: str) -> JobRow | None:
    return session.scalar(
        select(JobRow).where(JobRow.campaign_id == campaign_id, JobRow.kind == kind).order_by(JobRow.id.desc()).limit(1)
    )


def waiting_of_campaign(session: Session, campaign_id: int, kind: str) -> JobRow | None:
    return session.scalar(
        select(JobRow)
        .where(JobRow.campaign_id == campaign_id, JobRow.kind == kind, JobRow.state == JobState.QUEUED)
        .limit(1)
    )
