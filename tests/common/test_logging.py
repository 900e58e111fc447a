"""What the worker wrote down about a job, over HTTP."""

import json
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.db.session import Database
from app.jobs import service as jobs
from tests.builders import get


def line(after_s: float, message: str, job_id: int = 1, **more: object) -> str:
    said = {"event": message, "job_id": job_id, "level": "info", "logger": "app", **more}
    return json.dumps({**said, "timestamp": (datetime.now(UTC) + timedelta(seconds=after_s)).isoformat()})


def test_a_job_s_lines_are_found_in_turned_over_files_too_and_nobody_elses(
    client: TestClient, database: Database, settings: Settings
) -> None:
    with database.write() as session:
        assert jobs.enqueue_job(session, "reproduction", order={"name": "table1"}).id == 1
    folder = settings.data_dir / "log"
    folder.mkdir()
    older = [line(-3600, "of an older database"), line(60, "job started", order="name: table1")]
    newer = [
        line(61, "of another job", 11),
        json.dumps({"event": 'says "job_id": 1', "timestamp": datetime.now(UTC).isoformat()}),
        '{"event": "cut off", "job_id": 1',
        line(62, "job failed", exception="Traceback\nValueError: 3", why="no such thing"),
    ]
    (folder / "worker.log.1").write_text("\n".join(older) + "\n")
    (folder / "worker.log").write_text("\n".join(newer))
    found = get(client, "/api/jobs/1/log")
    assert [(each["message"], each["details"]) for each in found["lines"]] == [
        ("job started", {"order": "name: table1"}),
        ("job failed", {"why": "no such thing"}),
    ]
    assert found["lines"][1]["exception"] == "Traceback\nValueError: 3"
    last = get(client, "/api/jobs/1/log?limit=1")
    assert ([each["message"] for each in last["lines"]], last["total"]) == (["job failed"], 2)


def test_a_job_without_lines_has_none_and_no_job_is_not_found(client: TestClient, database: Database) -> None:
    with database.write() as session:
        jobs.enqueue_job(session, "proposal")
    assert get(client, "/api/jobs/1/log") == {"lines": [], "total": 0}
    assert client.get("/api/jobs/2/log").status_code == 404


MIGRATE = """
import sys
from pathlib import Path
from app.common.logging import configure_logs
from app.db.migrate import migrate

folder = Path(sys.argv[1])
configure_logs(folder, "web", "info")
migrate(folder / "gainline.sqlite3")
"""


@pytest.mark.complete
def test_the_first_start_logs_the_migration_and_not_the_plugins_of_alembic(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", MIGRATE, tmp_path], capture_output=True, text=True, check=True)
    lines = [json.loads(line) for line in (tmp_path / "log" / "web.log").read_text().splitlines()]
    assert any(line["event"].startswith("Running upgrade") for line in lines)
    assert not any("plugin" in line["event"] for line in lines)
    assert done.stderr == ""  # where a person looks: warnings and errors
