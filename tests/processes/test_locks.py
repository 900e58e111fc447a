"""Locks between real processes."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from app.processes.locks import Holder, LockedError, exclusive

HOLD = """
import sys, time
from pathlib import Path
from app.processes.locks import exclusive
with exclusive(Path(sys.argv[1])) as sign:
    sign("http://127.0.0.1:1")
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_holder_learns_who_the_first_is_and_a_killed_one_holds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "x.lock"
    with subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE) as first:
        assert first.stdout is not None
        assert first.stdout.readline() == b"held\n"
        with pytest.raises(LockedError) as refusal, exclusive(path):
            pass
        assert refusal.value.holder == Holder(pid=first.pid, address="http://127.0.0.1:1")
        assert str(refusal.value.holder) == f"process {first.pid} at http://127.0.0.1:1"
        first.send_signal(signal.SIGKILL)
        first.wait()
    with exclusive(path):
        assert str(os.getpid()) in path.read_text()


def test_a_patient_holder_waits_its_turn(tmp_path: Path) -> None:
    path = tmp_path / "x.lock"
    with subprocess.Popen([sys.executable, "-c", HOLD, str(path)], stdout=subprocess.PIPE) as first:
        assert first.stdout is not None
        first.stdout.readline()

        def keep_waiting() -> bool:
            first.kill()
            return True

        with exclusive(path, keep_waiting=keep_waiting):
            assert first.wait() == -signal.SIGKILL
