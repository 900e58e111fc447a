"""How long tests wait for what comes about in its own time: all for the same, which their time limit alone decides."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class Waits:
    """The bound of every wait. As good as for ever, unless tests have a time limit."""

    at_most_s = 86_400.0


def wait_for(what: str, seen: Callable[[], T | None], pause: Callable[[], object] = lambda: time.sleep(0.02)) -> T:
    """Whatever `seen` gives once it gives something true."""
    end_s = time.monotonic() + Waits.at_most_s
    while not (found := seen()):
        assert time.monotonic() < end_s, f"waited {Waits.at_most_s:g} s in vain for {what}"
        pause()
    return found


def eventually(holds: Callable[[], bool]) -> None:
    """For what its own line says well enough."""
    wait_for("this to hold", holds)
