"""Cursors: the position where a page ended, so that the next page begins there whatever was added or changed
meanwhile."""

import base64
import binascii
import json
from datetime import datetime
from typing import Final

from app.errors import InputError, Problem

Position = tuple[str | float, int]
"""The sort value of a page's last item, and its id, which decides among equal values."""
_LARGEST_ID: Final = 2**63 - 1


def encode_cursor(order: str, position: Position) -> str:
    """Encode a position as text for a URL; the sort order is included, because the position is valid only in that
    order."""
    return base64.urlsafe_b64encode(json.dumps([order, *position]).encode()).decode().rstrip("=")


def decode_cursor(order: str, text: str, kind: type[str] | type[float]) -> Position:
    """Decode a cursor. Raises InputError unless it is one of this order, with a sort value of this kind."""
    try:
        found = json.loads(base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True))
        said, value, identity = found
        value = kind(value) if isinstance(value, int | float | str) and not isinstance(value, bool) else None
    except (ValueError, TypeError, OverflowError, binascii.Error, RecursionError):
        raise _refused("is not a cursor of this list") from None
    if said != order:
        raise _refused("belongs to another order of the list")
    if value is None or type(identity) is not int or not 0 < identity <= _LARGEST_ID:
        raise _refused("is not a cursor of this list")
    return value, identity


def instant(text: str | float) -> datetime:
    """Convert a sort value to a time. Raises InputError when it is not one."""
    try:
        when = datetime.fromisoformat(str(text))
    except ValueError:
        raise _refused("is not a cursor of this list") from None
    if when.tzinfo is None:
        raise _refused("is not a cursor of this list")
    return when


def _refused(reason: str) -> InputError:
    return InputError(
        "This page cannot be found.",
        problems=(Problem("cursor", reason),),
        hint="Begin without a cursor, and pass on `next_cursor` unchanged.",
    )
