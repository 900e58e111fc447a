"""`gainline serve`: the web process, with a worker beside it.

The worker is started first, from a function that imports no web application, so that both start in parallel.
"""

import errno
import signal
import socket
import sys
from collections.abc import Callable
from contextlib import ExitStack
from types import FrameType
from typing import Final

from app import __version__
from app.common.data_folder import make_private, prepare_data_dir
from app.common.errors import AddressError, AlreadyRunningError, Problem
from app.common.logging import configure_logs, say
from app.common.settings import Settings
from app.db.revision import is_current
from app.processes import start_loading
from app.processes.locks import LockedError, exclusive
from app.processes.supervisor import Supervisor
from app.web.addresses import exposure, web_address


def run_worker_process(settings: Settings) -> None:
    """Import the worker, and run it until the parent stops it or ends. Ctrl-C is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_loading()
    from app.runtime.worker import run_supervised_worker  # noqa: PLC0415

    run_supervised_worker(settings)


THREAD_SWITCH_INTERVAL_S: Final = 0.001
"""Maximum time for which a thread that draws figures keeps the event loop waiting for the interpreter lock."""


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
            stack.callback(signal.signal, number, signal.signal(number, _exit))
        try:
            sign = stack.enter_context(exclusive(settings.data_dir / "server.lock"))
        except LockedError as error:
            raise _already_served(settings, error) from error
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
            stack.enter_context(Supervisor(run_worker_process, settings, name="worker"))
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
        raise _no_address(host, port, error) from error


def _exit(_signal: int, _frame: FrameType | None) -> None:
    """Unwind the stack. Uvicorn handles signals while it runs, and raises them again after its shutdown."""
    raise SystemExit(0)


def _already_served(settings: Settings, error: LockedError) -> AlreadyRunningError:
    where = error.holder.address if error.holder else ""
    return AlreadyRunningError(
        f"Another Gainline server ({error.holder or 'its process is unknown'}) already uses {settings.database_file}.",
        hint=(f"Open {where}, " if where else "Use that one, ")
        + (
            "stop it first, or choose another folder for this server with --data-dir. The running server is "
            "not affected."
        ),
    )


def _no_address(host: str, port: int, error: OSError) -> AddressError:
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
    return AddressError(f"Gainline cannot listen on {host}, port {port}.", hint=hint, problems=(problem,))
