"""Whatever the OpenAPI document allows or forbids: no request makes the application stumble, or answer otherwise."""

import json
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from fastapi import FastAPI
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given
from hypothesis import settings as examples
from schemathesis.generation import GenerationMode
from schemathesis.schemas import BaseSchema
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)
from starlette.types import Receive, Scope, Send

from app.common.settings import Settings
from app.db.session import Database
from app.main import create_app
from tests.builders import create_flown_trial, create_imported_trial, create_ready_campaign, create_trial, run_jobs
from tests.fleet.vehicles import create_campaign_on, create_connected
from tests.unlocking import HERE
from tests.waiting import Waits

pytestmark = pytest.mark.complete

PATHS = json.loads((Path(__file__).parents[2] / "frontend" / "openapi.json").read_text())["paths"]
FURNISHED = 4
"""Ids up to this one exist, or are among the first that do not."""
EXAMPLES = 5
"""Of each operation; `.ci/api-fuzz` asks a running server for many more."""
FEW = {
    "/api/campaigns/{campaign_id}/report.pdf": 3,
    "/api/campaigns/{campaign_id}/report.html": 6,
    "/api/trials/{trial_id}/trajectory": 8,
    "/api/controller-checks": 8,
    "/api/log-analyses": 6,
    "/api/log-analyses/campaign": 6,
}
"""Examples of what takes a second, a process or a browser for each."""
NAMED = {"Host": "127.0.0.1"}
ENDLESS = "/api/events"
OPERATIONS = [(method, path) for path, operations in PATHS.items() if path != ENDLESS for method in operations]


class FromHere:
    """The application as it is asked from this computer."""

    def __init__(self, application: FastAPI) -> None:
        self._application = application

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self._application({**scope, "client": HERE}, receive, send)


@pytest.fixture(scope="module")
def application(tmp_path_factory: pytest.TempPathFactory, migrated_file: Path) -> Iterator[FastAPI]:
    """One for this module: schemathesis keeps it running."""
    folder = tmp_path_factory.mktemp("described")
    chosen = Settings(data_dir=folder / "data", ui_dir=folder / "ui", port=0)
    chosen.data_dir.mkdir()
    shutil.copyfile(migrated_file, chosen.database_file)
    running = create_app(chosen)
    yield running
    running.state.database.close()


@pytest.fixture(scope="module")
def schema(application: FastAPI) -> BaseSchema:
    return schemathesis.openapi.from_asgi("/api/openapi.json", FromHere(application), headers=NAMED)


@pytest.fixture(scope="module")
def furnished_file(application: FastAPI, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with something of everything, so that small ids are found."""
    database, kept = application.state.database, tmp_path_factory.mktemp("furnished") / "gainline.sqlite3"
    with TestClient(application, base_url="http://127.0.0.1:8000", client=HERE) as client:
        furnish(client, database)
    copy_database(database.file, kept)
    return kept


@pytest.fixture
def furnished(furnished_file: Path, application: FastAPI) -> None:
    copy_database(furnished_file, application.state.database.file)


def copy_database(source: Path, target: Path) -> None:
    with closing(sqlite3.connect(source)) as taken, closing(sqlite3.connect(target)) as given:
        taken.backup(given)


def furnish(client: TestClient, database: Database) -> None:
    flown = create_ready_campaign(client, database)["id"]
    create_flown_trial(client, database, flown)
    imported = create_ready_campaign(client, database, vehicle="import", definition={"stop": {"kind": "budget"}})["id"]
    create_imported_trial(client, imported)
    run_jobs(database)
    create_trial(client, imported)
    create_trial(client, create_campaign_on(client, database, create_connected(client, database))["id"])


@pytest.mark.parametrize("mode", GenerationMode)
@pytest.mark.parametrize(("method", "path"), OPERATIONS)
@pytest.mark.usefixtures("furnished")
def test_every_answer_is_as_described(schema: BaseSchema, method: str, path: str, mode: GenerationMode) -> None:
    operation = schema[path][method]
    if mode == GenerationMode.NEGATIVE and not (any(operation.iter_parameters()) or operation.body):
        return  # nothing can be wrong about it

    @given(case=operation.as_strategy(generation_mode=mode))
    @examples(
        max_examples=FEW.get(path, EXAMPLES), deadline=None, suppress_health_check=list(HealthCheck), derandomize=True
    )
    def check(case: schemathesis.Case[Any]) -> None:
        if mode == GenerationMode.POSITIVE:
            case.path_parameters.update(
                {name: value % FURNISHED + 1 for name, value in case.path_parameters.items() if isinstance(value, int)}
            )
        answer = case.call_and_validate(
            checks=[
                schemathesis.checks.not_a_server_error,
                status_code_conformance,
                content_type_conformance,
                response_schema_conformance,
            ],
            headers=NAMED,
            timeout=Waits.at_most_s,
        )
        if answer.status_code >= 400:
            problem = answer.json()
            assert problem["status"] == answer.status_code
            assert problem["detail"]
            assert problem["hint"]

    check()
