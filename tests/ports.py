"""Ports of this machine for sockets that a test opens later."""

import itertools
import os
import random
import socket
from typing import Final

LOOPBACK: Final = "127.0.0.1"
_FIRST: Final = 16_000
_PER_WORKER: Final = 1_600
_WORKERS: Final = 10
"""All below the ports that the operating system gives to whoever asks for any: nobody else is given one of them between
its choice and its use."""


def _ports_of_this_worker() -> range:
    """Other tests run in other processes at the same time."""
    number = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % _WORKERS
    return range(_FIRST + number * _PER_WORKER, _FIRST + (number + 1) * _PER_WORKER)


_candidates = itertools.cycle(random.sample(_ports_of_this_worker(), _PER_WORKER))


def free_port() -> int:
    """One that no UDP socket of the loopback interface has, and that this process was not given lately."""
    return next(port for port in _candidates if _is_free(port))


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((LOOPBACK, port))
        except OSError:
            return False
    return True
