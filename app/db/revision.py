"""Which revision of the database this program works with. It imports next to nothing: every start asks."""

import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Final

REVISION: Final = "0004"
"""The newest of the migrations."""


def is_current(database_file: Path) -> bool:
    """Whether the database is there, can be read, and is at this revision. What else there may be is for
    `app.db.migrate` to tell."""
    try:
        with closing(sqlite3.connect(f"{database_file.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            held: object = connection.execute("SELECT version_num FROM alembic_version").fetchall()
    except sqlite3.Error:
        return False
    return held == [(REVISION,)]
