"""The worker process: flies vehicles and computes for the web process. One for each database.

Flights, connected vehicles and computations have processes of their own, each watched by a thread of this one, which
writes to the database. The live socket has its own thread, so that an abort is received whatever the other threads do.
Proposals have their own pool. Work that no operator waits for during flights runs in separate processes with lower
priority: error landscapes, and reproductions, which take minutes.
"""

import os
import platform
import queue
import signal
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Final

import structlog

from app.campaigns.computation import warm_up
from app.campaigns.landscapes import LANDSCAPE_JOB
from app.campaigns.proposals import PROPOSAL_JOB
from app.campaigns.tasks import compute_landscape, compute_proposal
from app.common.data_folder import make_private, prepare_data_dir
from app.common.errors import AlreadyRunningError, StorageError
from app.common.logging import configure_logs, say
from app.common.settings import Settings, is_loopback
from app.core.clock import REAL_TIME
from app.db.migrate import require_current
from app.db.outbox import DatabaseWatch
from app.db.session import RETRY_S, Database, retry_until_stored
from app.flights.connection_manager import VehicleConnectionManager
from app.flights.flight_process import FlightProcessPool
from app.flights.runner import FlightRunner
from app.flights.worker_part import AbortRegistry, WorkerPart
from app.jobs.runner import JobRunner, recover
from app.live.link import LiveServer
from app.live.messages import PublishedMessage, live_address
from app.processes import when_parent_ends
from app.processes.calls import ComputePool
from app.processes.locks import LockedError, exclusive
from app.reproductions.service import REPRODUCTION_JOB
from app.reproductions.tasks import ReproductionJob
from app.vehicles.flight_end import Requester, StopRequest

FLIGHTS_AT_ONCE: Final = 8
ACTS_AT_ONCE: Final = 8
SPARE_PROCESSORS: Final = max(1, (os.cpu_count() or 2) - 1)
REPRODUCTIONS_AT_ONCE: Final = 1
LANDSCAPES_AT_ONCE: Final = 1
LOOK_ANYWAY_S: Final = 1.0
SWITCH_EVERY_S: Final = 0.001
"""Maximum time for which a thread that writes to the database keeps the one that forwards aborts waiting for the
interpreter lock; Python's default of 5 ms adds up over several threads."""

_log = structlog.get_logger(__name__)


def run_worker(settings: Settings) -> None:
    """Run until SIGINT or SIGTERM, which also end running flights; for the main thread only.

    Raises AlreadyRunningError when another worker uses this database, SchemaError when it is not up to date, and
    StorageError when it cannot be opened or the data folder cannot be used.
    """
    worker = Worker(settings)
    worker.end_on(signal.SIGINT, signal.SIGTERM)
    try:
        worker.run(keep_waiting=lambda: False)
    except LockedError as error:
        raise AlreadyRunningError(
            f"Another Gainline worker ({error.holder or 'its process is unknown'}) already uses "
            f"{settings.database_file}.",
            hint="One is enough: `gainline serve` starts its own. Stop that worker first, or start this one "
            "with another data folder (GAINLINE_DATA_DIR).",
        ) from error


def run_supervised_worker(settings: Settings) -> None:
    """Run the worker as a child of the web process.

    It waits while an older worker ends, and ends with its parent once its flights are over.
    """
    worker = Worker(settings)
    worker.end_on(signal.SIGTERM)
    when_parent_ends(partial(worker.end, "the web process has exited"))
    with suppress(LockedError):  # stopped while it waited for the lock
        worker.run(keep_waiting=lambda: not worker.closing.is_set())


def _say_it_computes(first: Future[int]) -> None:
    if not first.cancelled() and first.exception() is None:
        say("The worker is ready to compute.")


@dataclass(slots=True)
class Worker:
    """Everything that runs while the worker holds its lock."""

    settings: Settings
    name: str = field(default_factory=lambda: f"{platform.node()}:{os.getpid()}", init=False)
    abort_registry: AbortRegistry = field(default_factory=AbortRegistry, init=False)
    closing: threading.Event = field(default_factory=threading.Event, init=False)
    """Set when it is to end: it then claims no new work, and finishes its flights."""
    end_reason: str = field(default="", init=False)

    def end(self, reason: str) -> None:
        self.end_reason = self.end_reason or reason
        self.closing.set()

    def end_on(self, *signals: signal.Signals) -> None:
        """Install signal handlers that only queue the request, because the interrupted thread may hold any lock; a
        separate thread handles it."""
        asked: queue.SimpleQueue[str] = queue.SimpleQueue()

        def handle_signals() -> None:
            while True:
                self.end(f"the worker was stopped ({asked.get()})")
                self.abort_registry.abort_all(StopRequest(by=Requester.PROGRAM_STOPPED))

        threading.Thread(target=handle_signals, name="signals", daemon=True).start()
        for number in signals:
            signal.signal(number, lambda number, _frame: asked.put(signal.Signals(number).name))

    def run(self, *, keep_waiting: Callable[[], bool]) -> None:
        """Prepare the data folder and the logs, take the lock, and work."""
        folder = self.settings.data_dir
        prepare_data_dir(folder)
        narrowed = make_private(folder)
        configure_logs(folder, "worker", self.settings.log_level)
        if narrowed:
            _log.warning("data folder made private", why=narrowed)
        sys.setswitchinterval(SWITCH_EVERY_S)
        with exclusive(folder / "worker.lock", keep_waiting=keep_waiting):
            require_current(self.settings.database_file)
            self.work()

    def work(self) -> None:
        """Recover what the last worker left, then work until requested to end; then finish the flights and drop
        everything else."""
        with ExitStack() as stack:
            database = Database(self.settings.database_file)
            stack.callback(database.close)
            sessions, flight_runner, live = self._build_runners(database)
            stack.callback(flight_runner.close)
            self._until_stored(flight_runner.recover)
            self._until_stored(sessions.recover)
            stack.enter_context(live)  # only now may flights be requested: recovery would withdraw them
            acting = stack.enter_context(ThreadPoolExecutor(ACTS_AT_ONCE, thread_name_prefix="act"))
            stack.callback(sessions.close)
            threads = SPARE_PROCESSORS + REPRODUCTIONS_AT_ONCE + LANDSCAPES_AT_ONCE
            computing = stack.enter_context(ThreadPoolExecutor(threads, thread_name_prefix="job"))
            pool = stack.enter_context(ComputePool(SPARE_PROCESSORS, prepare=warm_up))
            landscape_pool = stack.enter_context(ComputePool(LANDSCAPES_AT_ONCE, prepare=warm_up, niceness=5))
            job_runners = self._build_job_runners(database, pool, landscape_pool)
            flying = stack.enter_context(ThreadPoolExecutor(FLIGHTS_AT_ONCE, thread_name_prefix="flight"))

            def claim() -> None:
                trial_ids = self.abort_registry.trial_ids
                while len(trial_ids()) < FLIGHTS_AT_ONCE and (task := flight_runner.claim()) is not None:
                    flying.submit(flight_runner.carry_out, task)
                while (act := sessions.claim()) is not None:
                    acting.submit(sessions.carry_out, act)
                sessions.maintain()
                for runner in job_runners:
                    while (job := runner.claim()) is not None:
                        computing.submit(runner.carry_out, job)
                    runner.heartbeat()

            stack.callback(self.end, "the worker failed; see its log")
            self._until_stored(lambda: recover(database))
            computing.submit(pool.run, os.getpid).add_done_callback(_say_it_computes)
            _log.info("worker ready", worker=self.name)
            say("The worker is ready to fly.")
            self._loop(database, claim)
            _log.info("worker ends", why=self.end_reason, flying=self.abort_registry.trial_ids())

    def _build_runners(self, database: Database) -> tuple[VehicleConnectionManager, FlightRunner, LiveServer]:
        def publish(message: PublishedMessage) -> None:
            live.publish(message)

        part = WorkerPart(
            database=database,
            data_dir=self.settings.data_dir,
            abort_registry=self.abort_registry,
            publish=publish,
            worker=self.name,
            closing=self.closing,
        )
        sessions = VehicleConnectionManager(part, links=is_loopback(self.settings.host))
        live = LiveServer(
            live_address(part.data_dir),
            abort=sessions.abort,
            order=sessions.order,
        )
        pool = FlightProcessPool(part.data_dir, part.clock)
        return sessions, FlightRunner(part, session=sessions.session, pool=pool), live

    def _build_job_runners(
        self, database: Database, pool: ComputePool, landscape_pool: ComputePool
    ) -> tuple[JobRunner, ...]:
        proposer = partial(compute_proposal, database, pool, worker=self.name)
        reproducer = ReproductionJob(database, worker=self.name, lease_s=self.settings.lease_s, closing=self.closing)
        landscaper = partial(
            compute_landscape, database, landscape_pool, worker=self.name, lease_s=self.settings.lease_s
        )
        performed = (
            (PROPOSAL_JOB, proposer, SPARE_PROCESSORS),
            (REPRODUCTION_JOB, reproducer, REPRODUCTIONS_AT_ONCE),
            (LANDSCAPE_JOB, landscaper, LANDSCAPES_AT_ONCE),
        )
        return tuple(
            JobRunner(database, kind, perform, room=room, worker=self.name, lease_s=self.settings.lease_s)
            for kind, perform, room in performed
        )

    def _loop(self, database: Database, claim: Callable[[], None]) -> None:
        with DatabaseWatch(database.file) as watch:
            while not self.closing.is_set():
                try:
                    claim()
                except StorageError as error:
                    _log.error("work cannot be claimed", why=str(error))
                    self.closing.wait(RETRY_S)
                watch.wait(self.closing, LOOK_ANYWAY_S)

    def _until_stored(self, work: Callable[[], None]) -> None:
        if not self.closing.is_set():
            retry_until_stored(
                work,
                lambda error: _log.error("the worker cannot start", why=str(error)),
                closing=self.closing,
                clock=REAL_TIME,
            )
