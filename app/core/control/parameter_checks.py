"""Checks that the parameters of a replica describe a loop."""

from collections.abc import Collection, Iterable, Mapping
from typing import Final

from app.core.errors import InputError, Problem

_LARGEST: Final = 1e6
"""No parameter of a loop comes near it; far beyond it, the replica's numbers overflow."""


def require_defined(values: Mapping[str, float], positive: Collection[str]) -> None:
    """Raise InputError naming every value that is negative, above 1e6 or not a number, or is 0 although it must be
    positive."""
    _require(
        Problem(name, f"must be {'positive' if name in positive else 'at least 0'} and at most {_LARGEST:g}")
        for name, value in values.items()
        if not (0.0 <= value <= _LARGEST) or (name in positive and not value)
    )


def require_within(values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> None:
    """Raise InputError naming every value outside its range or not a number; those missing are not checked."""
    _require(
        Problem(name, f"must be {low:g} to {high:g}, got {values[name]:g}")
        for name, (low, high) in ranges.items()
        if name in values and not (low <= values[name] <= high)
    )


def _require(found: Iterable[Problem]) -> None:
    if problems := tuple(found):
        raise InputError(
            "The loop is not defined for these parameters.", hint="Give the vehicle's own.", problems=problems
        )
