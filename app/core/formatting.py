"""Formatting of numbers in sentences: significant digits that match the uncertainty, and one form for shares."""

import math
from typing import Final, Literal

_MAX_DIGITS: Final = 6
_SHORT_DIGITS: Final = 4
_TWO_DIGITS_BELOW: Final = 3.55
"""An uncertainty with leading digits below this is given a second digit: 0.012 as 0.01 would lose too much."""


def decimals(uncertainty: float | None) -> int:
    """Number of decimals for an uncertainty of this size; three if it is not known."""
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0.0:
        return 3
    power = math.floor(math.log10(uncertainty))
    digits = 1 - power if uncertainty / 10.0**power < _TWO_DIGITS_BELOW else -power
    return min(_MAX_DIGITS, max(0, digits))


def plus_minus(value: float, standard_error: float, unit: str, *, sign: Literal["-", "+"] = "-") -> str:
    """`0.105 ± 0.012 m`, with as many digits as the uncertainty justifies; `sign="+"` always prints the sign."""
    digits = decimals(standard_error)
    return f"{value:{sign}.{digits}f} ± {standard_error:.{digits}f} {unit}"


def short(value: float | None) -> str:
    """An error without a stated uncertainty: three significant digits, at most four decimals; a dash for None."""
    if value is None:
        return "–"
    power = math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(_SHORT_DIGITS, max(0, 2 - power))}f}"


def percent(share: float, digits: int = 0) -> str:
    """`90 %`, with a non-breaking space."""
    return f"{100.0 * share:.{digits}f}\u00a0%"
