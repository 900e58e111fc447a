"""Flight records sent to us: set aside while they arrive, bounded by the application's limit on a body."""

import hashlib
import tempfile
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated, BinaryIO, Final

from fastapi import Depends, Request
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile

from app.api.deps import CurrentDatabase, IdempotencyKey, Once, fingerprint
from app.errors import InputError, MediaTypeError, Problem

_IN_MEMORY_BYTES: Final = 2**20
_CHUNK_BYTES: Final = 2**18
_RAW: Final = frozenset({"text/csv", "application/csv", "application/octet-stream"})

REQUEST_BODY: Final = {
    "requestBody": {
        "required": True,
        "content": {
            "text/csv": {"schema": {"type": "string", "format": "binary"}},
            "multipart/form-data": {
                "schema": {
                    "type": "object",
                    "required": ["file"],
                    "properties": {"file": {"type": "string", "format": "binary"}},
                }
            },
        },
    }
}
"""For OpenAPI."""


@dataclass(frozen=True, slots=True)
class Upload:
    """A record that has arrived completely, and the transaction that may store it."""

    file: BinaryIO
    once: Once


async def _upload(request: Request, database: CurrentDatabase, key: IdempotencyKey = None) -> AsyncIterator[Upload]:
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    with tempfile.SpooledTemporaryFile(_IN_MEMORY_BYTES) as spool:
        digest = hashlib.sha256()
        async for chunk in _chunks(request, kind):
            digest.update(chunk)
            await run_in_threadpool(spool.write, chunk)
        spool.seek(0)
        yield Upload(spool, Once(database, key, fingerprint(request, digest.hexdigest())))  # type: ignore[arg-type]


async def _chunks(request: Request, kind: str) -> AsyncIterator[bytes]:
    if kind in _RAW:
        async for chunk in request.stream():
            yield chunk
        return
    if kind != "multipart/form-data":
        raise MediaTypeError(
            f"A record of type {kind or 'that is not stated'} is not read here.",
            hint="Send the file as `Content-Type: text/csv`, or as the form field `file`.",
        )
    async with request.form(max_files=1, max_fields=4) as form:
        part = form.get("file")
        if not isinstance(part, UploadFile):
            raise InputError(
                "The form holds no file.",
                hint="Send the record in the form field `file`.",
                problems=(Problem("file", "is missing"),),
            )
        while chunk := await part.read(_CHUNK_BYTES):
            yield chunk


Record = Annotated[Upload, Depends(_upload)]
