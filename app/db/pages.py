"""Pages of a list: the rows that follow the position where the page before ended."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar

from sqlalchemy import ColumnElement, Select, String, func, literal, tuple_
from sqlalchemy.orm import Session

from app.common.schemas import Page, decode_cursor, encode_cursor, instant
from app.db.base import Reported
from app.db.types import UtcDateTime

R = TypeVar("R", bound=Reported)
V = TypeVar("V")


@dataclass(frozen=True, slots=True)
class Order:
    """Order of a list: its name in cursors, and the value by which its rows are sorted; ids decide among equals."""

    name: str
    value: ColumnElement[Any]
    descending: bool = False


def page_of(
    session: Session,
    wanted: Select[R],
    order: Order,
    *,
    cursor: str | None,
    limit: int,
    view: Callable[[Sequence[R]], list[V]],
) -> Page[V]:
    """One page of the `wanted` rows, as `view` shows them. Raises InputError for a cursor of another list."""
    total = session.scalar(wanted.with_only_columns(func.count(), maintain_column_froms=True)) or 0
    value, identity = order.value, wanted.selected_columns["id"]
    if cursor is not None:
        is_time = isinstance(value.type, UtcDateTime)
        at, after_id = decode_cursor(order.name, cursor, str if is_time or isinstance(value.type, String) else float)
        here = tuple_(value, identity)
        there = tuple_(literal(instant(at), UtcDateTime()) if is_time else literal(at), literal(after_id))
        wanted = wanted.where(here < there if order.descending else here > there)
    directed = (value.desc(), identity.desc()) if order.descending else (value, identity)
    found = session.execute(wanted.add_columns(value).order_by(*directed).limit(limit + 1)).all()
    rows = [row for row, _ in found[:limit]]
    following = None
    if len(found) > limit:
        last = found[limit - 1][1]
        following = encode_cursor(order.name, (last.isoformat() if isinstance(last, datetime) else last, rows[-1].id))
    return Page(items=view(rows), total=total, next_cursor=following)
