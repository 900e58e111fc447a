"""Reproductions over HTTP: listed, asked for once, and their newest result with its figures."""

import json
from dataclasses import asdict
from typing import Any

import httpx2
import pytest
from fastapi.testclient import TestClient

from app.common.states import JobState
from app.core.errors import InputError
from app.db.session import Database
from app.jobs import service as jobs
from app.reproductions.controller import run_controller
from app.reproductions.registry import REPRODUCTIONS
from app.reproductions.service import REPRODUCTION_JOB
from tests.builders import WORKER, get

Json = dict[str, Any]


def ask(client: httpx2.Client, name: str = "controller", **body: object) -> Json:
    answer = client.post(f"/api/reproductions/{name}/run", json=body)
    assert answer.status_code == 202, answer.text
    job: Json = answer.json()
    return job


def claim(database: Database) -> int:
    with database.write() as session:
        row = jobs.claim_job(session, worker=WORKER, kinds=(REPRODUCTION_JOB,), lease_s=30.0)
        assert row is not None
        return row.id


def finish(database: Database, job_id: int) -> None:
    """With the controller's own result."""
    result = json.loads(json.dumps(asdict(run_controller(lambda _share, _doing: None))))
    with database.write() as session:
        assert jobs.finish_job(session, job_id, worker=WORKER, result=result)


def test_every_reproduction_is_listed_before_any_has_run(client: TestClient) -> None:
    page = get(client, "/api/reproductions")
    assert [item["name"] for item in page["items"]] == list(REPRODUCTIONS)
    assert page["total"] == len(REPRODUCTIONS)
    for item in page["items"]:
        assert item["title"]
        assert item["line"]
        assert item["paper"]
        assert item["figures"]
        assert (item["job"], item["latest"]) == (None, None)
    assert get(client, "/api/reproductions/table1")["rows"] == []


@pytest.mark.complete
def test_asking_twice_gives_the_job_that_waits(client: TestClient, database: Database) -> None:
    first, second = ask(client), ask(client)
    assert first["id"] == second["id"]
    assert (first["kind"], first["name"], first["state"]) == ("reproduction", "controller", "queued")
    assert ask(client, "table1")["id"] != first["id"]
    claim(database)
    assert ask(client)["id"] == first["id"], "while it runs too"
    finish(database, first["id"])
    assert ask(client)["id"] > first["id"]


@pytest.mark.complete
def test_a_request_sent_again_with_its_key_is_done_once(client: TestClient, database: Database) -> None:
    headers = {"Idempotency-Key": "again"}
    first = client.post("/api/reproductions/controller/run", headers=headers).json()
    finish(database, claim(database))
    assert client.post("/api/reproductions/controller/run", headers=headers).json()["id"] == first["id"]
    assert get(client, "/api/jobs")["total"] == 1


@pytest.mark.complete
def test_a_result_has_rows_beside_the_papers_and_figures(client: TestClient, database: Database) -> None:
    waiting = get(client, "/api/reproductions/controller/figures/figure6-commands")
    assert (waiting["state"], waiting["figure"]) == ("waiting", None)
    ask(client)
    job_id = claim(database)
    finish(database, job_id)
    found = get(client, "/api/reproductions/controller")
    assert found["latest"]["job_id"] == job_id
    assert found["job"] is None
    assert [(row["label"], row["measured"], row["reference"]) for row in found["rows"]][:2] == [
        ("z_ref", 0.0, 0.0),
        ("zd_ref", 0.0, 0.0),
    ]
    assert "exact" in found["notes"][0]
    cards = [
        get(client, f"/api/reproductions/controller/figures/figure6-commands?theme={theme}")
        for theme in ("light", "dark")
    ]
    assert [card["state"] for card in cards] == ["ready", "ready"]
    assert cards[0]["title"].startswith("Fig. 6, below: ")
    assert [trace["meta"]["line"] for trace in cards[0]["figure"]["data"]] == ["Recorded", "Replica"] * 3
    assert cards[0]["figure"]["data"][0]["y"] == cards[1]["figure"]["data"][0]["y"]
    assert cards[0]["figure"]["data"][0]["line"] != cards[1]["figure"]["data"][0]["line"]


@pytest.mark.complete
def test_only_the_newest_result_is_kept(client: TestClient, database: Database) -> None:
    for _ in range(2):
        ask(client)
        finish(database, claim(database))
    with database.read() as session:
        assert [jobs.get_job(session, job_id).state for job_id in (1, 2)] == ["done", "done"]
        latest = jobs.latest_ordered(session, REPRODUCTION_JOB, "controller", {JobState.DONE})
        assert latest is not None
        assert latest.id == 2
        found = jobs.latest_ordered(session, REPRODUCTION_JOB, "controller", ())
        assert found is None
    stored = database.engine.connect()
    try:
        kept = stored.exec_driver_sql("SELECT id FROM job WHERE result IS NOT NULL").fetchall()
    finally:
        stored.close()
    assert kept == [(2,)]


def test_progress_is_told_with_an_estimate(client: TestClient, database: Database) -> None:
    ask(client)
    job_id = claim(database)
    with database.write() as session:
        assert jobs.report_progress(session, job_id, 0.4, "step 4 of 10", worker=WORKER, lease_s=30.0)
    job = get(client, "/api/reproductions/controller")["job"]
    assert (job["state"], job["done_share"], job["doing"]) == ("running", 0.4, "step 4 of 10")
    assert job["remaining_s"] >= 0.0
    with database.write() as session:
        assert not jobs.report_progress(session, job_id, 0.5, "", worker="another", lease_s=30.0)


@pytest.mark.complete
def test_a_failed_run_shows_its_reason_beside_the_older_result_until_a_newer_one(
    client: TestClient, database: Database
) -> None:
    ask(client)
    finish(database, claim(database))
    ask(client)
    failed = claim(database)
    with database.write() as session:
        jobs.fail_job(session, failed, InputError("It broke.", hint="Mend it."), worker=WORKER)
    found = get(client, "/api/reproductions/controller")
    assert found["latest"]["job_id"] == 1
    assert (found["job"]["state"], found["job"]["problem"]["title"]) == ("failed", "It broke.")
    assert found["job"]["problem"]["hint"] == "Mend it."
    assert client.post(f"/api/jobs/{failed}/retry").json()["state"] == "queued"
    finish(database, claim(database))
    found = get(client, "/api/reproductions/controller")
    assert (found["latest"]["job_id"], found["job"]) == (failed, None)


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/api/reproductions/table3"),
        ("POST", "/api/reproductions/table3/run"),
        ("GET", "/api/reproductions/table3/figures/figure7-left"),
        ("GET", "/api/reproductions/table1/figures/figure8"),
    ],
)
def test_what_there_is_not_is_not_found(client: TestClient, method: str, path: str) -> None:
    answer = client.request(method, path)
    assert answer.status_code == 404
    assert answer.json()["hint"].startswith("Available: ")


def test_an_unknown_field_is_refused(client: TestClient) -> None:
    answer = client.post("/api/reproductions/table1/run", json={"quick": True})
    assert answer.status_code == 422
    assert answer.json()["problems"][0]["field"].endswith("quick")
