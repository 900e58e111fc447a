"""What the schemas of several slices share: checked names and numbers, pages, problems.

A name must not contain control characters: they can rewrite a terminal's lines, or reverse text so that one name looks
like another.
"""

import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Annotated, Final, Generic, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints
from pydantic_core import PydanticCustomError

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
    pass, by name, where any are known. `code` is for programs: of a record, the reason or the value of the field that
    would pass; of a log, the reason, with its numbers and what else it names. Empty where there is none."""

    field: str
    reason: str
    offer: Gains = {}
    code: str = ""
    numbers: Mapping[str, float] = {}
    named: Sequence[str] = ()


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
