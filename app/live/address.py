"""Address of the worker's socket: a file in the data folder, or in a short private folder when that path is too
long."""

import hashlib
import os
import stat
import tempfile
from pathlib import Path
from typing import Final

from app.core.errors import InputError

LONGEST_PATH_BYTES: Final = 100
"""Below the 104 bytes of macOS and the 108 of Linux (sockaddr_un)."""


def live_address(data_dir: Path) -> Path:
    """The socket's path for this data folder; the same in every process that uses the folder."""
    path = data_dir.resolve() / "worker.sock"
    if len(os.fsencode(path)) <= LONGEST_PATH_BYTES:
        return path
    name = hashlib.sha256(os.fsencode(path)).hexdigest()[:16]
    return _private_folder() / f"{name}.sock"


def _private_folder() -> Path:
    """A folder of this user under the system's temporary folder. Raises InputError when it is not private to this
    user."""
    folder = Path(tempfile.gettempdir()) / f"gainline-{os.getuid()}"
    if len(os.fsencode(folder)) > LONGEST_PATH_BYTES - len("/0123456789abcdef.sock"):
        folder = Path("/tmp") / folder.name  # noqa: S108 - made private and checked below
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or stat.S_IMODE(status.st_mode) & 0o077:
        raise InputError(
            f"{folder} is not a private folder of this user, so the worker cannot listen there.",
            hint="Remove it, or choose a data folder with a shorter path (--data-dir).",
        )
    return folder
