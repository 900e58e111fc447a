"""An abort goes straight to the worker, whatever the database is doing."""

from concurrent.futures import Future, ThreadPoolExecutor

import pytest
from fastapi.testclient import TestClient
from sqlalchemy import text
from sqlalchemy.pool import QueuePool

from app.common.settings import Settings
from app.db import session as session_module
from app.db.session import Database
from app.live.link import LiveServer
from app.live.messages import live_address
from tests.builders import get
from tests.waiting import eventually

THREADS_OF_A_SERVER = 40


@pytest.fixture
def long_wait_for_the_database(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fifty requests begin to wait and are heard of again in it, on any machine. Before any connection is opened."""
    monkeypatch.setattr(session_module, "_BUSY_TIMEOUT_MS", 60_000)


def connections_in_use(database: Database) -> int:
    pool = database.engine.pool
    assert isinstance(pool, QueuePool)
    return pool.checkedout()


@pytest.mark.usefixtures("long_wait_for_the_database")
def test_an_abort_passes_while_every_thread_waits_for_the_database(
    client: TestClient, database: Database, settings: Settings
) -> None:
    heard: list[tuple[int, str]] = []

    def abort(trial_id: int, reason: str) -> bool:
        heard.append((trial_id, reason))
        return True

    with (
        LiveServer(live_address(settings.data_dir), abort=abort, order=lambda *_: Future()),
        ThreadPoolExecutor(THREADS_OF_A_SERVER + 10) as people,
    ):
        eventually(lambda: get(client, "/api/health")["worker"] == "running")
        with database.write() as session:
            session.execute(text("SELECT 1"))  # from here on the write lock is ours
            waiting = [
                people.submit(client.post, "/api/campaigns", json={"name": "Patience"})
                for _ in range(THREADS_OF_A_SERVER + 10)
            ]
            eventually(lambda: connections_in_use(database) > THREADS_OF_A_SERVER)
            answer = client.post("/api/trials/7/abort", json={"reason": "too close"})
            assert (answer.status_code, answer.json()["accepted"]) == (202, True)
            assert not any(future.done() for future in waiting)
    assert heard == [(7, "too close")]
    assert {future.result().status_code for future in waiting} == {201}
