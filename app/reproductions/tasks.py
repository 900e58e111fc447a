"""Execution of reproduction jobs, each in a separate process that is supervised until its result is stored."""

import threading
from concurrent.futures import CancelledError
from dataclasses import KW_ONLY, asdict, dataclass
from time import monotonic
from typing import Final

import structlog

from app.db.session import Database
from app.jobs import service as jobs
from app.jobs.runner import ClaimedJob
from app.processes import ChildProcess, ProcessDiedError, TaskError, result_of
from app.reproductions.registry import ProgressReport, reproduce
from app.reproductions.results import Result
from app.reproductions.service import read_order

LOOK_S: Final = 0.5
"""Smallest interval, s, between stored progress reports, and largest delay until a cancelled job is noticed."""

_log = structlog.get_logger(__name__)


@dataclass(frozen=True, slots=True)
class ReproductionJob:
    """Executes reproduction jobs. `closing` interrupts the current one, which the next worker runs again."""

    database: Database
    _: KW_ONLY
    worker: str
    lease_s: float
    closing: threading.Event

    def __call__(self, job: ClaimedJob) -> None:
        """Run a job from its stored order to its stored result.

        Raises GainlineError for errors to be shown to a person, and CancelledError when the worker ends.
        """
        order, started_s = read_order(job.order), monotonic()
        with ChildProcess(reproduce, order.name, order.full, name=f"reproduction {order.name}") as process:
            try:
                result = self._watch(job, process)
            except ProcessDiedError as death:
                _log.warning("the computing process died", name=order.name, exit_code=death.exit_code)
                with self.database.write() as session:
                    jobs.requeue_job(session, job.id, worker=self.worker, its_process_died=True)
                return
        if result is None:
            _log.info("reproduction cancelled", name=order.name)
            return
        with self.database.write() as session:
            jobs.finish_job(session, job.id, worker=self.worker, result=asdict(result))
        _log.info("reproduction stored", name=order.name, seconds=round(monotonic() - started_s, 1))

    def _watch(self, job: ClaimedJob, process: ChildProcess) -> Result | None:
        """Wait for the result and store the progress; None if the job was cancelled meanwhile."""
        latest, stored = ProgressReport(0.0, "starting"), ProgressReport(0.0, "")
        due_s = 0.0
        while True:
            if process.pipe.poll(max(due_s - monotonic(), 0.0)):
                message: ProgressReport | Result | TaskError = process.receive()
                if not isinstance(message, ProgressReport):
                    return result_of(message)
                latest = message
            if monotonic() < due_s:
                continue
            due_s = monotonic() + LOOK_S
            if self.closing.is_set():
                with self.database.write() as session:
                    jobs.requeue_job(session, job.id, worker=self.worker)
                raise CancelledError
            if not self._still_wanted(job, latest, is_news=latest != stored):
                return None
            stored = latest

    def _still_wanted(self, job: ClaimedJob, latest: ProgressReport, *, is_news: bool) -> bool:
        """Whether the job still belongs to this worker; new progress is stored, which also notifies the browsers."""
        with self.database.write() as session:
            if not is_news:
                return jobs.heartbeat_job(session, job.id, worker=self.worker, lease_s=self.lease_s)
            return jobs.report_progress(
                session, job.id, latest.share, latest.doing, worker=self.worker, lease_s=self.lease_s
            )
