"""Pages of a list: the rows that follow the position where the page before ended.

A cursor is that position, so that the next page begins there whatever was added or changed meanwhile.
"""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, TypeVar

from pydantic import AwareDatetime, Field, TypeAdapter
from pydantic_core import to_json
from sqlalchemy import ColumnElement, Row, Select, String, func, literal, tuple_
from sqlalchemy.orm import Session

from app.common.errors import InputError, Problem
from app.common.schemas import Number, Page
from app.db.base import Numbered, UtcDateTime

R = TypeVar("R", bound=Numbered | Row[Any])
V = TypeVar("V")


@dataclass(frozen=True, slots=True)
class Part:
    """Which part of a list is wanted: at most `limit` rows after a `cursor`, else from the beginning."""

    limit: int
    cursor: str | None = None


@cache
def _cursor_of(kind: Any) -> TypeAdapter[tuple[str, Any, int]]:
    """Reader of cursors of an order by values of this kind."""
    return TypeAdapter(tuple[str, kind, Annotated[int, Field(gt=0, le=2**63 - 1)]])


@dataclass(frozen=True, slots=True)
class Order:
    """Order of a list: its name in cursors, and the value by which its rows are sorted; ids decide among equals."""

    name: str
    value: ColumnElement[Any]
    descending: bool = False

    def cursor_at(self, value: object, identity: int) -> str:
        """The position after the row with this value and id, as text for a URL, with the order, in which alone it is
        valid."""
        return base64.urlsafe_b64encode(to_json([self.name, value, identity])).decode().rstrip("=")

    def position_of(self, cursor: str) -> tuple[Any, int]:
        """The value and id of a cursor. Raises InputError unless it is one of this order."""
        is_time, is_text = isinstance(self.value.type, UtcDateTime), isinstance(self.value.type, String)
        kind: Any = AwareDatetime if is_time else str if is_text else Number
        try:
            packed = base64.b64decode(cursor + "=" * (-len(cursor) % 4), altchars=b"-_", validate=True)
            order, _, identity = _cursor_of(Any).validate_json(packed, strict=True)
            if order == self.name:
                return _cursor_of(kind).validate_json(packed, strict=True)[1], identity
        except ValueError:
            raise _refused("is not a cursor of this list") from None
        raise _refused("belongs to a different sort order of the list")


def _refused(reason: str) -> InputError:
    return InputError(
        "There is no such page of the list.",
        problems=(Problem("cursor", reason),),
        hint="Start without a cursor, and send `next_cursor` unchanged.",
    )


def page_of(
    session: Session, wanted: Select[R], order: Order, part: Part, view: Callable[[Sequence[R]], list[V]]
) -> Page[V]:
    """One page of the `wanted` rows, as `view` shows them. Raises InputError for a cursor of another list."""
    total = session.scalar(wanted.with_only_columns(func.count(), maintain_column_froms=True)) or 0
    value, identity = order.value, wanted.selected_columns["id"]
    if part.cursor is not None:
        at, after_id = order.position_of(part.cursor)
        here, there = tuple_(value, identity), tuple_(literal(at, value.type), literal(after_id))
        wanted = wanted.where(here < there if order.descending else here > there)
    directed = (value.desc(), identity.desc()) if order.descending else (value, identity)
    found = session.execute(wanted.add_columns(value).order_by(*directed).limit(part.limit + 1)).all()
    rows = [row for row, _ in found[: part.limit]]
    following = order.cursor_at(found[part.limit - 1][1], rows[-1].id) if len(found) > part.limit else None
    return Page(items=view(rows), total=total, next_cursor=following)
