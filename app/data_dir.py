"""The data folder: made where it is missing, refused in words where it cannot be used."""

import errno
import os
from contextlib import suppress
from pathlib import Path

from app.errors import Problem, StorageError


def prepare_data_dir(folder: Path) -> None:
    """Make the data folder, or one inside it, and see that this user may write there.

    Raises StorageError naming the option when it cannot be used.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not os.access(folder, os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, "this user may not write there")
    except OSError as error:
        raise StorageError(
            f"The folder {folder} cannot be used for Gainline's data.",
            problems=(Problem("--data-dir", f"{error.strerror or error}"),),
            hint="Choose a folder that this user may write, with --data-dir or GAINLINE_DATA_DIR.",
        ) from error


def folder_bytes(folder: Path) -> int:
    """What the files below a folder hold; those that go meanwhile are not counted."""
    total = 0
    for path, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                total += os.lstat(Path(path) / name).st_size
    return total
