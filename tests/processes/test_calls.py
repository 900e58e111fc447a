"""Calls in processes of their own, with real ones. Those that compute are killed; those that read files from strangers
have limits: what such a file may take, and what is said when it takes more."""

import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import CancelledError
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from app.campaigns.trials import records
from app.common.errors import InputError, TrajectoryError
from app.core.errors import Problem
from app.processes.calls import FILE, ComputePool, CrashedError, Limits, run_limited

LEAST_FAVOURED = 19
"""There is no greater niceness: see `man nice`."""


def double(number: int) -> int:
    return 2 * number


def die_once(flag: Path) -> int:
    """Killed like by another process, the first time only."""
    if not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return 7


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, 0)


def die_in_the_middle_of_the_result(flag: Path) -> bytes:
    """The first time only; the result is larger than any pipe."""
    if flag.exists():
        return b"whole"
    flag.touch()
    Connection._send = send_a_part_and_die  # type: ignore[attr-defined]
    return bytes(50_000_000)


def send_a_part_and_die(pipe: "Connection[object, object]", content: bytes) -> None:
    """The length goes out first, in four bytes."""
    os.write(pipe.fileno(), content[:1000])
    if len(content) > 1000:
        os.kill(os.getpid(), signal.SIGKILL)


def sleep_long(mine: Path) -> None:
    mine.write_text(str(os.getpid()))
    time.sleep(60)


def refuse() -> None:
    raise ValueError("not today")


def test_results_and_errors_of_the_task_come_back() -> None:
    with ComputePool(1, prepare=time.time) as pool:
        assert pool.run(double, 21) == 42
        with pytest.raises(ValueError, match="not today"):
            pool.run(refuse)
        assert pool.run(double, 4) == 8


def test_a_killed_process_is_replaced_and_the_task_tried_again(tmp_path: Path) -> None:
    with ComputePool(1, prepare=time.time) as pool:
        assert pool.run(die_once, tmp_path / "flag") == 7


def test_a_process_killed_while_it_tells_its_result_is_replaced_too(tmp_path: Path) -> None:
    with ComputePool(1, prepare=time.time) as pool:
        assert pool.run(die_in_the_middle_of_the_result, tmp_path / "flag") == b"whole"


def test_a_task_that_always_kills_its_process_fails_and_the_next_one_works() -> None:
    with ComputePool(1, prepare=time.time) as pool:
        with pytest.raises(CrashedError, match="died 2 times"):
            pool.run(die)
        assert pool.run(double, 3) == 6


def test_processes_give_way_to_others_as_far_as_they_are_told() -> None:
    with ComputePool(1, prepare=time.time) as even, ComputePool(1, prepare=time.time, niceness=3) as nice:
        assert even.run(niceness) == niceness()
        assert nice.run(niceness) == min(niceness() + 3, LEAST_FAVOURED)


def test_closing_the_pool_ends_a_long_task_at_once(tmp_path: Path) -> None:
    outcome: list[type[BaseException]] = []

    def wait_for_it() -> None:
        try:
            pool.run(sleep_long, tmp_path / "pid")
        except CancelledError as error:
            outcome.append(type(error))

    with ComputePool(1, prepare=time.time) as pool:
        waiting = threading.Thread(target=wait_for_it)
        waiting.start()
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.01)
    waiting.join()
    assert outcome == [CancelledError]
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


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


def refuse_the_file() -> None:
    raise TrajectoryError("It is damaged.", hint="Copy it again.", problems=(Problem("file", "has no rows"),))


def end() -> None:
    os._exit(7)


def test_it_runs_in_a_process_of_its_own() -> None:
    assert run_limited(LITTLE, whose_process) != os.getpid()


def test_what_it_refuses_is_told_as_it_is() -> None:
    with pytest.raises(TrajectoryError, match="It is damaged") as refused:
        run_limited(LITTLE, refuse_the_file)
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
