"""The worker as a process beside the web process, which names it without importing what it is made of."""

import signal

from app.processes import start_loading
from app.settings import Settings


def run_worker_process(settings: Settings) -> None:
    """Import the worker, and work until the parent asks it to end or is gone. Ctrl-C is left to the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    start_loading()
    from app.worker import run_supervised_worker  # noqa: PLC0415

    run_supervised_worker(settings)
