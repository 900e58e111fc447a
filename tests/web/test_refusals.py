"""Reasons of refused fields, in words of a person who does not know the validator."""

from typing import Annotated, Any, Literal

import pytest
from fastapi.testclient import TestClient
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.common.schemas import Name
from app.web.errors import reason_of


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")
    rule: Literal["noise", "paper"] = "noise"


class Body(BaseModel):
    model_config = ConfigDict(extra="forbid")
    name: Name = "a"
    flights: Annotated[int, Field(strict=True, ge=1, le=200)] = 7
    share: Annotated[float, Field(strict=True, gt=0, lt=1)] = 0.5
    real: bool = False
    inner: Inner = Inner()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ({"name": " "}, "must not be empty"),
        ({"name": "x" * 121}, "must have at most 120 characters"),
        ({"flights": 0}, "must be at least 1, got 0"),
        ({"flights": 1000000}, "must be at most 200, got 1000000"),
        ({"flights": 2.5}, "must be a whole number, got 2.5"),
        ({"flights": "7"}, "must be a whole number, got '7'"),
        ({"share": 0}, "must be above 0, got 0"),
        ({"share": 1.01}, "must be below 1, got 1.01"),
        ({"real": "perhaps"}, "must be true or false, got 'perhaps'"),
        ({"inner": {"rule": "luck"}}, "must be 'noise' or 'paper', got 'luck'"),
        ({"inner": "noise"}, "must be an object with fields (rule)"),
        ({"vehicl": {}}, "is not a known field (name, flights, share, real, inner)"),
        ({"inner": {"rul": "paper"}}, "is not a known field (rule)"),
    ],
)
def test_a_refused_value_has_a_reason_in_plain_words(body: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValidationError) as refused:
        Body.model_validate(body)
    assert [reason_of(found, Body) for found in refused.value.errors()] == [reason]


def test_a_refused_value_that_is_not_repeated_is_not_written_out() -> None:
    deeper_than_python_writes: list[Any] = []
    for _ in range(100_000):
        deeper_than_python_writes = [deeper_than_python_writes]
    found = {"type": "missing", "loc": ("body", "name"), "input": deeper_than_python_writes}
    assert reason_of(found, Body) == "is missing"


def test_a_request_with_an_unknown_field_is_told_the_known_ones(client: TestClient) -> None:
    answer = client.post("/api/campaigns", json={"name": "A", "vehicl": {}, "vehicle": "twin"})
    reasons = {problem["field"]: problem["reason"] for problem in answer.json()["problems"]}
    assert reasons["vehicl"] == "is not a known field (name, vehicle, definition)"
    assert reasons["vehicle"].startswith("must be an object with fields (kind, ")
    assert "/api/openapi.json" in answer.json()["script_hint"]
