"""Carrying out reproductions, with real processes that are cancelled and killed."""

import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from multiprocessing import active_children

import pytest

from app.common.states import JobState
from app.db.session import Database
from app.jobs import service as jobs
from app.jobs.runner import ClaimedJob, JobRunner
from app.jobs.service import Job
from app.reproductions import service
from app.reproductions.service import REPRODUCTION_JOB
from app.reproductions.tasks import ReproductionJob
from tests.builders import WORKER
from tests.waiting import Waits, eventually

LONG = "variability"


class Working:
    """One runner with one job, carried out by a thread."""

    def __init__(self, database: Database) -> None:
        self.database = database
        self.closing = threading.Event()
        self.raised: list[BaseException] = []
        self._reproducer = ReproductionJob(database, worker=WORKER, lease_s=30.0, closing=self.closing)
        self.runner = JobRunner(database, REPRODUCTION_JOB, self._perform, room=1, worker=WORKER, lease_s=30.0)

    def _perform(self, job: ClaimedJob) -> None:
        try:
            self._reproducer(job)
        except BaseException as error:
            self.raised.append(error)
            raise

    def ask(self, name: str) -> int:
        with self.database.write() as session:
            return service.request_run(session, name, full=False).id

    def job(self, job_id: int) -> Job:
        with self.database.read() as session:
            return jobs.get_job(session, job_id)

    @contextmanager
    def under_way(self, job_id: int) -> Iterator[None]:
        """The job in a thread; it has ended when the block has."""
        claimed = self.runner.claim()
        assert claimed is not None
        assert claimed.id == job_id
        thread = threading.Thread(target=self.runner.carry_out, args=(claimed,))
        thread.start()
        try:
            yield
        finally:
            thread.join(Waits.at_most_s)
        assert not thread.is_alive()

    def computing(self) -> list[int]:
        """The processes at it."""
        return [child.pid for child in active_children() if child.name.startswith("reproduction") and child.pid]

    def advanced(self, job_id: int) -> bool:
        return (self.job(job_id).done_share or 0.0) > 0.0


@pytest.fixture
def working(database: Database) -> Iterator[Working]:
    made = Working(database)
    yield made
    made.closing.set()


def test_a_reproduction_is_computed_in_a_process_of_its_own_and_its_result_kept(working: Working) -> None:
    job_id = working.ask("controller")
    with working.under_way(job_id):
        pass
    done = working.job(job_id)
    assert (done.state, done.done_share, done.attempts) == (JobState.DONE, 1.0, 1)
    with working.database.read() as session:
        found = service.get_reproduction(session, "controller")
    assert {row.measured for row in found.rows} == {0.0}
    assert working.computing() == []
    assert working.raised == []


def test_a_cancelled_reproduction_stops_within_seconds(working: Working) -> None:
    job_id = working.ask(LONG)
    with working.under_way(job_id):
        eventually(lambda: working.advanced(job_id))
        with working.database.write() as session:
            jobs.cancel_job(session, job_id)
        eventually(lambda: working.computing() == [])
    assert working.job(job_id).state == JobState.CANCELLED
    assert working.raised == []


def test_a_reproduction_waits_again_uncounted_when_the_worker_ends(working: Working) -> None:
    job_id = working.ask(LONG)
    with working.under_way(job_id):
        eventually(lambda: working.advanced(job_id))
        working.closing.set()
    waiting = working.job(job_id)
    assert (waiting.state, waiting.attempts, waiting.done_share) == (JobState.QUEUED, 0, None)
    assert [type(error) for error in working.raised] == [CancelledError]
    assert working.computing() == []


def test_a_reproduction_whose_process_is_killed_waits_again_and_fails_the_third_time(working: Working) -> None:
    job_id = working.ask(LONG)
    for attempt in range(1, jobs.MAX_ATTEMPTS + 1):
        with working.under_way(job_id):
            eventually(lambda: len(working.computing()) == 1)
            os.kill(working.computing()[0], signal.SIGKILL)
        job = working.job(job_id)
        assert job.attempts == attempt
        assert job.state == (JobState.QUEUED if attempt < jobs.MAX_ATTEMPTS else JobState.FAILED)
    failed = working.job(job_id)
    assert failed.problem is not None
    assert failed.problem.hint
    assert failed.actions == ["retry"]


def test_an_order_that_cannot_be_read_fails_with_its_reason(working: Working) -> None:
    with working.database.write() as session:
        job_id = jobs.enqueue_job(session, REPRODUCTION_JOB, order={"name": "table9"}).id
    with working.under_way(job_id):
        pass
    failed = working.job(job_id)
    assert failed.state == JobState.FAILED
    assert failed.problem is not None
    assert failed.problem.title == "The reproduction table9 no longer exists."


def test_a_runner_claims_no_more_than_its_concurrency(working: Working) -> None:
    job_id, other = working.ask("controller"), working.ask("table1")
    with working.under_way(job_id):
        assert working.runner.claim() is None
    assert working.job(other).state == JobState.QUEUED
    again = working.runner.claim()
    assert again is not None
    assert again.id == other
