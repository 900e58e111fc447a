"""Change events: one for each change, with its transaction, in order, the old ones pruned."""

from datetime import timedelta

import pytest
from fastapi.testclient import TestClient

from app.common.states import JobState
from app.db import outbox
from app.db.base import utc_now
from app.db.models import EventRow, JobRow
from app.db.session import Database
from app.jobs import service as jobs
from tests.builders import create_campaign, create_flown_trial, create_ready_campaign


def topics(database: Database, after: int = 0) -> list[tuple[str, int, int | None]]:
    with database.read() as session:
        return [(row.topic, row.entity_id, row.campaign_id) for row in outbox.events_after(session, after, limit=1000)]


def test_a_new_campaign_is_published_with_its_vehicle_and_its_job(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)["id"]
    assert topics(database) == [("vehicle", 1, None), ("campaign", campaign, campaign), ("job", 1, campaign)]


@pytest.mark.complete
def test_the_phases_of_a_flight_are_published_one_by_one(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)["id"]
    with database.read() as session:
        before = outbox.latest_event_id(session)
    trial = create_flown_trial(client, database, campaign)["id"]
    told = topics(database, before)
    assert {topic for topic, _, _ in told} == {"trial", "flight", "vehicle", "campaign", "job", "proposal"}
    assert {entity for topic, entity, _ in told if topic == "trial"} == {trial}
    assert {of for topic, _, of in told if topic != "vehicle"} == {campaign}


def test_a_heartbeat_alone_is_no_change(database: Database) -> None:
    with database.write() as session:
        job = jobs.enqueue_job(session, "proposal").id
        jobs.claim_job(session, worker="w", kinds=("proposal",), lease_s=5.0)
    before = len(topics(database))
    with database.write() as session:
        assert jobs.heartbeat_job(session, job, worker="w", lease_s=50.0)
    assert len(topics(database)) == before


def test_a_deleted_campaign_is_published(client: TestClient, database: Database) -> None:
    campaign = create_campaign(client)["id"]
    before = len(topics(database))
    client.delete(f"/api/campaigns/{campaign}?version=1")
    assert topics(database)[before:] == [("campaign", campaign, campaign)]


def test_the_newest_event_before_a_moment_is_found_and_none_before_the_first(
    client: TestClient, database: Database
) -> None:
    create_campaign(client)
    an_hour_ago = utc_now() - timedelta(hours=1)
    with database.write() as session:
        session.query(EventRow).update({EventRow.at: an_hour_ago})
    with database.read() as session:
        earlier = outbox.latest_event_id(session)
    create_campaign(client, name="Another")
    with database.read() as session:
        assert outbox.latest_event_before(session, utc_now() - timedelta(minutes=30)) == earlier
        assert outbox.latest_event_before(session, an_hour_ago) == 0


def test_old_events_are_pruned_and_a_client_from_before_is_recognised(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outbox, "KEPT_EVENTS", 20)
    monkeypatch.setattr(outbox, "_PRUNE_EVERY", 10)
    for _ in range(60):
        with database.write() as session:
            session.add(JobRow(kind="count", state=JobState.QUEUED))
    with database.read() as session:
        kept = [row.id for row in session.query(EventRow).order_by(EventRow.id)]
        assert kept == list(range(41, 61))
        assert outbox.holds_everything_after(session, 40)
        assert not outbox.holds_everything_after(session, 39)
        assert not outbox.holds_everything_after(session, 61)
