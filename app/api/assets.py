"""The dashboard's scripts and styles, compressed once and then sent from memory.

When they were read and compressed for every request, the chart library alone kept the server busy for 0.1 s, just when
a page requests its figures.
"""

import gzip
from functools import lru_cache
from pathlib import Path
from typing import Final

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_FILES: Final = 64
"""More files than a build has."""


class Assets(StaticFiles):
    """Static files whose names contain a hash of their content, so that the cached compressed data stays valid."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, compressed if the client accepts gzip; raises HTTPException 404 when there is none."""
        answer = await super().get_response(path, scope)
        asked = Headers(scope=scope)
        whole = scope["method"] == "GET" and "range" not in asked
        if not isinstance(answer, FileResponse) or not whole or "gzip" not in asked.get("accept-encoding", ""):
            return answer
        body = await run_in_threadpool(_compressed, Path(answer.path))
        headers = {"Content-Encoding": "gzip", "Vary": "Accept-Encoding", "ETag": answer.headers["etag"]}
        return Response(body, media_type=answer.media_type, headers=headers)


@lru_cache(maxsize=_FILES)
def _compressed(file: Path) -> bytes:
    return gzip.compress(file.read_bytes(), mtime=0)
