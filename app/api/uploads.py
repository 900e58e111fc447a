"""Uploaded flight records: spooled while they arrive, limited by the application's limit on bodies."""

import hashlib
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Annotated, BinaryIO, Final

from fastapi import Depends, Request
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import FormData, UploadFile

from app.api.deps import CurrentDatabase, IdempotencyKey, IdempotentRequest, fingerprint
from app.common.errors import InputError, MediaTypeError, Problem

_IN_MEMORY_BYTES: Final = 2**20
_CHUNK_BYTES: Final = 2**18
_CSV: Final = "text/csv"
_ANY: Final = "application/octet-stream"

_BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
REQUEST_BODY: Final = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {
                        "file": {"type": "string", "format": "binary"},
                        "companion": {
                            "type": "string",
                            "format": "binary",
                            "description": "the .log file that Paparazzi writes beside a .data file",
                        },
                    },
                }
            },
            _CSV: _BINARY,
            _ANY: _BINARY,
        },
    }
}
"""Request body of a flight record, for OpenAPI."""

FILE_BODY: Final = {
    "requestBody": {
        "required": True,
        "content": {
            "multipart/form-data": {
                "schema": {"type": "object", "required": ["file"], "properties": {"file": _BINARY["schema"]}}
            },
            _ANY: _BINARY,
        },
    }
}
"""Request body of one file of any kind, for OpenAPI."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A completely received record, and the transaction that may store it; `name` is its file name, empty if not
    given."""

    file: BinaryIO
    name: str
    companion: BinaryIO | None
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


@dataclass(frozen=True, slots=True)
class _ReceivedUpload:
    file: BinaryIO
    name: str
    companion: BinaryIO | None
    digest: str


async def _upload(request: Request, database: CurrentDatabase, key: IdempotencyKey = None) -> AsyncIterator[Upload]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    arriving = _ARRIVING.get(kind)
    if arriving is None:
        raise MediaTypeError(
            f"A record of type {kind or 'that is not stated'} is not read here.",
            hint=f"Send the file as `Content-Type: {_ANY}`, or as the form field `file`.",
        )
    async with arriving(request) as arrived:
        once = IdempotentRequest(database, key, fingerprint(request, f"{request.url.query} {arrived.digest}"))
        yield Upload(arrived.file, arrived.name, arrived.companion, once)


@asynccontextmanager
async def _raw(request: Request) -> AsyncIterator[_ReceivedUpload]:
    digest = hashlib.sha256()
    with tempfile.SpooledTemporaryFile(_IN_MEMORY_BYTES) as spool:
        async for chunk in request.stream():
            digest.update(chunk)
            await run_in_threadpool(spool.write, chunk)
        yield _ReceivedUpload(spool, "", None, digest.hexdigest())  # type: ignore[arg-type]  # it reads and seeks as BinaryIO does


@asynccontextmanager
async def _form(request: Request) -> AsyncIterator[_ReceivedUpload]:
    digest = hashlib.sha256()
    async with request.form(max_files=2, max_fields=4) as form:
        part, companion = _part(form, "file"), _part(form, "companion")
        if part is None:
            raise InputError(
                "The form holds no file.",
                hint="Send the record in the form field `file`.",
                problems=(Problem("file", "is missing"),),
            )
        for each in (part, companion):
            while each is not None and (chunk := await each.read(_CHUNK_BYTES)):
                digest.update(chunk)
        beside = None if companion is None else companion.file
        yield _ReceivedUpload(part.file, part.filename or "", beside, digest.hexdigest())


def _part(form: FormData, name: str) -> UploadFile | None:
    part = form.get(name)
    return part if isinstance(part, UploadFile) else None


_ARRIVING: Final = {_CSV: _raw, "application/csv": _raw, _ANY: _raw, "multipart/form-data": _form}

Record = Annotated[Upload, Depends(_upload)]
