"""Checks that the parameters of a replica describe a loop."""

import math
from collections.abc import Collection, Iterable, Mapping
from typing import Final

from app.core.errors import InputError, Problem

PLAUSIBLE: Final = (0.0, 1e6)
"""No parameter of a vehicle's loop comes near the upper end; far beyond it, the replica's numbers overflow."""


def require_defined(values: Mapping[str, float], positive: Collection[str], names: Mapping[str, str]) -> None:
    """Raise InputError naming every value that is negative or not finite, or is 0 although it must be positive, by the
    `names` of the fields."""
    _require(
        Problem(names[field], "must be positive" if field in positive else "must be at least 0")
        for field, value in values.items()
        if not (0.0 <= value < math.inf) or (field in positive and not value)
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
