"""Execution of a campaign's jobs: read flights, compute in the pool, store a proposal or a landscape."""

from time import monotonic
from typing import Final

import numpy as np
import structlog

from app.campaigns import computation, landscapes, proposals
from app.db.session import Database
from app.jobs import service as jobs
from app.jobs.runner import ClaimedJob
from app.processes.calls import ComputePool

POINTS_PER_BATCH: Final = 48
"""Number of gain sets of a landscape per request to the pool, which limits how long a proposal has to wait."""
PROGRESS_EVERY_S: Final = 2.0

_log = structlog.get_logger(__name__)


def compute_proposal(database: Database, pool: ComputePool, job: ClaimedJob, *, worker: str) -> None:
    """Compute a proposal from the stored flights and store it, as a job's work.

    Raises GainlineError, and CancelledError when the pool is closed meanwhile.
    """
    assert job.campaign_id is not None
    started_s = monotonic()
    with database.read() as session:
        past = proposals.read_history(session, job.campaign_id)
    computed = pool.run(computation.compute, past)
    with database.write() as session:
        if jobs.finish_job(session, job.id, worker=worker):
            proposals.store_proposal(session, job.campaign_id, computed)
    _log.info("proposal stored", kind=computed.proposal.kind, seconds=round(monotonic() - started_s, 3))


def compute_landscape(database: Database, pool: ComputePool, job: ClaimedJob, *, worker: str, lease_s: float) -> None:
    """Compute the landscape of the stored proposal in batches and store it, as a job's work.

    Raises GainlineError, and CancelledError when the pool is closed meanwhile.
    """
    assert job.campaign_id is not None
    started_s = monotonic()
    with database.read() as session:
        past, proposal = landscapes.read_proposed(session, job.campaign_id, job.order)
    survey = pool.run(landscapes.plan, past, proposal.gains, proposal.explanation.get("base_flight"))
    assert survey is not None, "asked for only where there is a model, with two free gains"
    points = survey.points()
    parts = np.array_split(points, -(-len(points) // POINTS_PER_BATCH))
    errors, done, told_s = [], 0, started_s
    for part in parts:
        if monotonic() - told_s >= PROGRESS_EVERY_S:
            told_s = monotonic()
            share, doing = done / len(points), f"{done} of {len(points)} gain sets evaluated"
            with database.write() as session:
                jobs.report_progress(session, job.id, share, doing, worker=worker, lease_s=lease_s)
        errors.append(pool.run(survey.predict_errors, part))
        done += len(part)
    result = landscapes.as_json(survey.landscape(np.concatenate(errors)), job.order)
    with database.write() as session:
        jobs.finish_job(session, job.id, worker=worker, result=result)
    _log.info("landscape stored", points=len(points), seconds=round(monotonic() - started_s, 3))
