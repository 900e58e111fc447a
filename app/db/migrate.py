"""Bringing a database to the program's revision, and refusing one that is not there."""

from pathlib import Path
from typing import Final

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import text

from app.data_dir import prepare_data_dir
from app.db.session import open_engine, translated
from app.errors import SchemaError

_APP: Final = Path(__file__).resolve().parent.parent
_COMMAND: Final = "gainline serve"


def migrate(database_file: Path) -> None:
    """Create the database, or bring it up to date; nothing is changed when that fails.

    Raises SchemaError when it was written by a newer program, StorageError when it cannot be opened or written.
    """
    prepare_data_dir(database_file.parent)
    held = revision_of(database_file)
    if held == newest_revision():
        return
    if held is not None and held not in _known_revisions():
        raise _newer(database_file, held)
    engine = open_engine(database_file, foreign_keys=False)
    config = _config()
    try:
        with translated(database_file), engine.connect() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")
            broken = connection.execute(text("PRAGMA foreign_key_check")).first()
            if broken is not None:
                raise SchemaError(
                    f"After its migration {database_file} refers to rows that are gone ({broken}).",
                    hint="Restore the last backup and report this.",
                )
            connection.commit()
    finally:
        engine.dispose()


def require_current(database_file: Path) -> None:
    """Raises SchemaError, with the command to run, unless the database is at the program's revision."""
    held = revision_of(database_file) if database_file.exists() else None
    if held == newest_revision():
        return
    if held is not None and held not in _known_revisions():
        raise _newer(database_file, held)
    raise SchemaError(
        f"The database {database_file} is at revision {held or 'none'}, not {newest_revision()}.",
        hint=f"Run `{_COMMAND}`, which brings it up to date, or `alembic upgrade head` in a checkout.",
    )


def revision_of(database_file: Path) -> str | None:
    """The revision that the database is at; None for an empty one. Raises StorageError when it cannot be read."""
    engine = open_engine(database_file)
    try:
        with translated(database_file), engine.connect() as connection:
            return MigrationContext.configure(connection).get_current_revision()
    finally:
        engine.dispose()


def newest_revision() -> str:
    """The revision that this program works with."""
    revision = ScriptDirectory.from_config(_config()).get_current_head()
    assert revision is not None
    return revision


def _known_revisions() -> set[str]:
    return {script.revision for script in ScriptDirectory.from_config(_config()).walk_revisions()}


def _config() -> Config:
    """The migrations lie inside an installed package, and beside `app` in a checkout."""
    packaged = _APP / "migrations"
    config = Config()
    config.set_main_option("script_location", str(packaged if packaged.is_dir() else _APP.parent / "migrations"))
    config.set_main_option("path_separator", "os")
    return config


def _newer(database_file: Path, revision: str) -> SchemaError:
    return SchemaError(
        f"The database {database_file} was written by a newer Gainline (revision {revision}).",
        hint="Start that version, or choose another data folder with --data-dir.",
    )
