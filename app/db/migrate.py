"""Migration of a database to the program's revision, and the refusal of one that is at another revision.

Alembic is imported only when there is something to migrate: at most starts the database is up to date.
"""

from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sqlalchemy import text

from app.common.data_folder import prepare_data_dir
from app.common.errors import SchemaError
from app.db.revision import REVISION, read_revision
from app.db.session import open_engine, translated

if TYPE_CHECKING:
    from alembic.config import Config
    from alembic.runtime.migration import MigrationInfo

_APP: Final = Path(__file__).resolve().parent.parent


def migrate(database_file: Path, announce: Callable[[str], None] = lambda _line: None) -> None:
    """Create the database, or migrate it to the program's revision; nothing is changed when that fails. `announce` gets
    a line at the beginning, and of a migration one after each revision.

    Raises SchemaError when it was written by a newer program, StorageError when it cannot be opened or written.
    """
    prepare_data_dir(database_file.parent)
    held = _known_revision_of(database_file)
    if held == REVISION:
        return
    from alembic import command

    known = _known_revisions()
    number, total = count(1), sum(each > (held or "") for each in known)
    announce("Creating the database" if held is None else f"Migrating the database from revision {held} to {REVISION}")

    def applied(step: "MigrationInfo", **_: object) -> None:
        announce(f"  {next(number)} of {total}: {known[step.up_revision_id or REVISION]}")

    engine = open_engine(database_file, foreign_keys=False)
    config = _config()
    try:
        with translated(database_file), engine.connect() as connection:
            config.attributes |= {"connection": connection, "on_version_apply": applied if held else None}
            command.upgrade(config, "head")
            broken = connection.execute(text("PRAGMA foreign_key_check")).first()
            if broken is not None:
                raise SchemaError(
                    f"After the migration, {database_file} refers to missing rows ({broken}).",
                    hint="Restore the last backup and report this.",
                )
            connection.commit()
    finally:
        engine.dispose()


def require_current(database_file: Path) -> None:
    """Raise SchemaError, with the command to run, unless the database is at the program's revision."""
    if (held := _known_revision_of(database_file)) != REVISION:
        raise SchemaError(
            f"The database {database_file} is at revision {held or 'none'}, not {REVISION}.",
            hint="Run `gainline serve` to migrate it, or `alembic upgrade head` in a checkout.",
        )


def revision_of(database_file: Path) -> str | None:
    """The database's revision; None for an empty one. Raises StorageError when it cannot be read."""
    with translated(database_file):
        return read_revision(database_file)


def _known_revisions() -> dict[str, str]:
    """What each migration brings, by revision."""
    from alembic.script import ScriptDirectory

    return {script.revision: script.doc for script in ScriptDirectory.from_config(_config()).walk_revisions()}


def _config() -> "Config":
    """Alembic's configuration; the migrations are inside an installed package, and beside `app` in a checkout."""
    from alembic.config import Config

    packaged = _APP / "migrations"
    config = Config()
    config.set_main_option("script_location", str(packaged if packaged.is_dir() else _APP.parent / "migrations"))
    config.set_main_option("path_separator", "os")
    return config


def _known_revision_of(database_file: Path) -> str | None:
    """The database's revision; None for an empty one. Raises SchemaError for one of a newer program."""
    held = revision_of(database_file)
    if held not in {None, REVISION} and held not in _known_revisions():
        raise SchemaError(
            f"The database {database_file} was written by a newer Gainline (revision {held}).",
            hint="Start that version, or choose another data folder with --data-dir.",
        )
    return held
