"""What the schemas and pages of several slices share: checked names and numbers, pages and their cursors.

A name must not contain control characters: they can rewrite a terminal's lines, or reverse text so that one name looks
like another. A cursor is the position where a page ended, so that the next page begins there whatever was added or
changed meanwhile.
"""

import base64
import binascii
import json
import unicodedata
from datetime import datetime
from pathlib import PurePath
from typing import Annotated, Final, Generic, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints
from pydantic_core import PydanticCustomError

from app.common.errors import InputError
from app.common.errors import Problem as FieldProblem

_REORDERING: Final = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069\u2028\u2029")
"""Marks, embeddings, overrides and isolates (Unicode Standard Annex 9), and separators of lines and paragraphs."""


def is_control(character: str) -> bool:
    """Whether the character is in C0 or C1 (escape included), DEL, a bidirectional control or a line separator."""
    return unicodedata.category(character) == "Cc" or character in _REORDERING


def find_control_characters(text: str) -> tuple[str, ...]:
    """Control characters in a text, as `U+001B`, each once and in code point order."""
    return tuple(f"U+{ord(each):04X}" for each in sorted(set(filter(is_control, text))))


def without_control_characters(text: str) -> str:
    return "".join(each for each in text if not is_control(each))


def uploaded_name(name: str, *, unnamed: str) -> str:
    """Name of an uploaded file: shortened, without folders and control characters; `unnamed` if nothing is left."""
    return without_control_characters(PurePath(name.replace("\\", "/")).name).strip()[:LONGEST_NAME] or unnamed


T = TypeVar("T")

OptionValue = bool | int | float | str
"""A setting of a strategy or vehicle; its type is checked by the setting."""

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A finite JSON number: no numeric text, no NaN, no infinity."""

Gains = dict[str, int | float]
"""Gains by name; whole numbers where the controller takes counts."""

Text = Annotated[str, Field(max_length=2000)]


def _shown_as_it_is(name: str) -> str:
    """Return the name unless it holds control characters, which move a terminal's cursor or reverse text."""
    if found := find_control_characters(name):
        raise PydanticCustomError(
            "control_character", "must not contain control characters ({found})", {"found": ", ".join(found)}
        )
    return name


Shown = AfterValidator(_shown_as_it_is)
LONGEST_NAME: Final = 120
Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=LONGEST_NAME), Shown]
Reason = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=500)]
Version = Annotated[int, Field(ge=1, strict=True, description="the version on which the edit is based, as last read")]


class Schema(BaseModel):
    """A part of the API; pydantic builds its validation when it is first needed, not as the program starts. What the
    program sends has every field."""

    model_config = ConfigDict(defer_build=True, json_schema_serialization_defaults_required=True)

    @classmethod
    def view_of(cls, source: object, **fields: object) -> Self:
        """The part with these fields, and all others from the attributes of `source` with the same names.

        Raises AttributeError for a field that `source` does not have.
        """
        own = {name: getattr(source, name) for name in cls.model_fields.keys() - fields.keys()}
        return cls.model_validate(own | fields, from_attributes=True)


class Request(Schema):
    """A request body; unknown fields are errors. Built at once: of a deferred body, pydantic warns about its alias."""

    model_config = ConfigDict(defer_build=False, extra="forbid")


class ProblemField(Schema):
    """One refused field, dotted as the caller wrote it, and why it was refused; `offer` holds gain values that would
    pass, by name, where any are known."""

    field: str
    reason: str
    offer: Gains = {}


class Problem(Schema):
    """An error (RFC 9457): what happened, what to do about it, and the fields concerned. `script_hint` is what a script
    does about it, where that differs from what a person does; empty otherwise."""

    type: str
    title: str
    status: int
    detail: str
    hint: str
    script_hint: str = ""
    problems: list[ProblemField]


class Trouble(Schema):
    """Why something is not available at present, and what to do about it."""

    title: str
    detail: str
    hint: str


class Page(Schema, Generic[T]):
    """A part of a list. `next_cursor` requests the part after it; null at the end. `total` counts the whole list."""

    items: list[T]
    total: int
    next_cursor: str | None


class Check(Schema):
    """One check of the gate: its worst number and the limit, where it has them, and the gain and the case that gave it.
    `offer` holds the nearest values of refused gains that would pass."""

    name: str
    passed: bool
    sentence: str
    worst: float | None
    limit: float | None
    gain: str = ""
    case: str = ""
    offer: Gains = {}


class Gate(Schema):
    """The gate's result for a gain set before its flight."""

    passed: bool
    checks: list[Check]


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
        cursor_order, value, identity = found
        value = kind(value) if isinstance(value, int | float | str) and not isinstance(value, bool) else None
    except (ValueError, TypeError, OverflowError, binascii.Error, RecursionError):
        raise _refused("is not a cursor of this list") from None
    if cursor_order != order:
        raise _refused("belongs to a different sort order of the list")
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
        "There is no such page of the list.",
        problems=(FieldProblem("cursor", reason),),
        hint="Start without a cursor, and send `next_cursor` unchanged.",
    )
