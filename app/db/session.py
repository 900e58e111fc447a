"""Connections and transactions: SQLite with a write-ahead log, one transaction per request or task, and a request that
is sent again is carried out once.

Writers begin with BEGIN IMMEDIATE. A transaction that starts as a reader and then writes can fail midway because
another connection wrote in between; one that takes the write lock first waits for it at its start instead.
"""

import sqlite3
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel
from pydantic_core import from_json
from sqlalchemy import URL, Connection, Engine, create_engine, delete, event, exc
from sqlalchemy.orm import Session, sessionmaker

from app.common.errors import KeyReusedError, Problem, StorageError
from app.core.clock import Clock
from app.db import outbox
from app.db.base import utc_now
from app.db.models import IdempotencyRow

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)

_BUSY_TIMEOUT_MS: Final = 5000
_BEGIN: Final = "gainline_begin"


def open_engine(database_file: Path, *, foreign_keys: bool = True) -> Engine:
    """An engine for a SQLite file; nothing is opened before the first statement.

    Without `foreign_keys` a migration can rebuild a table without deleting the rows that refer to it.
    """

    def prepare(connection: sqlite3.Connection, _entry: object) -> None:
        connection.isolation_level = None  # the "begin" event begins transactions, not the driver
        for pragma in (
            "journal_mode = WAL",
            "synchronous = FULL",  # the spool deletes a record once it is committed
            f"foreign_keys = {'ON' if foreign_keys else 'OFF'}",
            f"busy_timeout = {_BUSY_TIMEOUT_MS}",
        ):
            connection.execute(f"PRAGMA {pragma}")

    engine = create_engine(
        URL.create("sqlite+pysqlite", database=str(database_file)),
        connect_args={"check_same_thread": False},
        json_deserializer=_read_json,
        pool_size=8,
        max_overflow=40,
    )
    event.listen(engine, "connect", prepare)
    event.listen(engine, "begin", _on_begin)
    return engine


def _read_json(text: str | bytes) -> object:
    """Parse JSON by pydantic's parser, which takes a third of the time of `json` for the thousands of small curves of a
    page.

    Raises sqlite3.DatabaseError for malformed JSON, because the row held valid JSON when it was written.
    """
    try:
        return from_json(text)
    except ValueError as error:
        raise sqlite3.DatabaseError("a row holds malformed JSON") from error


def _on_begin(connection: Connection) -> None:
    connection.exec_driver_sql(f"BEGIN {connection.get_execution_options().get(_BEGIN, 'DEFERRED')}")


class Database:
    """The application's database. Thread-safe; every `read` and `write` is a transaction of its own."""

    def __init__(self, database_file: Path) -> None:
        self.file = database_file
        self.engine = open_engine(database_file)
        self._readers = sessionmaker(self.engine, expire_on_commit=False)
        self._writers = sessionmaker(self.engine.execution_options(**{_BEGIN: "IMMEDIATE"}), expire_on_commit=False)
        event.listen(self._writers, "after_flush", outbox.record_changes)

    @contextmanager
    def read(self) -> Iterator[Session]:
        """A consistent view of the database; changes made in it are discarded."""
        with translated(self.file), self._readers() as session:
            yield session

    @contextmanager
    def write(self) -> Iterator[Session]:
        """One transaction that holds the write lock: committed when the block ends, rolled back when it raises."""
        with translated(self.file), self._writers.begin() as session:
            yield session

    def close(self) -> None:
        self.engine.dispose()


KEPT_ANSWERS: Final = timedelta(days=7)


def carry_out_once(session: Session, key: str, fingerprint: str, answer: type[M], work: Callable[[Session], M]) -> M:
    """Call `work`, or return its stored answer for this key: the first answer to a request is stored in the transaction
    that carried it out.

    The session must hold the write lock, so that two requests with one key run one after another. Raises KeyReusedError
    when the key came with another request.
    """
    if (known := session.get(IdempotencyRow, key)) is not None:
        if known.fingerprint != fingerprint:
            raise KeyReusedError(
                f"The idempotency key {key!r} has already been used for another request.",
                hint="Use a new key for every operation, and the same key only to repeat an identical request.",
                problems=(Problem("Idempotency-Key", "belongs to another request"),),
            )
        return answer.model_validate_json(known.answer)
    session.execute(delete(IdempotencyRow).where(IdempotencyRow.created_at < utc_now() - KEPT_ANSWERS))
    result = work(session)
    session.add(IdempotencyRow(key=key, fingerprint=fingerprint, answer=result.model_dump_json()))
    return result


RETRY_S: Final = 1.0


def retry_until_stored(
    work: Callable[[], T], refused: Callable[[StorageError], object], *, closing: threading.Event, clock: Clock
) -> T | None:
    """Result of `work`, called until the database accepts it; None when `closing` is set before that.

    `refused` hears why it did not, each time. Whatever else `work` raises, this raises.
    """
    while True:
        try:
            return work()
        except StorageError as error:
            refused(error)
        if closing.wait(clock.wall_s(RETRY_S)):
            return None


@contextmanager
def translated(database_file: Path) -> Iterator[None]:
    """Raise StorageError for driver errors that a person can do something about; let the others pass."""
    try:
        yield
    except (exc.DBAPIError, sqlite3.Error) as error:
        message = str(error.orig if isinstance(error, exc.DBAPIError) else error).lower()
        for reason, texts in _TROUBLES.items():
            if reason in message:
                happened, hint = (texts[part].format(file=database_file) for part in ("happened", "hint"))
                raise StorageError(happened, hint=hint) from error
        raise


_TROUBLES: Final[Mapping[str, Mapping[str, str]]] = tomllib.loads(
    (Path(__file__).parent / "troubles.toml").read_text("utf-8")
)
"""What they mean and what to do, by a part of their messages."""
