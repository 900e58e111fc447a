"""Storage that takes nothing, for real: a small file system that fills up, a database that somebody else has locked."""

import os
import signal
import sqlite3
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from tests.runtime.processes import Serving, in_the_air, stream
from tests.waiting import wait_for

pytestmark = pytest.mark.real_time("a server and its worker try again after times of their own")

SIZE_MB = 32
LESS_THAN_A_RECORD_MB = 3


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """An empty file system of 32 MB."""
    folder = tmp_path_factory.mktemp("disk")
    command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE_MB}m", "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("mounting a small file system needs root")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


@pytest.fixture(scope="module")
def small(disk: Path) -> Iterator[Serving]:
    """A server on it."""
    with Serving(disk / "data") as one:
        yield one


def fill(disk: Path, *, leave_mb: int = 0) -> Path:
    """A file that takes all the room but so much; the database's log is emptied first, whose room would serve again."""
    connection = sqlite3.connect(disk / "data" / "gainline.sqlite3")
    connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    connection.close()
    filler = disk / "filler"
    with filler.open("wb", buffering=0) as file, suppress(OSError):
        while file.write(bytes(4096)):
            pass
    os.truncate(filler, filler.stat().st_size - leave_mb * 2**20)
    return filler


@contextmanager
def locked(serving: Serving) -> Iterator[None]:
    """Another program holds the database's write lock, for longer than anybody waits for it."""
    connection = sqlite3.connect(serving.data_dir / "gainline.sqlite3", isolation_level=None)
    try:
        connection.execute("BEGIN IMMEDIATE")
        yield
    finally:
        connection.close()


def land_in_the_spool(serving: Serving, trial_id: int) -> None:
    """End the flight, and wait until the worker has found no way into the database for its record."""
    with stream(serving.url) as events:
        assert serving.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
        for name, _, data in events:
            if name == "phase" and "could not be stored yet" in data["note"]:
                break
    assert [path.suffix for path in (serving.data_dir / "spool").iterdir()] == [".flight"]
    assert serving.trial(trial_id, "flying")["record"] is None


@pytest.mark.complete
def test_a_request_on_a_full_disk_is_refused_with_a_remedy_and_works_once_there_is_room(
    disk: Path, small: Serving
) -> None:
    flown = small.trial(small.fly(small.campaign()), "valid")
    filler = fill(disk)
    refused = small.api.post("/campaigns", json={"name": "no room", "vehicle": {"kind": "twin"}, "definition": {}})
    assert refused.status_code == 503
    assert "full" in refused.json()["detail"]
    assert "Free some disk space" in refused.json()["hint"]
    assert small.get(f"/trials/{flown['id']}") == flown, "what was there is there"
    filler.unlink()
    small.trial(small.fly(small.campaign()), "valid")


@pytest.mark.complete
def test_a_flight_whose_record_would_not_fit_does_not_start(disk: Path, small: Serving) -> None:
    campaign_id = small.campaign()
    small.worker_pid()
    filler = fill(disk, leave_mb=LESS_THAN_A_RECORD_MB)
    trial_id = small.fly(campaign_id)
    flight = wait_for(
        "the refusal",
        lambda: (found := small.get(f"/trials/{trial_id}")["flight"])["state"] == "failed" and found,
    )
    assert "no space for the flight record" in flight["problem"]
    assert small.trial(trial_id, "planned")["read_back"] is None
    filler.unlink()
    small.post(f"/trials/{trial_id}/fly", {"speed": None})
    small.trial(trial_id, "valid")


@pytest.mark.complete
def test_a_disk_that_fills_up_in_mid_flight_costs_no_record(disk: Path, small: Serving) -> None:
    trial_id = in_the_air(small, small.campaign(), speed=1.0)
    filler = fill(disk)
    assert small.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
    landed = small.trial(trial_id, "aborted")
    assert landed["record"]["duration_s"] > 0.2, "the room that was claimed before lift-off is enough for the database"
    assert landed["reason"] == "enough"
    filler.unlink()


@pytest.mark.complete
def test_a_record_waits_in_the_spool_while_the_database_takes_nothing(serving: Serving) -> None:
    trial_id = in_the_air(serving, serving.campaign(), speed=1.0)
    with locked(serving):
        land_in_the_spool(serving, trial_id)
    landed = serving.trial(trial_id, "aborted")
    assert (landed["flight"]["state"], landed["reason"]) == ("aborted", "enough")
    assert landed["record"]["duration_s"] > 0.2
    wait_for("the spool to be empty", lambda: not list((serving.data_dir / "spool").iterdir()))


@pytest.mark.complete
def test_a_record_in_the_spool_outlives_its_worker(serving: Serving) -> None:
    trial_id = in_the_air(serving, serving.campaign(), speed=1.0)
    with locked(serving):
        land_in_the_spool(serving, trial_id)
        os.kill(serving.worker_pid(), signal.SIGKILL)
    recovered = serving.trial(trial_id, "aborted")
    assert recovered["flight"]["state"] == "lost", "the ledger says what the worker knew"
    assert recovered["reason"] == "enough"
    assert recovered["record"]["duration_s"] > 0.2
    wait_for("the spool to be empty", lambda: not list((serving.data_dir / "spool").iterdir()))
