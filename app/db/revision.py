"""Which revision of the database this program works with. It imports next to nothing: every start asks."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Final

REVISION: Final = "0005"
"""The newest of the migrations."""


def read_revision(database_file: Path) -> str | None:
    """The revision that the database is at; None for an empty one, or none. Raises sqlite3.Error when it, or the
    beginning of any of its tables, cannot be read."""
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
    """Whether the database is there, can be read, and is at this revision. What else there may be is for
    `app.db.migrate` to tell."""
    try:
        return read_revision(database_file) == REVISION
    except sqlite3.Error:
        return False
