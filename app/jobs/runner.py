"""Job runner: claims jobs of one kind and carries them out."""

from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import KW_ONLY, dataclass, field
from typing import Final

import structlog

from app.common.errors import GainlineError, StorageError
from app.core.clock import REAL_TIME, Clock
from app.db.session import Database
from app.jobs import service as jobs

HEARTBEATS_PER_LEASE: Final = 3

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class ClaimedJob:
    """Data of a claimed job, detached from its row."""

    id: int
    campaign_id: int | None
    order: dict[str, object]


def recover(database: Database) -> None:
    """Queue all running jobs again after a worker's start. Raises StorageError."""
    with database.write() as session:
        for job_id in jobs.requeue_running_jobs(session):
            _log.warning("job queued again: its worker stopped", job_id=job_id)


@dataclass(slots=True, eq=False)
class JobRunner:
    """Claims jobs of one kind, at most `room` at a time. `claim` and `heartbeat` are for one thread, `carry_out` for
    any.

    `perform(job)` does the work and stores the result. It may raise GainlineError, which is stored with the job for a
    person, SupersededError when the result is no longer needed, and CancelledError when the worker ends.
    """

    database: Database
    kind: str
    perform: Callable[[ClaimedJob], None]
    _: KW_ONLY
    room: int
    worker: str
    lease_s: float
    clock: Clock = REAL_TIME
    _at_work: set[int] = field(default_factory=set, init=False)
    _beat_due_s: float = field(default=0.0, init=False)

    def claim(self) -> ClaimedJob | None:
        """Claim the oldest queued job; None when there is none or the runner is full. Raises StorageError."""
        if len(self._at_work) >= self.room:
            return None
        with self.database.write() as session:
            row = jobs.claim_job(session, worker=self.worker, kinds=(self.kind,), lease_s=self.lease_s)
            if row is None:
                return None
            job = ClaimedJob(row.id, row.campaign_id, dict(row.order or {}))
        self._at_work.add(job.id)
        return job

    def heartbeat(self) -> None:
        """Extend the leases of the running jobs when due, and queue jobs again whose lease has expired.

        The latter are jobs that were given up because their result could not be stored. Raises StorageError.
        """
        if self.clock.now_s() < self._beat_due_s:
            return
        self._beat_due_s = self.clock.now_s() + self.lease_s / HEARTBEATS_PER_LEASE
        with self.database.write() as session:
            for job_id in tuple(self._at_work):
                jobs.heartbeat_job(session, job_id, worker=self.worker, lease_s=self.lease_s)
            jobs.requeue_running_jobs(session, expired=True)

    def carry_out(self, job: ClaimedJob) -> None:
        """Carry out a job, from the stored order to the stored result. Raises nothing."""
        with structlog.contextvars.bound_contextvars(campaign_id=job.campaign_id, job_id=job.id):
            began_s = self.clock.now_s()
            ordered = ", ".join(f"{name}: {value}" for name, value in job.order.items())
            _log.info("job started", worker=self.worker, order=ordered or None)
            try:
                self.perform(job)
                _log.info("job finished", seconds=round(self.clock.now_s() - began_s, 3))
            except CancelledError:
                _log.info("job interrupted: the worker is shutting down; the next worker runs it again")
            except StorageError as error:
                _log.error("job abandoned; it runs again when its lease expires", why=str(error))
            except GainlineError as error:
                self._fail(job, error)
            except Exception as error:  # noqa: BLE001 - outermost frame of the thread
                _log.exception("job failed with an internal error")
                internal = GainlineError(
                    f"Internal error ({type(error).__name__}: {error}).",
                    hint="Try again. If it happens again, report it with the job's log.",
                )
                self._fail(job, internal)
            finally:
                self._at_work.discard(job.id)

    def _fail(self, job: ClaimedJob, error: GainlineError) -> None:
        if isinstance(error, jobs.SupersededError):
            _log.info("job withdrawn", why=str(error))
        else:
            _log.warning("job failed", why=str(error))
        try:
            with self.database.write() as session:
                jobs.fail_job(session, job.id, error, worker=self.worker)
        except StorageError as refused:
            _log.error("job abandoned; it runs again when its lease expires", why=str(refused))
