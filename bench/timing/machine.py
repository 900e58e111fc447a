"""How much slower this machine is now than the one of the limits, from work of a known duration.

Processors differ, and one that is shared with other machines is slower at times; limits of processor time are raised in
proportion. Imports nothing but the standard library, because `./dev` uses it outside the environment.
"""

import contextlib
import json
import statistics
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Final

REFERENCE_S: Final = 0.015
"""Processor time of the reference work on an EPYC at 2.6 GHz that nobody else slows down."""
EVERY_S: Final = 5.0
SAMPLES: Final = 20

_DOCUMENT: Final = json.dumps([{"number": number, "text": str(number)} for number in range(20_000)])


def sample() -> float:
    """Do the reference work once, and return its processor time relative to `REFERENCE_S`."""
    before_s = time.thread_time()
    json.dumps(json.loads(_DOCUMENT))
    return (time.thread_time() - before_s) / REFERENCE_S


def slowness() -> float:
    """Return how many times slower the machine is in several samples at once."""
    return _factor([sample() for _ in range(SAMPLES)])


def _factor(samples: Sequence[float]) -> float:
    """A machine that is faster does not lower a limit."""
    return max(1.0, statistics.mean(samples))


@contextlib.contextmanager
def measured_slowness() -> Iterator[Callable[[], float]]:
    """Take a sample again and again until the end of the block; gives the slowness over the block, after it."""
    samples: list[float] = []
    ended = threading.Event()

    def measure() -> None:
        while not ended.wait(EVERY_S if samples else 0.0):
            samples.append(sample())

    measuring = threading.Thread(target=measure)
    measuring.start()
    try:
        yield lambda: _factor(samples)
    finally:
        ended.set()
        measuring.join()
