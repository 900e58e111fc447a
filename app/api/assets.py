"""The dashboard's scripts and styles: compressed once, then sent from memory.

Compressed and read in pieces for every request, the chart library alone kept the server busy for a tenth of a second,
just when a page asks for its figures.
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
"""More than a build has."""


class Assets(StaticFiles):
    """Files whose names carry a hash of their content, so that what was compressed stays true."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """The file, compressed for a client that takes it so; raises HTTPException 404 where there is none."""
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
