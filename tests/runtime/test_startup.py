"""What processes import before anybody asks them for anything, each in a fresh interpreter."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from app.autopilots.log_readers import read_content

NUMERICS = ("jsbsim", "numba", "plotly", "pymavlink", "scipy")
DATABASE = ("pydantic", "sqlalchemy")
READS_LOGS = re.compile(r"app\.autopilots\.(readers|tlog|\w+\.(log|flight|replica_check))")

SERVE = """
import sys
from pathlib import Path
from fastapi.testclient import TestClient
from app.main import create_app
from app.common.settings import Settings
data_dir, ui_dir = map(Path, sys.argv[1:])
with TestClient(create_app(Settings(data_dir=data_dir, ui_dir=ui_dir)), base_url="http://127.0.0.1") as client:
    for path in ("/", "/api/health", "/api/campaigns", "/api/catalogue", "/api/vehicles"):
        answer = client.get(path)
        assert answer.status_code == 200, (path, answer.text)
"""

HELP = """
import sys
from app.cli.__main__ import main
sys.argv = ["gainline", "--help"]
try:
    main()
except SystemExit as done:
    assert not done.code
"""


def imported(program: str, *arguments: Path) -> set[str]:
    """The packages that a program has imported at its end, and the application's own modules."""
    tell = "\nprint(*{name.partition('.')[0] for name in sys.modules}, *(n for n in sys.modules if n[:4] == 'app.'))"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys\n{program}{tell}", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


@pytest.mark.complete
def test_the_first_pages_are_served_without_a_numeric_library(migrated_file: Path, tmp_path: Path) -> None:
    ui_dir = tmp_path / "ui"
    ui_dir.mkdir()
    (ui_dir / "index.html").write_text("<!doctype html><title>Gainline</title>")
    data_dir = tmp_path / "data"
    data_dir.mkdir()
    (data_dir / "gainline.sqlite3").write_bytes(migrated_file.read_bytes())
    found = imported(SERVE, data_dir, ui_dir)
    assert not found.intersection((*NUMERICS, "alembic"))
    assert not [name for name in found if READS_LOGS.fullmatch(name)]


@pytest.mark.complete
def test_help_is_printed_without_the_web_the_database_and_numbers() -> None:
    assert not imported(HELP).intersection((*NUMERICS, *DATABASE, "fastapi", "numpy", "structlog"))


def test_processes_that_compute_and_fly_do_not_import_the_database() -> None:
    modules = "app.campaigns.computation, app.processes.calls, app.flights.flight_process"
    assert not imported(f"import {modules}").intersection((*NUMERICS, *DATABASE))


@pytest.mark.complete
def test_the_worker_starts_without_what_only_its_processes_need() -> None:
    assert not imported("import app.runtime.worker").intersection((*NUMERICS, "alembic", "fastapi"))


@pytest.mark.complete
def test_the_worker_is_started_before_the_web_application_is_imported() -> None:
    assert not imported("import app.runtime.serve").intersection((*NUMERICS, "fastapi", "sqlalchemy"))


def test_requests_never_find_a_package_that_another_thread_is_importing() -> None:
    """Python 3.11 takes a package out of `sys.modules` for a moment when its import ends."""
    assert imported("import app.runtime.web_server").issuperset(("scipy",))


@pytest.mark.complete
def test_a_process_that_reads_a_file_loads_neither_the_web_nor_the_database() -> None:
    """Each file has a separate process, whose start the sender of the file waits for."""
    assert not imported(f"import {read_content.__module__}").intersection(("fastapi", "plotly", *DATABASE))
