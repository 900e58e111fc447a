"""A consistent copy of the database, taken while other connections read and write."""

import fcntl
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final

from app.common.errors import StorageError
from app.db.session import translated

_PREFIX: Final = ".gainline-partial-copy-"
"""Of folders that are deleted; nobody names a folder of their own like that."""
SPARE_BYTES: Final = 2**28
"""Disk space that a copy must leave free for flights that take place meanwhile."""


def take_backup(database_file: Path, require_intact: Callable[[Path], None]) -> BinaryIO:
    """Copy the database to an open file without a name, so that nothing is left once it is closed.

    The copy is verified first: by SQLite's own check, and by `require_intact`, which raises StorageError for damaged
    content. It holds the state of one moment: the write-ahead log lets writers continue, and what they commit is not in
    it. While it is made it is stored beside the database and needs as much space. Raises StorageError, before anything
    is written, when there is too little space.
    """
    discard_partial_copies(database_file.parent)
    _require_room(database_file)
    with (
        translated(database_file),
        _locked(database_file.parent, fcntl.LOCK_SH),
        tempfile.TemporaryDirectory(prefix=_PREFIX, dir=database_file.parent) as folder,
    ):
        copied = Path(folder) / "gainline.sqlite3"
        with closing(sqlite3.connect(database_file)) as source, closing(sqlite3.connect(copied)) as copy:
            copy.execute("PRAGMA synchronous = OFF")  # after a power cut the copy is worthless anyway
            source.backup(copy)
            _require_sound(copy)
        require_intact(copied)
        with closing(sqlite3.connect(copied)) as copy:
            copy.execute("PRAGMA journal_mode = DELETE")  # one file, readable without -wal beside it
        return copied.open("rb")


def discard_partial_copies(folder: Path) -> None:
    """Delete the copies in a database's folder whose process was killed while it made them; none while another process
    is making one."""
    with suppress(BlockingIOError), _locked(folder, fcntl.LOCK_EX | fcntl.LOCK_NB):
        for left in folder.glob(f"{_PREFIX}*"):
            shutil.rmtree(left, ignore_errors=True)


@contextmanager
def _locked(folder: Path, kind: int) -> Iterator[None]:
    """Hold a lock of the folder itself, which ends with its process, however that ends."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, kind)
        yield
    finally:
        os.close(descriptor)


def _require_sound(copy: sqlite3.Connection) -> None:
    (found,) = copy.execute("PRAGMA quick_check(1)").fetchone()
    if found != "ok":
        raise StorageError(
            f"The backup was not created: the database is damaged ({found}).",
            hint="Stop Gainline, keep a copy of gainline.sqlite3, most of which can be recovered, and restore the last "
            "backup.",
        )


def _require_room(database_file: Path) -> None:
    needed, free = database_bytes(database_file) + SPARE_BYTES, shutil.disk_usage(database_file.parent).free
    if free < needed:
        raise StorageError(
            f"There is too little disk space for a copy: {free / 1e9:.1f} GB are free, and {needed / 1e9:.1f} GB are "
            "needed so that flights can still be stored.",
            hint="Free some disk space; or stop Gainline, and copy gainline.sqlite3 to another disk.",
        )


def database_bytes(database_file: Path) -> int:
    """Size of a copy made now, including the content of the write-ahead log. Raises StorageError."""
    with translated(database_file), closing(sqlite3.connect(database_file)) as source:
        (pages,), (page_bytes,) = (source.execute(f"PRAGMA {of}").fetchone() for of in ("page_count", "page_size"))
    return int(pages) * int(page_bytes)
