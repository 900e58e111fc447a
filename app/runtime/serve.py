"""`gainline serve`: the web process, with a worker beside it, which is kept running: it is restarted with back-off when
it dies, and has long to stop.

The worker is started first, from a function that imports no web application, so that both start in parallel.
"""

import errno
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from typing import Final, Self

import structlog

from app import __version__
from app.common.data_folder import make_private, prepare_data_dir
from app.common.errors import AddressError, AlreadyRunningError, Problem
from app.common.logging import configure_logs, say
from app.common.settings import Settings
from app.db.revision import is_current
from app.processes import start_loading
from app.processes.locks import LockedError, exclusive
from app.web.addresses import exposure, web_address

FIRST_PAUSE_S: Final = 0.2
LONGEST_PAUSE_S: Final = 10.0
HEALTHY_AFTER_S: Final = 20.0
"""A child that lived this long is restarted after the shortest pause."""
STOP_TIMEOUT_S: Final = 70.0
"""How long a stopping child may take to land its vehicles and record the flights: landing alone may take 40 s, and Land
is repeated for 60 s to a vehicle that may be in the air."""
STACK_DUMP_TIMEOUT_S: Final = 0.5
THREAD_SWITCH_INTERVAL_S: Final = 0.001
"""Maximum time for which a thread that draws figures keeps the event loop waiting for the interpreter lock."""

_log = structlog.get_logger(__name__)


def run_worker_process(settings: Settings) -> None:
    """Import the worker, and run it until the parent stops it or ends. Ctrl-C is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_loading()
    from app.runtime.worker import run_supervised_worker  # noqa: PLC0415

    run_supervised_worker(settings)


class WorkerSupervisor:
    """Runs the worker in a spawned process between enter and exit."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._stopping = threading.Event()
        self._process = self._start()
        self._thread = threading.Thread(target=self._watch, name="worker supervisor", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        process = self._process
        if process.is_alive():
            process.terminate()
        try:
            process.join(STOP_TIMEOUT_S)
        finally:
            if process.is_alive():
                _log.error("child did not stop; killing it", child="worker", pid=process.pid)
                _dump_stacks(process)
                process.kill()
                process.join()

    def _start(self) -> BaseProcess:
        process = get_context("spawn").Process(target=run_worker_process, args=(self._settings,), name="worker")
        process.start()
        _log.info("child started", child="worker", pid=process.pid)
        return process

    def _watch(self) -> None:
        pause_s = FIRST_PAUSE_S
        started_s = time.monotonic()
        while not self._stopping.is_set():
            process = self._process
            process.join(0.1)
            if process.is_alive() or self._stopping.is_set():
                continue
            lived_s = time.monotonic() - started_s
            pause_s = FIRST_PAUSE_S if lived_s > HEALTHY_AFTER_S else min(2 * pause_s, LONGEST_PAUSE_S)
            _log.error(
                "child died; restarting it",
                child="worker",
                pid=process.pid,
                code=process.exitcode,
                lived_s=round(lived_s, 1),
                pause_s=pause_s,
            )
            if not self._stopping.wait(pause_s):
                self._process = self._start()
                started_s = time.monotonic()


def _dump_stacks(process: BaseProcess) -> None:
    """Have the process write its threads' stacks to standard error (`app.common.logging`)."""
    if process.pid is not None:
        os.kill(process.pid, signal.SIGUSR1)
        time.sleep(STACK_DUMP_TIMEOUT_S)


def serve(settings: Settings, *, with_worker: bool = True, announce: Callable[[str], None] = say) -> None:
    """Run the dashboard until SIGINT or SIGTERM; for the main thread only. `announce` gets a line for each stage of the
    start; the worker prints its own.

    Raises AlreadyRunningError when another server uses this database, AddressError when the server cannot listen on
    host and port, and StorageError when the data folder cannot be used or the database cannot be opened or migrated.
    """
    prepare_data_dir(settings.data_dir)
    if narrowed := make_private(settings.data_dir):
        announce(narrowed)
    with ExitStack() as stack:
        for number in (signal.SIGINT, signal.SIGTERM):
            # Unwinds the stack. Uvicorn handles signals while it runs, and raises them again after its shutdown.
            stack.callback(signal.signal, number, signal.signal(number, lambda *_: sys.exit(0)))
        try:
            sign = stack.enter_context(exclusive(settings.data_dir / "server.lock"))
        except LockedError as error:
            where = error.holder.address if error.holder else ""
            raise AlreadyRunningError(
                f"Another Gainline server ({error.holder or 'its process is unknown'}) already uses "
                f"{settings.database_file}.",
                hint=(f"Open {where}, " if where else "Use that one, ")
                + "stop it first, or choose another folder for this server with --data-dir. The running server is "
                "not affected.",
            ) from error
        sys.setswitchinterval(THREAD_SWITCH_INTERVAL_S)
        listener = stack.enter_context(listen(settings.host, settings.port))
        sign(web_address(settings.host, listener.getsockname()[1]))
        configure_logs(settings.data_dir, "web", settings.log_level)
        announce(f"Gainline {__version__}, data folder {settings.data_dir}")
        if not is_current(settings.database_file):
            from app.db.migrate import migrate  # noqa: PLC0415

            migrate(settings.database_file, announce)
        if with_worker:
            announce("Starting the worker and the dashboard")
            stack.enter_context(WorkerSupervisor(settings))
        if (exposed := exposure(settings.host)) is not None:
            announce(exposed)
        from app.runtime.web_server import run  # noqa: PLC0415 - imported while the worker does its own imports

        run(settings, listener, announce)


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; early clients wait until the application is ready. Raises AddressError."""
    try:
        family, _, _, _, where = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        return socket.create_server(where[:2], family=family, backlog=2048)
    except OSError as error:
        match error.errno:
            case errno.EADDRINUSE:
                problem = Problem("port", f"{port} is in use by another program")
                hint = f"Stop that program, or choose another port: --port {port % 65535 + 1} (0 selects a free one)."
            case errno.EACCES:
                problem = Problem("port", f"this user has no permission to open port {port}")
                hint = "Choose a port above 1023, for instance --port 8000."
            case _:
                problem = Problem("host", f"{host} is not an address of this computer ({error.strerror or error})")
                hint = "Use --host 127.0.0.1 (this computer only) or one of this computer's addresses."
        raise AddressError(f"Gainline cannot listen on {host}, port {port}.", hint=hint, problems=(problem,)) from error
