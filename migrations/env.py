"""Alembic's way to the database: the connection it is handed, else the one of the settings."""

from typing import Literal

from alembic import context
from sqlalchemy import Connection, Enum

from app.common.settings import Settings
from app.db.base import Base, FlightEndJson, UtcDateTime
from app.db.session import open_engine


def run_migrations(connection: Connection) -> None:
    """All in one transaction; SQLite changes tables by rebuilding them, hence batch mode."""
    context.configure(
        connection=connection,
        target_metadata=Base.metadata,
        render_as_batch=True,
        render_item=in_plain,
        on_version_apply=context.config.attributes.get("on_version_apply"),
    )
    with context.begin_transaction():
        context.run_migrations()


def in_plain(kind: str, item: object, _autogen: object) -> str | Literal[False]:
    """Types of our own written as plain ones, so that an old migration does not depend on today's code."""
    if kind != "type":
        return False
    if isinstance(item, UtcDateTime):
        return "sa.DateTime()"
    if isinstance(item, FlightEndJson):
        return "sa.JSON(none_as_null=True)"
    return f"sa.String({item.length})" if isinstance(item, Enum) else False


def main() -> None:
    handed = context.config.attributes.get("connection")
    if isinstance(handed, Connection):
        run_migrations(handed)
        return
    settings = Settings()
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    with open_engine(settings.database_file, foreign_keys=False).connect() as connection:
        run_migrations(connection)
        connection.commit()


main()
