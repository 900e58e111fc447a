"""The OpenAPI document: FastAPI's own, plus the problem details that every operation may answer with."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.constants import REF_TEMPLATE

from app.common.schemas import Problem


def describe(app: FastAPI) -> None:
    """Add the problem schema to the application's OpenAPI document."""
    plain = app.openapi

    def complete() -> dict[str, Any]:
        document = plain()
        schemas = document.setdefault("components", {}).setdefault("schemas", {})
        if "Problem" not in schemas:
            problem = Problem.model_json_schema(ref_template=REF_TEMPLATE)
            schemas.update(problem.pop("$defs"))
            schemas["Problem"] = problem
        return document

    app.openapi = complete  # type: ignore[method-assign]
