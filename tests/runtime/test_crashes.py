"""What is left after a process was killed with SIGKILL, at the worst moments."""

import os
import signal
import socket
import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from tests.runtime.processes import Serving, children, fork_server, in_the_air, is_alive
from tests.waiting import wait_for

pytestmark = pytest.mark.real_time("processes are killed, noticed and replaced", about_s=15)


def require_sound_database(data_dir: Path) -> None:
    connection = sqlite3.connect(data_dir / "gainline.sqlite3")
    try:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
    finally:
        connection.close()


@pytest.mark.complete
def test_a_worker_killed_in_mid_flight_leaves_a_lost_trial_and_a_free_vehicle(serving: Serving) -> None:
    campaign_id = serving.campaign()
    first = serving.worker_pid()
    trial_id = in_the_air(serving, campaign_id, speed=1.0)
    pids = children(first)
    os.kill(first, signal.SIGKILL)
    lost = serving.trial(trial_id, "lost")
    assert lost["reason"] == "the worker stopped during the flight"
    assert lost["flight"]["state"] == "lost"
    assert serving.worker_pid() != first
    wait_for("the end of its processes", lambda: not any(is_alive(pid) for pid in pids))
    again = serving.trial(serving.fly(campaign_id), "valid")
    assert again["number"] == lost["number"] + 1
    vehicle = serving.get(f"/campaigns/{campaign_id}")["vehicle"]
    assert vehicle["state"] == "ready"
    ledger = [line["trial_id"] for line in serving.get(f"/vehicles/{vehicle['id']}/ledger")["items"]]
    flown = sorted(each for each in ledger if each in {trial_id, again["id"]})
    assert flown == [trial_id, again["id"]], "the lost trial flew once only"
    assert serving.trial(trial_id, "lost")["record"] is None
    require_sound_database(serving.data_dir)


@pytest.mark.complete
def test_a_flight_whose_own_process_is_killed_is_lost_and_the_worker_goes_on(serving: Serving) -> None:
    campaign_id = serving.campaign(kind="jsbsim")
    worker = serving.worker_pid()
    trial_id = in_the_air(serving, campaign_id, speed=1.0)
    for pid in children(worker):
        os.kill(pid, signal.SIGKILL)
    assert "exit code -9" in serving.trial(trial_id, "lost")["reason"]
    serving.trial(serving.fly(campaign_id), "valid")
    assert serving.worker_pid() == worker


@pytest.mark.complete
def test_a_killed_fork_server_costs_no_flight_and_there_is_another_for_the_next(serving: Serving) -> None:
    campaign_id = serving.campaign()
    worker = serving.worker_pid()
    trial_id = in_the_air(serving, campaign_id, speed=20.0)
    killed, pids = fork_server(worker), children(worker)
    os.kill(killed, signal.SIGKILL)
    serving.trial(trial_id, "valid")
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    in_vain = serving.fly(campaign_id)
    wait_for("the flight's failure", lambda: serving.get(f"/trials/{in_vain}")["flight"]["state"] == "failed")
    serving.post(f"/trials/{in_vain}/fly", {"speed": None})
    serving.trial(in_vain, "valid")
    assert serving.worker_pid() == worker
    assert fork_server(worker) != killed


@pytest.mark.complete
def test_a_web_process_killed_in_mid_flight_costs_nothing(tmp_path: Path) -> None:
    first = Serving(tmp_path / "data")
    campaign_id = first.campaign()
    worker = first.worker_pid()
    trial_id = in_the_air(first, campaign_id, speed=3.0)
    pids = children(worker)
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)  # the flight now takes as long as a server takes to start
    os.kill(first.process.pid, signal.SIGKILL)
    assert first.stop() == -signal.SIGKILL
    with Serving(tmp_path / "data") as second:
        assert is_alive(worker), "it finishes its flight"
        assert second.worker_pid() == worker, "and is heard by the new web process meanwhile"
        for pid in pids:
            os.kill(pid, signal.SIGCONT)
        flown = second.trial(trial_id, "valid")
        assert flown["record"]["duration_s"] > 32.6
        wait_for("the old worker's end", lambda: not is_alive(worker))
        wait_for("the new worker", lambda: second.worker_pid() != worker)
        second.trial(second.fly(campaign_id), "valid")
        require_sound_database(second.data_dir)


@pytest.mark.complete
def test_a_server_killed_during_a_backup_leaves_no_copy_once_it_runs_again(tmp_path: Path) -> None:
    first = Serving(tmp_path / "data", "--no-worker")
    with closing(sqlite3.connect(first.data_dir / "gainline.sqlite3")) as connection, connection:
        connection.execute("CREATE TABLE filler AS SELECT zeroblob(100000000) AS data")
    host, port = first.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port))) as asking:
        asking.sendall(b"GET /api/system/backup HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        (copy,) = wait_for("the copy", lambda: list(first.data_dir.glob("*copy*/*.sqlite3")))
        first.process.kill()
        assert first.stop() == -signal.SIGKILL
    assert copy.exists()
    with Serving(tmp_path / "data", "--no-worker") as second:
        assert list(second.data_dir.glob("*copy*")) == []


@pytest.mark.complete
def test_a_flight_that_outlived_its_web_process_can_still_be_aborted_and_one_whose_server_stops_lands(
    tmp_path: Path,
) -> None:
    first = Serving(tmp_path / "data")
    campaign_id = first.campaign()
    trial_id = in_the_air(first, campaign_id, speed=1.0)
    pids = children(first.worker_pid())
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)  # the flight now takes as long as a server takes to start
    old = first.worker_pid()
    os.kill(first.process.pid, signal.SIGKILL)
    first.stop()
    second = Serving(tmp_path / "data")
    second.worker_pid()
    assert second.post(f"/trials/{trial_id}/abort", {"reason": "enough"})["accepted"]
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    assert second.trial(trial_id, "aborted")["reason"] == "enough"
    wait_for("the old worker's end", lambda: not is_alive(old))

    worker = second.worker_pid()
    trial_id = in_the_air(second, campaign_id, speed=1.0)
    assert second.stop() == 0
    assert not is_alive(worker)
    with Serving(tmp_path / "data") as third:
        trial = third.trial(trial_id, "aborted")
        assert (trial["end"]["request"]["by"], trial["abort_cause"]) == ("program stopped", "something else")
        assert trial["record"]["samples"] > 0


@pytest.mark.complete
def test_a_proposal_whose_worker_is_killed_is_computed_again_and_is_the_same(serving: Serving) -> None:
    undisturbed = serving.proposal(serving.campaign())
    worker = serving.worker_pid()
    pids = children(worker)
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)  # the computation now takes as long as the test wants
    created = serving.post(
        "/campaigns",
        {"name": "Again", "vehicle": {"kind": "twin"}, "definition": {"stop": {"kind": "budget", "max_flights": 7}}},
    )
    job = wait_for(
        "the job to run",
        lambda: next(
            (job for job in serving.get(f"/jobs?campaign_id={created['id']}")["items"] if job["state"] == "running"),
            None,
        ),
    )
    os.kill(worker, signal.SIGKILL)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    proposal = serving.proposal(created["id"])
    for what in ("kind", "gains", "predicted_error", "explanation", "history_digest"):
        assert proposal[what] == undisturbed[what], what
    done = serving.get(f"/jobs/{job['id']}")
    assert (done["state"], done["attempts"]) == ("done", 2)
    wait_for("the end of its processes", lambda: not any(is_alive(pid) for pid in pids))


@pytest.mark.complete
def test_a_worker_killed_at_random_moments_never_leaves_a_false_state(serving: Serving) -> None:
    """From 0 to 0.18 s after the flight was asked for: whatever is under way then, which nothing tells."""
    campaign_id = serving.campaign(max_flights=200)
    for number in range(4):
        wait_for("the vehicle", lambda: serving.get(f"/campaigns/{campaign_id}")["vehicle"]["state"] == "ready")
        worker = serving.worker_pid()
        trial_id = serving.fly(campaign_id, speed=200.0)
        time.sleep(0.06 * number)
        os.kill(worker, signal.SIGKILL)
        wait_for("the flight's end", lambda: not under_way(serving, trial_id))  # noqa: B023 - called at once
        trial = serving.trial(trial_id, "valid", "lost", "planned")
        assert (trial["record"] is not None) == (trial["error"] is not None) == (trial["state"] == "valid")
        assert (trial["flown_at"] is None) == (trial["state"] == "planned")
    require_sound_database(serving.data_dir)


def under_way(serving: Serving, trial_id: int) -> bool:
    flight = serving.get(f"/trials/{trial_id}")["flight"]
    return flight["state"] in {"requested", "running"}
