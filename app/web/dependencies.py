"""What routes have in common: sessions to read and to write, idempotent POST requests, uploaded files, which are
spooled while they arrive, and files that are made for one download.
"""

import hashlib
import json
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import IO, Annotated, Any, BinaryIO, Final, TypeVar

from fastapi import Depends, Header, Path, Query, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import StreamingResponse
from pydantic import BaseModel, ValidationError
from pydantic_core import from_json
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import FormData, UploadFile

from app.accounts.permissions import RequestContext
from app.common.errors import InputError, MediaTypeError, Problem
from app.common.settings import Settings
from app.db.pages import Part
from app.db.session import Database, carry_out_once
from app.documents.html import Document
from app.figures.theme import ThemeName
from app.live.hub import Live as LiveLink
from app.web.origin import caller_of

M = TypeVar("M", bound=BaseModel)

Id = Annotated[int, Path(ge=1, le=2**63 - 1)]
ReadVersion = Annotated[int, Query(ge=1, description="version as last read")]
Limit = Annotated[int, Query(ge=1, le=200, description="maximum number of items on the page")]
CursorText = Annotated[str | None, Query(max_length=500, description="`next_cursor` of the previous page")]
IdempotencyKey = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="a text chosen by the client, new for each operation: repeating a request with the same key has no "
        "further effect",
    ),
]

ControlToken = Annotated[
    str | None,
    Header(
        alias="X-Gainline-Control",
        max_length=100,
        description="token of the lease that gives control of the vehicle",
    ),
]


# These are coroutines and so need no thread: an abort gets through while every thread waits for the database.


async def _wanted_part(limit: Limit = 50, cursor: CursorText = None) -> Part:
    return Part(limit, cursor)


WantedPart = Annotated[Part, Depends(_wanted_part)]


def of_app(name: str) -> Any:
    """Dependency on what the application's state holds under that name."""

    async def read(request: Request) -> Any:
        return getattr(request.app.state, name)

    return Depends(read)


CurrentDatabase = Annotated[Database, of_app("database")]
Live = Annotated[LiveLink, of_app("live")]
CurrentSettings = Annotated[Settings, of_app("settings")]


async def _request_context(request: Request, settings: CurrentSettings, token: ControlToken = None) -> RequestContext:
    """Build the request context. Scripts in a page cannot set Sec-Fetch-Site; only the browser does."""
    return RequestContext(
        token=token,
        caller=caller_of(request),
        from_our_page=request.headers.get("sec-fetch-site") == "same-origin",
        simulation_hosts=settings.simulation_hosts,
    )


RequestContextDep = Annotated[RequestContext, Depends(_request_context)]


def _reader(database: CurrentDatabase) -> Iterator[Session]:
    with database.read() as session:
        yield session


def _writer(database: CurrentDatabase) -> Iterator[Session]:
    with database.write() as session:
        yield session


# Scope "function": the transaction has ended before the response is sent.
Reader = Annotated[Session, Depends(_reader, scope="function")]
Writer = Annotated[Session, Depends(_writer, scope="function")]


@dataclass(frozen=True, slots=True)
class IdempotentRequest:
    """Carries out a POST in one transaction, and only once for requests with the same idempotency key. `answer` is the
    model of the route's answers."""

    database: Database
    key: str | None
    fingerprint: str
    answer: type[Any]

    def __call__(self, work: Callable[[Session], M], *, ahead: Callable[[Session], None] | None = None) -> M:
        """Return the result of `work`, or its stored result of the first time. Raises KeyReusedError for another
        request.

        `ahead` reads and computes before the transaction, so that the write lock is held for a short time only.
        """
        if ahead is not None:
            with self.database.read() as session:
                ahead(session)
        with self.database.write() as session:
            if self.key is None:
                return work(session)
            answer: M = carry_out_once(session, self.key, self.fingerprint, self.answer, work)
            return answer


def _idempotent(request: Request, database: Database, key: str | None, body_digest: str) -> IdempotentRequest:
    """Two requests are the same if method, path and body are."""
    fingerprint = hashlib.sha256(f"{request.method} {request.url.path} {body_digest}".encode()).hexdigest()
    return IdempotentRequest(database, key, fingerprint, request.scope["route"].response_model)


async def _once(request: Request, database: CurrentDatabase, key: IdempotencyKey = None) -> IdempotentRequest:
    return _idempotent(request, database, key, hashlib.sha256(await request.body()).hexdigest())


IdempotentPost = Annotated[IdempotentRequest, Depends(_once)]


async def json_only(request: Request) -> None:
    """Refuse a body that is not JSON with a sentence about it, rather than with a list of missing fields."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    has_body = request.headers.get("content-length", "0") != "0" or "transfer-encoding" in request.headers
    if has_body and kind != "application/json":
        raise MediaTypeError(
            f"The body is {kind or 'of unknown type'}; JSON is expected here.",
            hint="Send JSON with the header `Content-Type: application/json`.",
        )


Theme = Annotated[ThemeName, Query(description="colours for a light or a dark page")]


_CSV: Final = "text/csv"
_ANY: Final = "application/octet-stream"

_FILE: Final = {"type": "string", "format": "binary"}
_COMPANION: Final = {**_FILE, "description": "the .log file that Paparazzi writes next to a .data file"}
_TRIAL: Final = {
    "type": "string",
    "contentMediaType": "application/json",
    "description": "the trial to plan, as JSON: proposal_id, gains or variant; note",
}


def _body(
    fields: Mapping[str, object], *, required: Sequence[str] = ("file",), raw: Sequence[str] = ()
) -> dict[str, object]:
    """Request body of a form, or of the file alone in one of the `raw` types."""
    form = {"type": "object", "required": list(required), "properties": dict(fields)}
    content = {"multipart/form-data": {"schema": form}} | {kind: {"schema": _FILE} for kind in raw}
    return {"requestBody": {"required": True, "content": content}}


REQUEST_BODY: Final = _body({"file": _FILE, "companion": _COMPANION}, raw=(_CSV, _ANY))
"""Request body of a flight record, for OpenAPI."""

PLANNED_RECORD_BODY: Final = _body(
    {"file": _FILE, "companion": _COMPANION, "trial": _TRIAL}, required=("file", "trial")
)
"""Request body of a flight record with the trial that it belongs to, for OpenAPI."""

FILE_BODY: Final = _body({"file": _FILE}, raw=(_ANY,))
"""Request body of one file of any kind, for OpenAPI."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A completely received record, and the transaction that may store it; `name` is its file name, empty if not
    given, and `fields` are the other fields of its form."""

    file: BinaryIO
    name: str
    companion: BinaryIO | None
    fields: Mapping[str, str]
    once: IdempotentRequest

    def content(self) -> bytes:
        """The whole file; its size is bounded by the limit on bodies."""
        self.file.seek(0)
        return self.file.read()

    def read_companion(self) -> bytes | None:
        """The whole companion file, if there is one."""
        if self.companion is None:
            return None
        self.companion.seek(0)
        return self.companion.read()

    def read_field(self, name: str, kind: type[M]) -> M:
        """A form field that holds JSON. Raises InputError when it does not, and RequestValidationError that names what
        is wrong in it."""
        try:
            return kind.model_validate(from_json(self.fields.get(name, "null")))
        except ValidationError as error:
            found = [{**each, "loc": ("body", name, *each["loc"])} for each in error.errors()]
            raise RequestValidationError(found) from error
        except ValueError as error:
            problem = Problem(name, f"is not JSON: {error}")
            raise InputError(
                f"The form field `{name}` is not JSON.", hint="Correct it.", problems=(problem,)
            ) from error


_Received = tuple[BinaryIO, str, BinaryIO | None, Mapping[str, str], str]
"""File, file name, companion file, the form's other fields, and the digest of all but the name."""


async def _upload(request: Request, database: CurrentDatabase, key: IdempotencyKey = None) -> AsyncIterator[Upload]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    arriving = _ARRIVING.get(kind)
    if arriving is None:
        raise MediaTypeError(
            f"A record of type {kind or 'unknown'} is not accepted here.",
            hint=f"Send the file as `Content-Type: {_ANY}`, or as the form field `file`.",
        )
    async with arriving(request) as (file, name, companion, fields, digest):
        once = _idempotent(request, database, key, f"{request.url.query} {digest}")
        yield Upload(file, name, companion, fields, once)


@asynccontextmanager
async def _raw(request: Request) -> AsyncIterator[_Received]:
    digest = hashlib.sha256()
    with tempfile.SpooledTemporaryFile(max_size=2**20) as spool:
        async for chunk in request.stream():
            digest.update(chunk)
            await run_in_threadpool(spool.write, chunk)
        yield spool, "", None, {}, digest.hexdigest()  # type: ignore[misc]  # it reads and seeks as BinaryIO does


@asynccontextmanager
async def _form(request: Request) -> AsyncIterator[_Received]:
    digest = hashlib.sha256()
    async with request.form(max_files=2, max_fields=4) as form:
        part, companion = _part(form, "file"), _part(form, "companion")
        if part is None:
            raise InputError(
                "The form contains no file.",
                hint="Send the record in the form field `file`.",
                problems=(Problem("file", "is missing"),),
            )
        for each in (part, companion):
            while each is not None and (chunk := await each.read(2**18)):
                digest.update(chunk)
        fields = {name: value for name, value in form.items() if isinstance(value, str)}
        digest.update(json.dumps(fields, sort_keys=True).encode())
        beside = None if companion is None else companion.file
        yield part.file, part.filename or "", beside, fields, digest.hexdigest()


def _part(form: FormData, name: str) -> UploadFile | None:
    part = form.get(name)
    return part if isinstance(part, UploadFile) else None


_ARRIVING: Final = {_CSV: _raw, "application/csv": _raw, _ANY: _raw, "multipart/form-data": _form}

Record = Annotated[Upload, Depends(_upload)]


def described(*types: str, binary: bool = True) -> dict[int | str, dict[str, Any]]:
    """Description of a response that is a file of one of these media types, for OpenAPI."""
    schema = {"type": "string", "format": "binary"} if binary else {"type": "string"}
    return {200: {"content": {each: {"schema": schema} for each in types}}}


def document_response(document: Document, name: str) -> Response:
    """Response with a document under its own content security policy, which allows only the file's own content."""
    headers = {"Content-Security-Policy": document.policy, "Content-Disposition": f'inline; filename="{name}"'}
    return Response(document.html, media_type="text/html", headers=headers)


def download(file: IO[bytes], name: str, *, media_type: str) -> StreamingResponse:
    """Response with the whole content of an open file, which is closed at the end.

    The file should have no name on the disk: then nothing is left of it, however the process ends. It is not compressed
    any more, because the content is already, and with a length the browser shows the progress. Pages of other sites
    cannot use it.
    """
    headers = {
        "Content-Disposition": f'attachment; filename="{name}"',
        "Content-Length": str(file.seek(0, 2)),
        "Content-Encoding": "identity",
        "Cross-Origin-Resource-Policy": "same-origin",
    }
    file.seek(0)
    return StreamingResponse(_chunks(file), media_type=media_type, headers=headers)


def _chunks(file: IO[bytes]) -> Iterator[bytes]:
    with file:
        while chunk := file.read(2**20):
            yield chunk
