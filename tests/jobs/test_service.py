"""Jobs: claimed once, kept by a heartbeat, run again after a crash, and never for ever."""

from concurrent.futures import ThreadPoolExecutor

import pytest
from fastapi.testclient import TestClient

from app.common.states import JobState
from app.core.errors import InputError, Problem
from app.db.session import Database
from app.jobs import service as jobs
from tests.builders import create_campaign, create_ready_campaign, get, run_jobs

KIND = ("proposal",)


def enqueue(database: Database) -> int:
    with database.write() as session:
        return jobs.enqueue_job(session, "proposal").id


def claim(database: Database, worker: str = "a", lease_s: float = 30.0) -> int | None:
    with database.write() as session:
        row = jobs.claim_job(session, worker=worker, kinds=KIND, lease_s=lease_s)
        return None if row is None else row.id


def state(database: Database, job_id: int) -> JobState:
    with database.read() as session:
        return jobs.get_job(session, job_id).state


def test_jobs_are_claimed_in_their_order_and_once_each(database: Database) -> None:
    expected = [enqueue(database) for _ in range(12)]
    with ThreadPoolExecutor(4) as pool:
        claimed = list(pool.map(lambda worker: claim(database, f"w{worker}"), range(13)))
    assert sorted(job for job in claimed if job is not None) == expected
    assert claimed.count(None) == 1


def test_a_worker_takes_only_its_kinds(database: Database) -> None:
    enqueue(database)
    with database.write() as session:
        assert jobs.claim_job(session, worker="a", kinds=("study",), lease_s=1.0) is None


def test_a_campaign_waits_for_one_proposal_at_a_time(client: TestClient) -> None:
    campaign = create_campaign(client)
    for _ in range(3):
        assert client.post(f"/api/campaigns/{campaign['id']}/proposal").status_code == 202
    jobs_of = get(client, f"/api/jobs?campaign_id={campaign['id']}")
    assert jobs_of["total"] == 1
    assert jobs_of["items"][0]["campaign_name"] == campaign["name"]


def test_a_silent_workers_job_waits_again_and_its_result_is_not_taken(database: Database) -> None:
    job = enqueue(database)
    assert claim(database, "a", lease_s=-1.0) == job
    with database.write() as session:
        assert jobs.requeue_running_jobs(session, expired=True) == [job]
    assert claim(database, "b") == job
    with database.write() as session:
        assert not jobs.heartbeat_job(session, job, worker="a", lease_s=30.0)
        assert not jobs.finish_job(session, job, worker="a")
        assert jobs.finish_job(session, job, worker="b")
    assert state(database, job) == JobState.DONE


def test_a_heartbeat_keeps_the_job(database: Database) -> None:
    job = enqueue(database)
    claim(database, "a", lease_s=-1.0)
    with database.write() as session:
        assert jobs.heartbeat_job(session, job, worker="a", lease_s=30.0)
        assert jobs.requeue_running_jobs(session, expired=True) == []


def test_a_job_that_kills_its_workers_is_failed_after_three_times(database: Database) -> None:
    job = enqueue(database)
    for _ in range(jobs.MAX_ATTEMPTS):
        assert state(database, job) == JobState.QUEUED
        claim(database)
        with database.write() as session:
            assert jobs.requeue_running_jobs(session) == [job]
    with database.read() as session:
        found = jobs.get_job(session, job)
    assert found.state == JobState.FAILED
    assert found.problem is not None
    assert found.problem.title == "The worker stopped 3 times during this job."


def test_a_failed_job_shows_the_reason_and_can_be_retried(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)
    job = claim(database)
    assert job is not None
    with database.write() as session:
        jobs.fail_job(session, job, InputError("No.", hint="Do it so.", problems=(Problem("x", "is bad"),)), worker="a")
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")
    assert proposal == {
        "state": "failed",
        "proposal": None,
        "problem": {"title": "No.", "detail": "x: is bad", "hint": "Do it so."},
    }
    assert get(client, f"/api/jobs/{job}")["actions"] == ["retry"]
    assert client.post(f"/api/jobs/{job}/retry").json()["state"] == "queued"
    assert run_jobs(database) == 1
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["state"] == "ready"


def test_a_cancelled_job_takes_no_result(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)
    job = claim(database)
    assert job is not None
    assert client.post(f"/api/jobs/{job}/cancel").json()["state"] == "cancelled"
    with database.write() as session:
        assert not jobs.finish_job(session, job, worker="a")
    assert client.post(f"/api/jobs/{job}/cancel").status_code == 409
    found = get(client, f"/api/campaigns/{campaign['id']}/proposal")
    assert (found["state"], found["problem"]["detail"]) == ("none", "Its computation was cancelled.")
    client.post(f"/api/campaigns/{campaign['id']}/proposal")
    run_jobs(database)
    assert get(client, f"/api/campaigns/{campaign['id']}/proposal")["state"] == "ready"


def test_a_deleted_campaigns_job_takes_no_result(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)
    job = claim(database)
    assert job is not None
    client.delete(f"/api/campaigns/{campaign['id']}?version=1")
    with database.write() as session:
        assert not jobs.finish_job(session, job, worker="a")


@pytest.mark.complete
@pytest.mark.parametrize("query", ["", "?state=done"])
def test_jobs_are_listed_in_pages_the_newest_first(client: TestClient, database: Database, query: str) -> None:
    ids = []
    for _ in range(5):
        create_ready_campaign(client, database)
        ids.append(get(client, "/api/jobs")["items"][0]["id"])
    glue = "&" if query else "?"
    found, cursor = [], ""
    while True:
        page = get(client, f"/api/jobs{query}{glue}limit=2{cursor}")
        found += [item["id"] for item in page["items"]]
        if page["next_cursor"] is None:
            break
        cursor = f"&cursor={page['next_cursor']}"
    assert found == ids[::-1]
