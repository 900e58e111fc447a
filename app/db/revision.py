"""The database revision that this program works with. Imports very little, because every start needs it."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Final

REVISION: Final = "0012"
"""Revision of the newest migration."""


def read_revision(database_file: Path) -> str | None:
    """The database's revision; None if it is empty or missing.

    Raises sqlite3.Error when the file, or the beginning of any of its tables, cannot be read.
    """
    if not database_file.exists():
        return None
    with closing(sqlite3.connect(f"{database_file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'alembic_version'").fetchall():
            return None
        for (table,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
            connection.execute(f'SELECT * FROM "{table}" LIMIT 1').fetchone()  # noqa: S608 - its own name
        held: tuple[str] | None = connection.execute("SELECT version_num FROM alembic_version").fetchone()
    return None if held is None else held[0]


def is_current(database_file: Path) -> bool:
    """Whether the database exists, can be read, and is at this revision. `app.db.migrate` handles all other cases."""
    try:
        return read_revision(database_file) == REVISION
    except sqlite3.Error:
        return False
