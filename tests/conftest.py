"""Fixtures of the storage and REST tests: a real database, migrated once and copied, and the real application on it."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app.db.migrate import migrate
from app.db.session import Database
from app.main import create_app
from app.settings import Settings


@pytest.fixture(scope="session")
def migrated_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database at the newest revision, built by the migrations; for copying only."""
    file = tmp_path_factory.mktemp("migrated") / "gainline.sqlite3"
    migrate(file)
    return file


@pytest.fixture
def settings(tmp_path: Path, migrated_file: Path) -> Settings:
    """Settings on a fresh data folder with an empty database, and no built dashboard."""
    chosen = Settings(data_dir=tmp_path / "data", ui_dir=tmp_path / "ui", port=0)
    chosen.data_dir.mkdir()
    shutil.copyfile(migrated_file, chosen.database_file)
    return chosen


@pytest.fixture
def application(settings: Settings) -> FastAPI:
    return create_app(settings)


@pytest.fixture
def database(application: FastAPI) -> Database:
    """The application's own database."""
    opened: Database = application.state.database
    return opened


@pytest.fixture
def client(application: FastAPI) -> Iterator[TestClient]:
    """HTTP to the running application, in this process. Errors come as answers, as from a server."""
    with TestClient(application, base_url="http://127.0.0.1:8000", raise_server_exceptions=False) as running:
        yield running
