"""Common parts of the slices' request and response schemas."""

from typing import Annotated, Generic, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StringConstraints
from pydantic_core import PydanticCustomError

from app.core.control_characters import find_control_characters

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
            "control_character", "must not hold control characters ({found})", {"found": ", ".join(found)}
        )
    return name


Shown = AfterValidator(_shown_as_it_is)
Name = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=120), Shown]
Reason = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1, max_length=500)]
Version = Annotated[int, Field(ge=1, strict=True, description="the version that was edited, as last read")]


class Request(BaseModel):
    """A request body; unknown fields are errors."""

    model_config = ConfigDict(extra="forbid", json_schema_serialization_defaults_required=True)


class ProblemField(BaseModel):
    """One refused field, dotted as the caller wrote it, and why it was refused; `offer` holds gain values that would
    pass, by name, where any are known."""

    field: str
    reason: str
    offer: Gains = {}


class Problem(BaseModel):
    """An error (RFC 9457): what happened, what to do about it, and the fields concerned."""

    type: str
    title: str
    status: int
    detail: str
    hint: str
    problems: list[ProblemField]


class Trouble(BaseModel):
    """Why something is not available at present, and what to do about it."""

    title: str
    detail: str
    hint: str


class Page(BaseModel, Generic[T]):
    """A part of a list. `next_cursor` requests the part after it; null at the end. `total` counts the whole list."""

    items: list[T]
    total: int
    next_cursor: str | None


class Interval(BaseModel):
    """Interval that contains an error with probability `confidence`."""

    lower: float
    upper: float
    confidence: float


class Check(BaseModel):
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


class Gate(BaseModel):
    """The gate's result for a gain set before its flight."""

    passed: bool
    checks: list[Check]
