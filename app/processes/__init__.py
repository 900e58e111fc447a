"""Start of the processes that fly and compute: forked from a server that has imported the numerics once.

A new interpreter needs seconds of processor time to import them, a fork a few milliseconds. The server has one thread
and only forks, so that a fork never copies a held lock. Where forking a process that has loaded system libraries is not
safe (macOS), each process is a new interpreter.
"""

import sys
from functools import cache
from multiprocessing import get_context
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.forkserver import ensure_running
from typing import Final

PRELOADED: Final = ("__main__", "app.runtime.preload")


@cache
def process_context() -> ForkServerContext | SpawnContext:
    """The multiprocessing context that starts these processes."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    return context


def start_loading() -> None:
    """Start the fork server, so that it imports while this process continues."""
    if process_context().get_start_method() == "forkserver":
        ensure_running()
