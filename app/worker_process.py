"""Entry point of the worker as a child of the web process, which so need not import the worker."""

import signal

from app.common.settings import Settings
from app.processes import start_loading


def run_worker_process(settings: Settings) -> None:
    """Import the worker, and run it until the parent stops it or ends. Ctrl-C is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_loading()
    from app.worker import run_supervised_worker  # noqa: PLC0415

    run_supervised_worker(settings)
