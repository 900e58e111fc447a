"""Whatever the OpenAPI document allows or forbids: no request makes the application stumble, or answer otherwise."""

import json
from pathlib import Path
from typing import Any

import pytest
import schemathesis
from fastapi import FastAPI
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from app.db.session import Database
from tests.builders import create_flown_trial, create_imported_trial, create_ready_campaign, create_trial, run_jobs
from tests.fleet.vehicles import create_campaign_on, create_connected

pytestmark = pytest.mark.slow

PATHS = json.loads((Path(__file__).parents[2] / "frontend" / "openapi.json").read_text())["paths"]
FURNISHED = 4
"""Ids up to this one exist, or are among the first that do not."""
HERE = {"Host": "127.0.0.1"}
ENDLESS = "/api/events"
OPERATIONS = [(method, path) for path, operations in PATHS.items() if path != ENDLESS for method in operations]


@pytest.fixture
def furnished(client: TestClient, database: Database) -> None:
    """Something of everything, so that small ids are found."""
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
def test_every_answer_is_as_described(application: FastAPI, method: str, path: str, mode: GenerationMode) -> None:
    operation = schemathesis.openapi.from_asgi("/api/openapi.json", application, headers=HERE)[path][method]
    if mode == GenerationMode.NEGATIVE and not (any(operation.iter_parameters()) or operation.body):
        return  # nothing can be wrong about it

    @given(case=operation.as_strategy(generation_mode=mode))
    @settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
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
            headers=HERE,
        )
        if answer.status_code >= 400:
            problem = answer.json()
            assert problem["status"] == answer.status_code
            assert problem["detail"]
            assert problem["hint"]

    check()
