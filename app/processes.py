"""How the processes that fly and compute are started: forked from a server that has loaded the numerics once.

A fresh interpreter takes seconds of a processor to load them, a fork of one that has them a few milliseconds. The
server has one thread and does nothing but fork, so that a fork never copies a lock that somebody holds. Where forking a
process that has loaded system libraries is not safe (macOS), each process is a fresh interpreter.
"""

import sys
from functools import cache
from multiprocessing import get_context
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.forkserver import ensure_running
from typing import Final

PRELOADED: Final = ("__main__", "app.preload")


@cache
def process_context() -> ForkServerContext | SpawnContext:
    """The context that starts them."""
    if sys.platform != "linux":
        return get_context("spawn")
    context = get_context("forkserver")
    context.set_forkserver_preload(list(PRELOADED))
    return context


def start_loading() -> None:
    """Have the server load what it forks, beside whatever this process does meanwhile."""
    if process_context().get_start_method() == "forkserver":
        ensure_running()
