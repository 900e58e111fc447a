"""Connections and transactions: SQLite with a write-ahead log, one transaction per request or task, and a request that
is sent again is carried out once.

Writers begin with BEGIN IMMEDIATE. A transaction that starts as a reader and then writes can fail midway because
another connection wrote in between; one that takes the write lock first waits for it at its start instead.
"""

import sqlite3
import threading
from collections.abc import Callable, Iterator
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
        for reason, (happened, hint) in _TROUBLES.items():
            if reason in message:
                raise StorageError(happened.format(file=database_file), hint=hint.format(file=database_file)) from error
        raise


_DAMAGED: Final = (
    "The database {file} is damaged.",
    "Stop Gainline and restore the last backup; keep the damaged file, because most of it can be recovered.",
)
_TROUBLES: Final = {
    "is full": (
        "The disk that holds {file} is full; nothing from this request was stored.",
        "Free some disk space there, then try again. Everything stored before is intact.",
    ),
    "disk i/o error": (
        "The disk that holds {file} could not be written or read; nothing from this request was stored.",
        "Check its free space and its health, then try again.",
    ),
    "is locked": (
        "The database was busy for longer than five seconds; nothing from this request was stored.",
        "Try again. If it happens often, check for another program that has {file} open.",
    ),
    "readonly database": (
        "This user has no permission to write the database {file}; nothing from this request was stored.",
        "Give this user write permission for the file and its folder, then try again.",
    ),
    "unable to open": (
        "The database {file} cannot be opened.",
        "Check that its folder exists and that this user can write there.",
    ),
    "malformed": _DAMAGED,
    "no such table": _DAMAGED,
    "unsupported file format": _DAMAGED,
    "could not decode": _DAMAGED,
    "not a database": (
        "The file {file} is not a Gainline database.",
        "Choose another data folder (GAINLINE_DATA_DIR), or move this file away.",
    ),
}
