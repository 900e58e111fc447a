"""Files from strangers are read in a process with limits: what it may take, and what is said when it takes more."""

import os
import time
from collections.abc import Callable

import pytest

from app.campaigns.trials import records
from app.common.errors import InputError, TrajectoryError
from app.core.errors import Problem
from app.processes.calls import FILE, Limits, run_limited

LITTLE = Limits(memory_bytes=2**27)
BRIEF = Limits(processor_s=1)
A3_95 = b"\xa3\x95"
"""How messages of ArduPilot's logs begin."""


def whose_process() -> int:
    return os.getpid()


def turn_for_ever() -> None:
    while True:
        pass


def wait_for_ever() -> None:
    time.sleep(3600.0)


def hold(size: int) -> int:
    return len(bytearray(size))


def refuse() -> None:
    raise TrajectoryError("It is damaged.", hint="Copy it again.", problems=(Problem("file", "has no rows"),))


def end() -> None:
    os._exit(7)


def test_it_runs_in_a_process_of_its_own() -> None:
    assert run_limited(LITTLE, whose_process) != os.getpid()


def test_what_it_refuses_is_told_as_it_is() -> None:
    with pytest.raises(TrajectoryError, match="It is damaged") as refused:
        run_limited(LITTLE, refuse)
    assert refused.value.hint == "Copy it again."
    assert refused.value.problems == (Problem("file", "has no rows"),)


@pytest.mark.parametrize(
    ("limits", "work"),
    [(BRIEF, turn_for_ever), (Limits(wall_s=0.2), wait_for_ever), (LITTLE, end)],
    ids=["processor", "time", "ends by itself"],
)
def test_a_file_that_takes_too_long_is_refused_by_its_name(limits: Limits, work: Callable[[], None]) -> None:
    with pytest.raises(InputError, match="This file cannot be read; nothing was stored") as refused:
        run_limited(limits, work)
    assert [problem.field for problem in refused.value.problems] == ["file"]


def test_a_file_that_takes_too_much_memory_is_refused_by_its_name() -> None:
    assert run_limited(LITTLE, hold, 2**20) == 2**20
    with pytest.raises(InputError, match="GiB to read"):
        run_limited(LITTLE, hold, 2**29)


def test_a_log_of_nothing_but_beginnings_is_read_elsewhere_and_refused() -> None:
    """46 MiB of it kept the web process busy for 9 s."""
    begun_s = time.process_time()
    with pytest.raises(InputError):
        records.read_upload(A3_95 + b"\x80" + A3_95 * 2**20, name="flight.bin", takeoff=None, companion=None)
    assert time.process_time() - begun_s < 1.0


def test_the_limits_of_a_file_are_those_that_the_documents_tell() -> None:
    assert (FILE.processor_s, FILE.memory_bytes) == (60, 2**30)
