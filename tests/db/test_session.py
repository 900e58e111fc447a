"""Transactions on a real SQLite file: writers in turn, nothing half done, errors with a reason."""

import sqlite3
import threading
from contextlib import closing
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text
from sqlalchemy.exc import IntegrityError

from app.common.errors import StorageError
from app.common.states import FlightState, JobState, VehicleState
from app.db.base import added
from app.db.models import CampaignRow, EventRow, FlightRow, JobRow, TrajectoryRow, VehicleRow
from app.db.session import Database
from app.db.trajectories import pack
from tests.builders import create_campaign, create_climb, create_ready_campaign, create_trial
from tests.conftest import Listen

THREADS = 8
WRITES = 25


def test_the_file_is_in_wal_mode_with_foreign_keys_and_a_commit_outlives_a_power_cut(tmp_path: Path) -> None:
    with closing(Database(tmp_path / "gainline.sqlite3")) as database, database.read() as session:
        found = [
            session.execute(text(f"PRAGMA {name}")).scalar()
            for name in ("journal_mode", "foreign_keys", "busy_timeout", "synchronous")
        ]
    assert found == ["wal", 1, 5000, 2]  # synchronous = FULL: the log is on the disk before a commit returns


@pytest.mark.complete
def test_concurrent_writers_that_read_first_lose_nothing(database: Database) -> None:
    with database.write() as session:
        session.add(JobRow(id=1, kind="count", state=JobState.QUEUED))
    troubles: list[Exception] = []

    def count() -> None:
        try:
            for _ in range(WRITES):
                with database.write() as session:
                    row = session.get_one(JobRow, 1)
                    row.attempts += 1
        except StorageError as error:
            troubles.append(error)

    threads = [threading.Thread(target=count) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert troubles == []
    with database.read() as session:
        assert session.get_one(JobRow, 1).attempts == THREADS * WRITES
        assert session.query(EventRow).count() == THREADS * WRITES + 1


def test_a_failed_transaction_leaves_neither_rows_nor_events(database: Database) -> None:
    def fail() -> None:
        with database.write() as session:
            session.add(JobRow(kind="count", state=JobState.QUEUED))
            session.flush()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    with database.read() as session:
        assert session.query(JobRow).count() == 0
        assert session.query(EventRow).count() == 0


def test_a_reader_keeps_its_view_while_others_write(database: Database) -> None:
    with database.read() as session:
        assert session.query(JobRow).count() == 0
        with database.write() as writer:
            writer.add(JobRow(kind="count", state=JobState.QUEUED))
        assert session.query(JobRow).count() == 0


def fill_up(database: Database, listen: Listen) -> None:
    """From now on the file may not grow: SQLite then fails as it does on a full disk."""
    with database.engine.connect() as connection:
        pages = connection.execute(text("PRAGMA page_count")).scalar()
    database.engine.dispose()

    def limit(connection: sqlite3.Connection, _entry: object) -> None:
        connection.execute(f"PRAGMA max_page_count = {pages}")

    listen(database.engine, "connect", limit)


def test_a_full_disk_is_reported_in_words_and_loses_nothing(database: Database, listen: Listen) -> None:
    with database.write() as session:
        session.add(JobRow(kind="before", state=JobState.QUEUED))
    fill_up(database, listen)
    with pytest.raises(StorageError, match=r"is full; nothing.*Free some disk space"), database.write() as session:
        session.add(JobRow(kind="too much", state=JobState.QUEUED, worker="x" * 100_000))
    with database.read() as session:
        assert [row.kind for row in session.query(JobRow)] == ["before"]


def test_a_locked_database_is_reported_in_words(database: Database, listen: Listen) -> None:
    def hurry(connection: sqlite3.Connection, _entry: object) -> None:
        connection.execute("PRAGMA busy_timeout = 20")

    listen(database.engine, "connect", hurry)
    database.engine.dispose()
    with database.write() as session:
        session.execute(text("SELECT 1"))
        with pytest.raises(StorageError, match="was busy for longer"), database.write() as second:
            second.execute(text("SELECT 1"))


def test_a_file_that_is_not_a_database_is_reported_in_words(tmp_path: Path) -> None:
    file = tmp_path / "letter.sqlite3"
    file.write_text("Dear Sir or Madam, " * 100)
    with pytest.raises(StorageError, match="is not a Gainline database"), Database(file).read() as session:
        session.execute(text("SELECT 1"))


def test_a_stored_trajectory_cannot_be_changed(database: Database) -> None:
    with database.write() as session:
        row_id = added(session, pack(create_climb())).id
    with pytest.raises(IntegrityError, match="never changed"), database.write() as session:
        session.get_one(TrajectoryRow, row_id).source = "elsewhere"


def test_the_database_itself_refuses_a_second_flight_of_a_vehicle(client: TestClient, database: Database) -> None:
    campaign = create_ready_campaign(client, database)
    trial = create_trial(client, campaign["id"], fly={"speed": None})
    with pytest.raises(IntegrityError, match="UNIQUE"), database.write() as session:
        session.add(
            FlightRow(
                campaign_id=campaign["id"],
                trial_id=trial["id"],
                vehicle_id=campaign["vehicle"]["id"],
                state=FlightState.REQUESTED,
                gains=trial["gains"],
            )
        )


@pytest.mark.parametrize("table", ["vehicle", "campaign", "trial", "flight", "job"])
def test_the_database_itself_refuses_an_unknown_state(client: TestClient, database: Database, table: str) -> None:
    campaign = create_ready_campaign(client, database)
    create_trial(client, campaign["id"], fly={"speed": None})
    with pytest.raises(IntegrityError, match=f"ck_{table}_state"), database.write() as session:
        session.execute(text(f"UPDATE {table} SET state = 'dreaming'"))


def test_ids_are_never_used_twice(client: TestClient, database: Database) -> None:
    first = create_campaign(client)
    assert client.delete(f"/api/campaigns/{first['id']}?version=1").status_code == 204
    assert create_campaign(client)["id"] > first["id"]
    with database.read() as session:
        assert session.query(CampaignRow).count() == 1
        assert session.query(VehicleRow).one().state == VehicleState.READY
