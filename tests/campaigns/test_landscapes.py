"""The landscape over HTTP: asked for once, computed as a job, drawn with the campaign's own flights."""

from functools import partial
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.campaigns import landscapes, tasks
from app.db.session import Database
from app.jobs import service as jobs
from app.jobs.runner import JobRunner
from app.processes.calls import ComputePool
from tests.builders import WORKER, create_flown_campaign, create_flown_trial, get, store_campaign

Json = dict[str, Any]


def landscape_jobs(client: TestClient) -> list[Json]:
    """The newest first."""
    every: list[Json] = get(client, "/api/jobs")["items"]
    return [job for job in every if job["kind"] == "landscape"]


def waiting_jobs(client: TestClient) -> list[Json]:
    return [job for job in landscape_jobs(client) if job["state"] == "queued"]


def run_landscapes(database: Database) -> int:
    """Carry out every waiting landscape job as a worker does; how many there were."""
    count = 0
    while True:
        with database.write() as session:
            job = jobs.claim_job(session, worker=WORKER, kinds=(landscapes.LANDSCAPE_JOB,), lease_s=30.0)
            if job is None:
                return count
            job_id, campaign_id, order = job.id, job.campaign_id, dict(job.order or {})
        assert campaign_id is not None
        with database.read() as session:
            past, proposal = landscapes.read_proposed(session, campaign_id, order)
        survey = landscapes.plan(past, proposal.gains, proposal.explanation.get("base_flight"))
        assert survey is not None
        landscape = survey.landscape(survey.predict_errors(survey.points()))
        with database.write() as session:
            jobs.finish_job(session, job_id, worker=WORKER, result=landscapes.as_json(landscape, order))
        count += 1


def carry_out_as_the_worker(database: Database) -> None:
    """The job that waits, with the worker's own runner."""
    with ComputePool(1, prepare=int) as pool:
        job = partial(tasks.compute_landscape, database, pool, worker=WORKER, lease_s=9.0)
        runner = JobRunner(database, landscapes.LANDSCAPE_JOB, job, room=1, worker=WORKER, lease_s=30.0)
        claimed = runner.claim()
        assert claimed is not None
        runner.carry_out(claimed)


def card_of(client: TestClient, campaign_id: int) -> Json:
    card: Json = get(client, f"/api/campaigns/{campaign_id}/figures/landscape")
    return card


def traces(card: Json, role: str) -> list[Json]:
    assert card["state"] == "ready", card["reason"]
    return [trace for trace in card["figure"]["data"] if trace["meta"]["role"] == role]


@pytest.fixture
def campaign_id(client: TestClient, database: Database) -> int:
    """A campaign with one flight and the gains for the next."""
    return int(create_flown_campaign(client, database, 2.0)["id"])


@pytest.mark.complete
def test_asked_for_twice_it_is_computed_once_and_drawn_when_done(
    client: TestClient, database: Database, campaign_id: int
) -> None:
    assert [card_of(client, campaign_id)["state"] for _ in range(2)] == ["waiting", "waiting"]
    assert len(waiting_jobs(client)) == 1
    assert run_landscapes(database) == 1
    assert card_of(client, campaign_id)["state"] == "ready"
    assert waiting_jobs(client) == []


@pytest.mark.complete
def test_the_path_goes_through_the_gains_of_the_trials(
    client: TestClient, database: Database, campaign_id: int
) -> None:
    card_of(client, campaign_id)
    run_landscapes(database)
    card = card_of(client, campaign_id)
    trials = get(client, f"/api/campaigns/{campaign_id}/trials")["items"]
    proposed = get(client, f"/api/campaigns/{campaign_id}/proposal")["proposal"]
    for path, best, diamond, (x, y) in zip(
        traces(card, "path"),
        traces(card, "best"),
        traces(card, "proposed"),
        (("kp", "ki"), ("kp", "kd"), ("ki", "kd")),
        strict=True,
    ):
        assert path["x"] == [trial["gains"][x] for trial in trials]
        assert path["y"] == [trial["gains"][y] for trial in trials]
        assert (best["x"], best["y"]) == ([trials[0]["gains"][x]], [trials[0]["gains"][y]])
        assert (diamond["x"], diamond["y"]) == ([proposed["gains"][x]], [proposed["gains"][y]])
    ladder = proposed["explanation"]["ladder"]
    assert traces(card, "tried")[0]["x"] == [step["gains"]["kp"] for step in ladder]


def test_the_page_says_how_far_the_landscape_is(client: TestClient, database: Database, campaign_id: int) -> None:
    card_of(client, campaign_id)
    with database.write() as session:
        job = jobs.claim_job(session, worker=WORKER, kinds=(landscapes.LANDSCAPE_JOB,), lease_s=30.0)
        assert job is not None
        jobs.report_progress(session, job.id, 0.4, "192 of 480 gain sets evaluated", worker=WORKER, lease_s=30.0)
    reason = card_of(client, campaign_id)["reason"]
    assert reason.startswith("40\u00a0% done: 192 of 480 gain sets evaluated.")


def test_the_share_that_is_done_is_that_of_the_gain_sets_evaluated(
    monkeypatch: pytest.MonkeyPatch, client: TestClient, database: Database, campaign_id: int
) -> None:
    """Seen: 68 % done, 624 of 867. The batches are not equally large."""
    card_of(client, campaign_id)
    told: list[tuple[float, str]] = []
    monkeypatch.setattr(tasks, "PROGRESS_EVERY_S", 0.0)
    monkeypatch.setattr(jobs, "report_progress", lambda _session, _id, *progress, **_: told.append(progress))
    carry_out_as_the_worker(database)
    assert len(told) > 2
    for share, doing in told:
        done, _, points, *_ = doing.split()
        assert share == int(done) / int(points)


@pytest.mark.complete
def test_another_proposal_has_a_landscape_of_its_own(client: TestClient, database: Database, campaign_id: int) -> None:
    card_of(client, campaign_id)
    run_landscapes(database)
    create_flown_trial(client, database, campaign_id, 1.9)
    assert card_of(client, campaign_id)["state"] == "waiting"
    assert run_landscapes(database) == 1
    assert len(traces(card_of(client, campaign_id), "path")[0]["x"]) == 2


@pytest.mark.complete
def test_one_that_the_flights_overtake_is_withdrawn_and_asked_for_anew_once_its_gains_hold_again(
    client: TestClient, database: Database, campaign_id: int
) -> None:
    card_of(client, campaign_id)
    classify(client, campaign_id, "invalid")
    carry_out_as_the_worker(database)
    (withdrawn,) = landscape_jobs(client)
    assert withdrawn["state"] == "cancelled"
    assert "flights have changed" in withdrawn["problem"]["title"]
    assert "being computed" in card_of(client, campaign_id)["reason"]
    assert waiting_jobs(client) == []
    classify(client, campaign_id, "valid")
    assert "automatically" in card_of(client, campaign_id)["reason"]
    assert len(waiting_jobs(client)) == 1
    assert run_landscapes(database) == 1
    assert card_of(client, campaign_id)["state"] == "ready"


def classify(client: TestClient, campaign_id: int, outcome: str) -> None:
    trial = get(client, f"/api/campaigns/{campaign_id}/trials")["items"][0]
    said = {"version": trial["version"], "outcome": outcome, "reason": "Looked at again"}
    assert client.post(f"/api/trials/{trial['id']}/classify", json=said).status_code == 200


def test_one_that_a_person_cancelled_is_not_started_again_by_looking(client: TestClient, campaign_id: int) -> None:
    card_of(client, campaign_id)
    (job,) = waiting_jobs(client)
    assert client.post(f"/api/jobs/{job['id']}/cancel").status_code == 200
    assert "It was cancelled." in card_of(client, campaign_id)["reason"]
    assert [one["state"] for one in landscape_jobs(client)] == ["cancelled"]


def test_without_a_model_the_card_says_so_and_nothing_is_computed(client: TestClient, database: Database) -> None:
    definition = {"experiment": "takeoff-px4", "strategy": "manual"}
    card = card_of(client, store_campaign(database, "import", definition))
    assert card["state"] == "waiting"
    assert "no model" in card["reason"]
    assert waiting_jobs(client) == []
