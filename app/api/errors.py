"""Errors over HTTP: problem details (RFC 9457) with a hint. The only place that knows what error has which status."""

import errno
import uuid
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Any, Final

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from app.errors import (
    ConflictError,
    GainlineError,
    InputError,
    MediaTypeError,
    NotFoundError,
    StorageError,
    TooLargeError,
)
from app.live.client import LinkDownError
from app.schemas import Problem, ProblemField

MEDIA_TYPE: Final = "application/problem+json"

_STATUS: Final[Mapping[type[GainlineError], HTTPStatus]] = {
    NotFoundError: HTTPStatus.NOT_FOUND,
    ConflictError: HTTPStatus.CONFLICT,
    TooLargeError: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    MediaTypeError: HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    InputError: HTTPStatus.UNPROCESSABLE_ENTITY,
    StorageError: HTTPStatus.SERVICE_UNAVAILABLE,
    LinkDownError: HTTPStatus.SERVICE_UNAVAILABLE,
    GainlineError: HTTPStatus.INTERNAL_SERVER_ERROR,
}

_HINTS: Final[Mapping[int, str]] = {
    404: "Check the address; the paths of the API are listed in /api/openapi.json.",
    405: "This address knows other methods; they are listed in /api/openapi.json.",
    413: "Send less at once: a JSON body has at most 1 MiB, a flight record at most 200 000 rows.",
}

RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    "default": {
        "description": "An error: what happened, what to do about it, and the fields that are to blame.",
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}},
    },
}
"""For OpenAPI: every operation may answer with a problem."""

_log = structlog.get_logger(__name__)


def install(app: FastAPI) -> None:
    """Answer every error of the application with problem details."""
    app.add_exception_handler(GainlineError, _own_error)
    app.add_exception_handler(RequestValidationError, _invalid_request)
    app.add_exception_handler(HTTPException, _http_error)
    app.add_exception_handler(OSError, _system_error)
    app.add_exception_handler(Exception, _unforeseen)


def status_of(error: GainlineError) -> HTTPStatus:
    """The status of the nearest class that has one."""
    return next(_STATUS[kind] for kind in type(error).__mro__ if kind in _STATUS)


def _problem(status: int, detail: str, hint: str, problems: Iterable[ProblemField] = (), *,
             kind: str = "about:blank", title: str | None = None,
             headers: Mapping[str, str] | None = None) -> JSONResponse:
    body = Problem(type=kind, title=title or HTTPStatus(status).phrase, status=status, detail=detail, hint=hint,
                   problems=list(problems))
    return JSONResponse(body.model_dump(), status, headers, media_type=MEDIA_TYPE)


async def _own_error(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, GainlineError)
    name = type(error).__name__.removesuffix("Error")
    words = "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()
    return _problem(status_of(error), error.message, error.hint,
                    [ProblemField(field=problem.field, reason=problem.reason) for problem in error.problems],
                    kind=f"urn:gainline:{words.replace(' ', '-')}", title=words.capitalize())


async def _invalid_request(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    problems = [ProblemField(field=_field(found["loc"]), reason=_reason(found)) for found in error.errors()]
    return _problem(HTTPStatus.UNPROCESSABLE_ENTITY, "The request has fields that cannot be used; nothing was changed.",
                    "Correct the named fields and send the request again.", problems,
                    kind="urn:gainline:input", title="Input")


def _field(location: tuple[str | int, ...]) -> str:
    """Dotted as the caller wrote it: without the part of the request, unless there is nothing else."""
    return ".".join(map(str, location[1:] if len(location) > 1 else location))


def _reason(found: Mapping[str, Any]) -> str:
    if found["type"] == "json_invalid":
        return f"the body is not JSON ({found.get('ctx', {}).get('error', 'cannot be read')} at this character)"
    text: str = found["msg"]
    return text[:1].lower() + text[1:]


async def _http_error(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    hint = _HINTS.get(error.status_code, "Correct the request and send it again.")
    return _problem(error.status_code, str(error.detail), hint, headers=error.headers)


async def _system_error(request: Request, error: Exception) -> JSONResponse:
    """A full disk may also show outside of the database, for instance while an upload is set aside."""
    if isinstance(error, OSError) and error.errno in {errno.ENOSPC, errno.EDQUOT}:
        return await _own_error(request, StorageError(
            "The disk is full; nothing of this request was stored.",
            hint="Free some space, then do the same again; everything stored before is intact."))
    return await _unforeseen(request, error)


async def _unforeseen(request: Request, error: Exception) -> JSONResponse:
    number = uuid.uuid4().hex[:12]
    _log.error("unforeseen error", error_id=number, method=request.method, path=request.url.path, exc_info=error)
    return _problem(HTTPStatus.INTERNAL_SERVER_ERROR,
                    f"The program made a mistake (number {number}); nothing of this request was stored.",
                    f"Try again. If it happens again, report it with the number {number} and the log.")
