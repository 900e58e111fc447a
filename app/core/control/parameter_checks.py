"""The check that the parameters of a replica describe a loop."""

import math
from collections.abc import Collection, Mapping

from app.core.errors import InputError, Problem


def require_defined(values: Mapping[str, float], positive: Collection[str]) -> None:
    """Raise InputError naming every value that is negative or not finite, or is 0 although it must be positive."""
    problems = [
        Problem(name, "must be positive" if name in positive else "must be at least 0")
        for name, value in values.items()
        if not (0.0 <= value < math.inf) or (name in positive and not value)
    ]
    if problems:
        raise InputError(
            "The loop is not defined for these parameters.", hint="Give the vehicle's own.", problems=tuple(problems)
        )
