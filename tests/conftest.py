"""Fixtures of the storage and REST tests: a real database, migrated once and copied, and the real application on it."""

import gc
import shutil
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import hypothesis
import pytest
import structlog
from fastapi import FastAPI
from fastapi.testclient import TestClient
from sqlalchemy import event

from app.common.settings import Settings
from app.db.migrate import migrate
from app.db.session import Database
from app.main import create_app
from tests.unlocking import client_here
from tests.waiting import Waits

# No test measures how long something takes: the first example of one may load and compile the numerics.
hypothesis.settings.register_profile("untimed", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow])
hypothesis.settings.load_profile("untimed")

# Errors that a test provokes are logged with their places, not with every value there, which takes seconds to print.
structlog.configure(
    processors=[
        structlog.contextvars.merge_contextvars,
        structlog.processors.add_log_level,
        structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback),
    ]
)


def pytest_configure(config: pytest.Config) -> None:
    """Whatever a test waits for, its own time limit alone decides how long: --timeout, or the project's. A wait ends
    a sixth before that, so that it can say what it waited for."""
    chosen_s = config.getoption("timeout")
    limit_s = float(config.getini("timeout") if chosen_s is None else chosen_s)
    Waits.at_most_s = limit_s * 5 / 6 if limit_s else Waits.at_most_s


def pytest_collection() -> None:
    """Nothing that is collected is garbage: looking for some takes a tenth of the time."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.freeze()
    gc.enable()


def waiting_s(item: pytest.Item) -> float:
    """About as long as a test of real time takes; 0 for any other."""
    mark = item.get_closest_marker("real_time")
    return 0.0 if mark is None else float(mark.kwargs.get("about_s", 1.0))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that wait come first: one process waits with them, while the others use the processors. Those that wait
    longest are the first of them, so that none is still waited for at the end."""
    items.sort(key=waiting_s, reverse=True)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """A test that waits for the clock on the wall says why. Not refused when it is collected: where several processes
    collect, no test would be run and no reason shown."""
    if any(not mark.args for mark in item.iter_markers("real_time")):
        pytest.fail('It must say why it waits: @pytest.mark.real_time("…")', pytrace=False)


@pytest.fixture(scope="session")
def migrated_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database at the newest revision, built by the migrations; for copying only."""
    file = tmp_path_factory.mktemp("migrated") / "gainline.sqlite3"
    migrate(file)
    return file


@pytest.fixture(scope="session")
def shared_application(tmp_path_factory: pytest.TempPathFactory) -> FastAPI:
    """One for all tests of a process: its routes and its statements are compiled once."""
    folder = tmp_path_factory.mktemp("shared")
    application = create_app(Settings(data_dir=folder / "data", ui_dir=folder / "ui", port=0))
    event.listen(application.state.database.engine, "connect", _do_not_wait_for_the_disk)
    return application


def _do_not_wait_for_the_disk(connection: sqlite3.Connection, _entry: object) -> None:
    """No database of these tests has to outlive its process: those that kill one have servers of their own."""
    connection.execute("PRAGMA synchronous = OFF")


@pytest.fixture
def settings(shared_application: FastAPI, migrated_file: Path) -> Iterator[Settings]:
    """Settings on a fresh data folder with an empty database, and no built dashboard."""
    chosen: Settings = shared_application.state.settings
    chosen.data_dir.mkdir()
    shutil.copyfile(migrated_file, chosen.database_file)
    yield chosen
    shared_application.state.database.close()
    for folder in (chosen.data_dir, chosen.ui_dir):
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def application(shared_application: FastAPI, settings: Settings) -> FastAPI:
    """The application on these settings, to be used as it is: a test that changes it creates one of its own."""
    return shared_application


@pytest.fixture
def database(application: FastAPI) -> Database:
    """The application's own database."""
    opened: Database = application.state.database
    return opened


Listen = Callable[[object, str, Callable[..., object]], None]


@pytest.fixture
def listen() -> Iterator[Listen]:
    """`sqlalchemy.event.listen` for one test: the database's engine is shared by all of a process."""
    with ExitStack() as stack:

        def add(target: object, name: str, function: Callable[..., object]) -> None:
            event.listen(target, name, function)
            stack.callback(event.remove, target, name, function)

        yield add


@pytest.fixture
def client(application: FastAPI) -> Iterator[TestClient]:
    """HTTP to the running application, in this process. Errors come as answers, as from a server."""
    with client_here(application) as running:
        yield running
