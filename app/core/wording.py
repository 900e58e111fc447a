"""Numbers in sentences: no more digits than a measurement carries, and one form for a share."""

import math
from typing import Final, Literal

_MAX_DIGITS: Final = 6
_SHORT_DIGITS: Final = 4
_TWO_DIGITS_BELOW: Final = 3.55
"""An uncertainty that begins with less carries a second digit: rounding 0.012 to 0.01 would cost too much."""


def decimals(uncertainty: float | None) -> int:
    """Digits after the point that an uncertainty of this size allows; three where it is not known."""
    if uncertainty is None or not math.isfinite(uncertainty) or uncertainty <= 0.0:
        return 3
    power = math.floor(math.log10(uncertainty))
    digits = 1 - power if uncertainty / 10.0**power < _TWO_DIGITS_BELOW else -power
    return min(_MAX_DIGITS, max(0, digits))


def plus_minus(value: float, standard_error: float, unit: str, *, sign: Literal["-", "+"] = "-") -> str:
    """`0.105 ± 0.012 m`, in as many digits as the uncertainty allows; `+` as the sign is printed always."""
    digits = decimals(standard_error)
    return f"{value:{sign}.{digits}f} ± {standard_error:.{digits}f} {unit}"


def short(value: float | None) -> str:
    """Of an error whose uncertainty is not told: three significant digits, at most four after the point; a dash for
    none."""
    if value is None:
        return "–"
    power = math.floor(math.log10(abs(value))) if value else 0
    return f"{value:.{min(_SHORT_DIGITS, max(0, 2 - power))}f}"


def percent(share: float, digits: int = 0) -> str:
    """`90 %`, held together by a space that does not break."""
    return f"{100.0 * share:.{digits}f}\u00a0%"
