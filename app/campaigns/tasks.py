"""Carrying out proposal jobs: stored flights in, a stored proposal out, the mathematics in a process of the pool."""

from concurrent.futures import CancelledError
from dataclasses import dataclass
from time import monotonic
from typing import Final

import structlog

from app.campaigns import proposing
from app.core.definition import Definition, Flight
from app.core.experiments import get_experiment
from app.db.session import Database
from app.errors import GainlineError, StorageError
from app.jobs import service as jobs
from app.pool import Pool

BEATS_PER_LEASE: Final = 3

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class Job:
    """A claimed job, apart from its row."""

    id: int
    campaign_id: int


class ProposalDesk:
    """Claims proposal jobs and carries them out. `claim` and `heartbeat` belong to one thread, `carry_out` to any."""

    def __init__(self, database: Database, pool: Pool, *, worker: str, lease_s: float) -> None:
        self._database = database
        self._pool = pool
        self._worker = worker
        self._lease_s = lease_s
        self._at_work: set[int] = set()
        self._beat_due_s = 0.0

    @property
    def at_work(self) -> int:
        """How many jobs are claimed and not finished."""
        return len(self._at_work)

    def recover(self) -> None:
        """After a start: whatever ran waits again. Raises StorageError."""
        with self._database.write() as session:
            for job_id in jobs.requeue_running_jobs(session):
                _log.warning("job waits again: its worker ended", job_id=job_id)

    def claim(self) -> Job | None:
        """The job that has waited longest, now this worker's. Raises StorageError."""
        with self._database.write() as session:
            row = jobs.claim_job(session, worker=self._worker, kinds=(proposing.PROPOSAL_JOB,), lease_s=self._lease_s)
            if row is None:
                return None
            if row.campaign_id is None:
                jobs.fail_job(session, row.id, GainlineError("It names no campaign.", hint=""), worker=self._worker)
                return None
            job = Job(row.id, row.campaign_id)
        self._at_work.add(job.id)
        return job

    def heartbeat(self) -> None:
        """When it is time, extend the leases of the jobs at work; those given up (their result found no room on the
        disk) wait again once their lease is over. Raises StorageError."""
        if monotonic() < self._beat_due_s:
            return
        self._beat_due_s = monotonic() + self._lease_s / BEATS_PER_LEASE
        with self._database.write() as session:
            for job_id in tuple(self._at_work):
                jobs.heartbeat_job(session, job_id, worker=self._worker, lease_s=self._lease_s)
            jobs.requeue_expired_jobs(session)

    def carry_out(self, job: Job) -> None:
        """The whole job, from the stored flights to the stored proposal. Raises nothing."""
        with structlog.contextvars.bound_contextvars(campaign_id=job.campaign_id, job_id=job.id):
            try:
                self._propose(job)
            except CancelledError:
                _log.info("job dropped, because the worker ends; it runs again with the next one")
            except StorageError as error:
                _log.error("job given up; it runs again when its lease is over", why=str(error))
            except GainlineError as error:
                self._fail(job, error)
            except Exception as error:  # noqa: BLE001 - the edge of the thread
                _log.exception("job failed by a mistake of the program")
                self._fail(
                    job,
                    GainlineError(
                        f"The program made a mistake ({type(error).__name__}: {error}).",
                        hint="Try again; if it happens again, report it with the worker's log.",
                    ),
                )
            finally:
                self._at_work.discard(job.id)

    def _propose(self, job: Job) -> None:
        started_s = monotonic()
        with self._database.read() as session:
            past = proposing.read_history(session, job.campaign_id)
        computed = self._pool.run(proposing.compute, past)
        with self._database.write() as session:
            if jobs.finish_job(session, job.id, worker=self._worker):
                proposing.store_proposal(session, job.campaign_id, computed)
        _log.info("proposal stored", kind=computed.proposal.kind, seconds=round(monotonic() - started_s, 3))

    def _fail(self, job: Job, error: GainlineError) -> None:
        _log.warning("job failed", why=str(error))
        with self._database.write() as session:
            jobs.fail_job(session, job.id, error, worker=self._worker)


def prepare() -> None:
    """Load and compile what a proposal needs, so that the first one is as quick as the others."""
    definition = Definition()
    experiment = get_experiment(definition.experiment)
    default = experiment.space.default
    flown = experiment.simulate(default, experiment.nominal_model)
    flight = Flight(
        number=1,
        gains=experiment.space.mapping(default),
        trajectory=flown,
        error=experiment.error(flown),
        outcome="valid",
    )
    proposing.compute(proposing.History(campaign_id=0, definition=definition, flights=(flight,), digest=""))
