"""Why the schema of a request refuses a value, in the words of the application's own refusals."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, get_args

from pydantic import BaseModel

_SHOWN: Final = 40
"""Longest text of a refused value that is repeated."""

_REASONS: Final[Mapping[str, str]] = {
    "missing": "is missing",
    "extra_forbidden": "is not a known field",
    "greater_than_equal": "must be at least {ge}",
    "greater_than": "must be above {gt}",
    "less_than_equal": "must be at most {le}",
    "less_than": "must be below {lt}",
    "string_too_short": "must have at least {min_length} characters",
    "string_too_long": "must have at most {max_length} characters",
    "literal_error": "must be {expected}",
    "enum": "must be {expected}",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "int_parsing": "must be a whole number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "finite_number": "must be a finite number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be text",
    "dict_type": "must be an object",
    "model_type": "must be an object with fields",
    "model_attributes_type": "must be an object with fields",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
}
"""By the validator's type of error, with its limits."""

_ABOUT_FIELDS: Final = frozenset({"extra_forbidden", "model_type", "model_attributes_type"})
_QUOTED: Final = frozenset(name for name in _REASONS if name not in {"missing", "extra_forbidden"}) - {
    "string_too_short",
    "string_too_long",
}


def reason_of(found: Mapping[str, Any], schema: object = None) -> str:
    """The reason of one of the validator's errors, with the refused value where it is a short one; a type of error that
    has no words here keeps the validator's message.

    With the body's `schema`, fields that do not exist and values that should be objects are refused with the fields
    that there are.
    """
    kind, limits, value = found["type"], found.get("ctx", {}), found.get("input")
    if fields := _fields_at(schema, [part for part in found["loc"] if part != "body"], kind):
        return f"{_REASONS[kind]} ({', '.join(fields)})"
    if kind == "string_too_short" and limits["min_length"] == 1:
        return "must not be empty"
    if kind not in _REASONS:
        text: str = found["msg"]
        return text[:1].lower() + text[1:]
    written = {name: f"{limit:g}" if isinstance(limit, float) else limit for name, limit in limits.items()}
    reason = _REASONS[kind].format_map(written)
    return f"{reason}, got {_written(value)}" if kind in _QUOTED and _is_short(value) else reason


def _fields_at(schema: object, path: Sequence[object], kind: str) -> tuple[str, ...]:
    """Names of the fields known where the error is; none for errors of another type, and in a free mapping."""
    if kind not in _ABOUT_FIELDS:
        return ()
    for name in path[:-1] if kind == "extra_forbidden" else path:
        model = _model_in(schema)
        if model is None or name not in model.model_fields:
            return ()
        schema = model.model_fields[str(name)].annotation
    model = _model_in(schema)
    return () if model is None else tuple(model.model_fields)


def _model_in(schema: object) -> type[BaseModel] | None:
    """The model itself, or the one in a union with None."""
    if isinstance(schema, type) and issubclass(schema, BaseModel):
        return schema
    return next((model for part in get_args(schema) if (model := _model_in(part)) is not None), None)


def _is_short(value: object) -> bool:
    return isinstance(value, bool | int | float | str) and len(str(value)) <= _SHOWN


def _written(value: object) -> str:
    """A value as JSON has it."""
    return str(value).lower() if isinstance(value, bool) else f"{value!r}"
