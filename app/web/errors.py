"""Errors over HTTP: problem details (RFC 9457) with a hint, why a request's schema refuses a value, and the description
of both in the OpenAPI document. The only module that maps errors to status codes.
"""

import errno
import json
import tomllib
import uuid
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, get_args

import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.constants import REF_TEMPLATE
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from app.common.errors import (
    BusyError,
    ConflictError,
    ForeignRequestError,
    GainlineError,
    GainsError,
    InputError,
    KeyReusedError,
    MediaTypeError,
    NotAllowedError,
    NotFoundError,
    Problem,
    StorageError,
    TooLargeError,
    TrajectoryError,
    UnavailableError,
    UnconfirmedError,
)
from app.common.schemas import Problem as ProblemDetails
from app.common.schemas import ProblemField
from app.live.link import LinkDownError

MEDIA_TYPE: Final = "application/problem+json"

_KINDS: Final[Mapping[type[GainlineError], tuple[HTTPStatus, str]]] = {
    NotAllowedError: (HTTPStatus.FORBIDDEN, "Not allowed"),
    ForeignRequestError: (HTTPStatus.FORBIDDEN, "Foreign request"),
    NotFoundError: (HTTPStatus.NOT_FOUND, "Not found"),
    BusyError: (HTTPStatus.CONFLICT, "Vehicle busy"),
    ConflictError: (HTTPStatus.CONFLICT, "Conflict"),
    TooLargeError: (HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "Too large"),
    MediaTypeError: (HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "Unsupported type"),
    KeyReusedError: (HTTPStatus.UNPROCESSABLE_ENTITY, "Key reused"),
    GainsError: (HTTPStatus.UNPROCESSABLE_ENTITY, "Gains refused"),
    TrajectoryError: (HTTPStatus.UNPROCESSABLE_ENTITY, "Unusable record"),
    UnconfirmedError: (HTTPStatus.CONFLICT, "Confirmation needed"),
    InputError: (HTTPStatus.UNPROCESSABLE_ENTITY, "Unusable input"),
    UnavailableError: (HTTPStatus.SERVICE_UNAVAILABLE, "Not available"),
    StorageError: (HTTPStatus.SERVICE_UNAVAILABLE, "Storage error"),
    LinkDownError: (HTTPStatus.SERVICE_UNAVAILABLE, "Worker unreachable"),
    GainlineError: (HTTPStatus.INTERNAL_SERVER_ERROR, "Error"),
}
"""Status and title; a class that is not listed has those of its nearest listed base class."""

_HTTP: Final[Mapping[int, tuple[str, str]]] = {
    400: (
        "The body cannot be read; nothing was changed.",
        "Send JSON in UTF-8 without deep nesting, or a flight record as `text/csv`.",
    ),
    404: ("No resource at {path}.", "Check the address; the paths of the API are listed in /api/openapi.json."),
    405: ("{path} does not support the method {method}.", "The methods of each path are listed in /api/openapi.json."),
}
"""Errors raised by the framework itself."""

RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    "default": {
        "description": "An error: what happened, what to do about it, and the invalid fields.",
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
    },
}
"""For OpenAPI: every operation may answer with a problem."""

_log = structlog.get_logger(__name__)


def install(app: FastAPI) -> None:
    """Answer every error of the application with problem details, and add their schema to its OpenAPI document."""
    plain = app.openapi

    @cache
    def complete() -> dict[str, Any]:
        document = plain()
        problem = ProblemDetails.model_json_schema(ref_template=REF_TEMPLATE)
        document["components"]["schemas"] |= {**problem.pop("$defs"), "Problem": problem}
        return document

    app.openapi = complete  # type: ignore[method-assign]
    for kind, handler in {
        GainlineError: _own_error,
        RequestValidationError: _invalid_request,
        HTTPException: _http_error,
        OSError: _system_error,
        Exception: _unexpected,
    }.items():
        app.add_exception_handler(kind, handler)


def _problem(
    status: int,
    detail: str,
    hint: str,
    problems: Iterable[ProblemField] = (),
    *,
    title: str = "",
    script_hint: str = "",
    headers: Mapping[str, str] | None = None,
) -> Response:
    kind = f"urn:gainline:{title.lower().replace(' ', '-')}" if title else "about:blank"
    body = ProblemDetails(
        type=kind,
        title=title or HTTPStatus(status).phrase,
        status=status,
        detail=detail,
        hint=hint,
        script_hint=script_hint,
        problems=list(problems),
    )
    # A quoted part of the request may hold a lone surrogate, which UTF-8 cannot encode.
    content = json.dumps(body.model_dump(), ensure_ascii=False).encode("utf-8", "replace")
    return Response(content, status, headers, media_type=MEDIA_TYPE)


async def _own_error(_request: Request, error: Exception) -> Response:
    assert isinstance(error, GainlineError)
    return problem_response(error)


def problem_response(error: GainlineError) -> Response:
    """Response for one of the application's errors; also used before the request reaches the application."""
    status, title = next(_KINDS[kind] for kind in type(error).__mro__ if kind in _KINDS)
    return _problem(
        status,
        error.message,
        error.hint,
        [ProblemField.view_of(problem) for problem in error.problems],
        title=title,
        script_hint=error.script_hint,
    )


async def _invalid_request(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    body = getattr(request.scope.get("route"), "body_field", None)
    schema = None if body is None else body.field_info.annotation
    return problem_response(
        InputError(
            "Some values cannot be used; nothing was changed.",
            hint="Correct the fields listed, then try again.",
            problems=tuple(_refused(found, schema) for found in error.errors()),
            script_hint="The fields of every request are described in /api/openapi.json.",
        )
    )


def _refused(found: Mapping[str, Any], schema: object) -> Problem:
    """The refused field, dotted as the caller wrote it: without the part of the request, unless there is nothing
    else."""
    part, *inner = found["loc"]
    if found["type"] == "json_invalid":
        return Problem("body", f"is not JSON: {found['ctx']['error']}, at character {inner[0]}")
    return Problem(".".join(map(str, inner or [part])), reason_of(found, schema))


_SHOWN: Final = 40
"""Longest text of a refused value that is repeated."""

_REASONS: Final[Mapping[str, str]] = tomllib.loads((Path(__file__).parent / "refusals.toml").read_text("utf-8"))
"""By the validator's type of error, with its limits."""

_ABOUT_FIELDS: Final = frozenset({"extra_forbidden", "model_type", "model_attributes_type"})
_QUOTED: Final = _REASONS.keys() - {"missing", "extra_forbidden", "string_too_short", "string_too_long"}


def reason_of(found: Mapping[str, Any], schema: object = None) -> str:
    """The reason of one of the validator's errors, with the refused value where it is a short one; a type of error that
    has no words here keeps the validator's message.

    With the body's `schema`, fields that do not exist and values that should be objects are refused with the fields
    that there are.
    """
    kind, limits, value = found["type"], found.get("ctx", {}), found.get("input")
    if fields := _fields_at(schema, [part for part in found["loc"] if part != "body"], kind):
        return f"{_REASONS[kind]} ({', '.join(fields)})"
    if kind == "string_too_short" and limits["min_length"] == 1:
        return "must not be empty"
    if kind not in _REASONS:
        message: str = found["msg"]
        return message[:1].lower() + message[1:]
    written = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in limits.items()}
    reason = _REASONS[kind].format_map(written)
    if kind not in _QUOTED or not isinstance(value, bool | int | float | str) or len(str(value)) > _SHOWN:
        return reason
    return f"{reason}, got {str(value).lower() if isinstance(value, bool) else repr(value)}"  # as JSON has it


def _fields_at(schema: object, path: Sequence[object], kind: str) -> tuple[str, ...]:
    """Names of the fields known where the error is; none for errors of another type, and in a free mapping."""
    if kind not in _ABOUT_FIELDS:
        return ()
    for name in path[:-1] if kind == "extra_forbidden" else path:
        model = _model_in(schema)
        if model is None or name not in model.model_fields:
            return ()
        schema = model.model_fields[str(name)].annotation
    model = _model_in(schema)
    return () if model is None else tuple(model.model_fields)


def _model_in(schema: object) -> type[BaseModel] | None:
    """The model itself, or the one in a union with None."""
    if isinstance(schema, type) and issubclass(schema, BaseModel):
        return schema
    return next((model for part in get_args(schema) if (model := _model_in(part)) is not None), None)


async def _http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    if isinstance(error.__cause__, GainlineError):  # the framework passes on no other error while it reads a body
        return problem_response(error.__cause__)
    detail, hint = str(error.detail), "Correct the request and send it again."
    if error.status_code in _HTTP:
        sentence, hint = _HTTP[error.status_code]
        detail = sentence.format(method=request.method, path=request.url.path)
    return _problem(error.status_code, detail, hint, headers=error.headers)


async def _system_error(request: Request, error: Exception) -> Response:
    """Answer an OSError; a full disk may also appear outside the database, for instance while an upload is spooled."""
    if isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
        return problem_response(
            StorageError(
                "The disk is full; nothing from this request was stored.",
                hint="Free some disk space, then try again. Everything stored before is intact.",
            )
        )
    return await _unexpected(request, error)


async def _unexpected(request: Request, error: Exception) -> Response:
    number = uuid.uuid4().hex[:12]
    _log.error("unexpected error", error_id=number, method=request.method, path=request.url.path, exc_info=error)
    return _problem(
        HTTPStatus.INTERNAL_SERVER_ERROR,
        f"Internal error {number}; nothing from this request was stored.",
        f"Try again. If it happens again, report it with its number, {number}, and the log.",
    )
