"""A damaged database: a sentence with what to do, from every command and from the running server."""

import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest

from tests.runtime.processes import Serving, environment

PAGE_BYTES: Final = 4096


def damaged(migrated_file: Path, data_dir: Path, table: str) -> None:
    """A data folder whose database has rubbish where that table begins."""
    data_dir.mkdir()
    file = data_dir / "gainline.sqlite3"
    shutil.copyfile(migrated_file, file)
    with closing(sqlite3.connect(file)) as connection:
        (page,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = ?", (table,)).fetchone()
        assert connection.execute("PRAGMA page_size").fetchone() == (PAGE_BYTES,)
    overwrite(file, page)


def overwrite(file: Path, page: int) -> None:
    with file.open("r+b") as raw:
        raw.seek((page - 1) * PAGE_BYTES)
        raw.write(b"\xee" * PAGE_BYTES)


COMMANDS = {
    "serve": ("serve", "--port", "0"),
    "worker": ("worker",),
    "bundle": ("bundle", "1"),
    "report": ("report", "1"),
}


@pytest.mark.parametrize(
    ("command", "table"),
    [
        ("serve", "campaign"),
        *(pytest.param(each, "campaign", marks=pytest.mark.complete) for each in ("worker", "bundle", "report")),
        pytest.param("report", "event", marks=pytest.mark.complete),
        *(pytest.param(command, "alembic_version", marks=pytest.mark.complete) for command in ("serve", "worker")),
    ],
)
def test_every_command_reports_a_damaged_database(
    migrated_file: Path, tmp_path: Path, command: str, table: str
) -> None:
    damaged(migrated_file, tmp_path / "data", table)
    refused = subprocess.run(
        [sys.executable, "-m", "app.cli", *COMMANDS[command], "--data-dir", str(tmp_path / "data")],
        env=environment(COLUMNS="1000"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode == 1, refused.stderr
    assert "is damaged" in refused.stderr
    assert "restore the last backup" in refused.stderr
    assert "Traceback" not in refused.stderr + refused.stdout


@pytest.mark.complete
def test_the_running_server_says_so_too(tmp_path: Path) -> None:
    with Serving(tmp_path / "data", "--no-worker") as serving:
        serving.post("/campaigns", {"name": "Kept"})
        serving.get("/campaigns")
        file = serving.data_dir / "gainline.sqlite3"
        with closing(sqlite3.connect(file)) as connection:
            (page,) = connection.execute("SELECT rootpage FROM sqlite_master WHERE name = 'campaign'").fetchone()
            connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        overwrite(file, page)
        with closing(sqlite3.connect(file)) as connection:  # a change, so that pages that are known are read again
            connection.execute("PRAGMA user_version = 1")
        answer = serving.api.get("/campaigns")
        assert answer.status_code == 503, answer.text
        assert "is damaged" in answer.json()["detail"]
        assert "restore the last backup" in answer.json()["hint"]
        assert serving.api.get("/health").status_code == 200
