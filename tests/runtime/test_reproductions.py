"""Reproductions beside everything else that a worker does, and after it was killed."""

import os
import signal
from typing import Any

import pytest

from tests.runtime.processes import Serving, children, is_alive
from tests.waiting import wait_for

pytestmark = pytest.mark.real_time("a worker and its processes compute, are killed and replaced")

LONG = "variability"


def running(serving: Serving, job_id: int) -> Any:
    """The job, once it has told how far it is."""

    def there() -> Any:
        job = serving.get(f"/jobs/{job_id}")
        return job if job["state"] == "running" and job["done_share"] else None

    return wait_for(f"job {job_id} to run", there)


@pytest.mark.complete
def test_a_reproduction_whose_worker_is_killed_runs_again_and_can_be_cancelled(serving: Serving) -> None:
    worker = serving.worker_pid()
    job_id = serving.post(f"/reproductions/{LONG}/run")["id"]
    assert running(serving, job_id)["attempts"] == 1
    pids = children(worker)
    os.kill(worker, signal.SIGKILL)
    wait_for("the end of its processes", lambda: not any(is_alive(pid) for pid in pids))
    wait_for("another worker", lambda: serving.worker_pid() != worker)
    wait_for("the second attempt", lambda: serving.get(f"/jobs/{job_id}")["attempts"] == 2)
    running(serving, job_id)
    computing = children(serving.worker_pid())
    assert serving.post(f"/jobs/{job_id}/cancel")["state"] == "cancelled"
    wait_for("the end of what computed it", lambda: sum(map(is_alive, computing)) < len(computing))
    assert serving.get(f"/jobs/{job_id}")["state"] == "cancelled"
    assert serving.get(f"/reproductions/{LONG}")["latest"] is None


@pytest.mark.complete
def test_proposals_and_flights_do_not_wait_behind_a_reproduction(serving: Serving) -> None:
    job_id = serving.post(f"/reproductions/{LONG}/run")["id"]
    running(serving, job_id)
    campaign_id = serving.campaign()
    serving.trial(serving.fly(campaign_id), "valid")
    serving.proposal(campaign_id)
    job = serving.get(f"/jobs/{job_id}")
    assert job["state"] == "running"
    assert job["done_share"] < 0.9, "it is far from done, and the next gains are there"
    serving.post(f"/jobs/{job_id}/cancel")
