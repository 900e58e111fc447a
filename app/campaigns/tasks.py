"""Execution of a campaign's jobs: read flights, compute in the pool, store a proposal or a landscape."""

from dataclasses import KW_ONLY, dataclass
from time import monotonic
from typing import Final

import numpy as np
import structlog

from app.campaigns import computation, landscapes, proposals
from app.common.errors import GainlineError
from app.db.session import Database
from app.jobs import service as jobs
from app.jobs.runner import ClaimedJob
from app.processes.calls import ComputePool

POINTS_PER_BATCH: Final = 48
"""Number of gain sets of a landscape per request to the pool, which limits how long a proposal has to wait."""
PROGRESS_EVERY_S: Final = 2.0

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class ProposalJob:
    """Carries out proposal jobs for a job runner."""

    database: Database
    pool: ComputePool
    _: KW_ONLY
    worker: str

    def __call__(self, job: ClaimedJob) -> None:
        """Compute a proposal from the stored flights and store it.

        Raises GainlineError, and CancelledError when the pool is closed meanwhile.
        """
        if job.campaign_id is None:
            raise GainlineError("The job names no campaign.", hint="")
        started_s = monotonic()
        with self.database.read() as session:
            past = proposals.read_history(session, job.campaign_id)
        computed = self.pool.run(computation.compute, past)
        with self.database.write() as session:
            if jobs.finish_job(session, job.id, worker=self.worker):
                proposals.store_proposal(session, job.campaign_id, computed)
        _log.info("proposal stored", kind=computed.proposal.kind, seconds=round(monotonic() - started_s, 3))


@dataclass(frozen=True, slots=True)
class LandscapeJob:
    """Carries out landscape jobs for a job runner."""

    database: Database
    pool: ComputePool
    _: KW_ONLY
    worker: str
    lease_s: float

    def __call__(self, job: ClaimedJob) -> None:
        """Compute the landscape of the stored proposal in batches and store it.

        Raises GainlineError, and CancelledError when the pool is closed meanwhile.
        """
        if job.campaign_id is None:
            raise GainlineError("The job names no campaign.", hint="")
        started_s = monotonic()
        with self.database.read() as session:
            plan = landscapes.read_plan(session, job.campaign_id, job.order)
        survey = self.pool.run(landscapes.plan, plan)
        if survey is None:
            raise GainlineError("There is no model, or fewer than two gains are free.", hint="")
        points = survey.points()
        parts = np.array_split(points, -(-len(points) // POINTS_PER_BATCH))
        errors, done, told_s = [], 0, started_s
        for part in parts:
            if monotonic() - told_s >= PROGRESS_EVERY_S:
                told_s = monotonic()
                self._report(job, done / len(points), f"{done} of {len(points)} gain sets evaluated")
            errors.append(self.pool.run(survey.predict_errors, part))
            done += len(part)
        result = landscapes.as_json(survey.landscape(np.concatenate(errors)), job.order)
        with self.database.write() as session:
            jobs.finish_job(session, job.id, worker=self.worker, result=result)
        _log.info("landscape stored", points=len(points), seconds=round(monotonic() - started_s, 3))

    def _report(self, job: ClaimedJob, share: float, doing: str) -> None:
        with self.database.write() as session:
            jobs.report_progress(session, job.id, share, doing, worker=self.worker, lease_s=self.lease_s)
