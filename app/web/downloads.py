"""Files that are made for one download."""

from collections.abc import Iterator
from typing import IO, Any, Final

from fastapi.responses import StreamingResponse

_CHUNK_BYTES: Final = 2**20


def described(*types: str, binary: bool = True) -> dict[int | str, dict[str, Any]]:
    """Description of a response that is a file of one of these media types, for OpenAPI."""
    schema = {"type": "string", "format": "binary"} if binary else {"type": "string"}
    return {200: {"content": {each: {"schema": schema} for each in types}}}


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
        while chunk := file.read(_CHUNK_BYTES):
            yield chunk
