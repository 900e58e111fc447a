"""Numbers in sentences, tables and figures: significant digits that match the uncertainty, and one form for gains,
shares and amounts, with a true minus sign.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Final, Literal

NOTHING: Final = "–"
NEGLIGIBLE: Final = 1e-9
"""An error that is no basis of a comparison: records, in single precision, resolve less."""

GAIN_DIGITS: Final = 4
EXACT_DIGITS: Final = 7
"""Digits of a gain that is compared with another: those of a single-precision number."""
_MAX_DIGITS: Final = 6
_SHORT_DECIMALS: Final = 3
_MORE_DIGITS_BELOW: Final = 0.0095
"""An error below this would have a single digit with three decimals."""
_LISTED_RUNS: Final = 5
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
    """`0.105 ± 0.012 m`, with as many digits as the uncertainty justifies; `sign="+"` always prints the sign. The unit
    of a dimensionless quantity is empty."""
    digits = decimals(standard_error)
    return _true_minus(f"{value:{sign}z.{digits}f} ± {standard_error:.{digits}f} {unit}".rstrip())


def short(value: float | None) -> str:
    """An error without a stated uncertainty, as on the pages; a dash for None."""
    return NOTHING if value is None else number(value, error_digits(value))


def error_digits(*errors: float) -> int:
    """Decimals of an error: three, but at least two significant digits, of the smallest one that is not zero."""
    least = min((abs(error) for error in errors if error), default=1.0)
    return min(_MAX_DIGITS, 1 - math.floor(math.log10(least))) if least < _MORE_DIGITS_BELOW else _SHORT_DECIMALS


def interval_text(lower: float, upper: float) -> str:
    """`0.093 … 0.118`, or `0.0036 … 0.0042`: both ends with the digits of the smaller one."""
    digits = error_digits(lower, upper)
    return f"{number(lower, digits)} … {number(upper, digits)}"


def percent(share: float, digits: int = 0) -> str:
    """`90 %`, with a non-breaking space."""
    return f"{100.0 * share:.{digits}f}\u00a0%"


def percent_of(difference: float, base: float) -> str:
    """The size of a difference as a percentage of an error; empty where the error is too small to compare with."""
    return percent(abs(difference) / base) if base > NEGLIGIBLE else ""


def confidence_text(confidence: float) -> str:
    """`93 %`, `99.7 %` or `more than 99.9 %`, never certainty; as on the pages."""
    return (
        f"more than {percent(0.999, 1)}" if confidence > 0.999 else percent(confidence, 1 if confidence > 0.99 else 0)
    )


def relative_to(value: float, base: float) -> str:
    """An error compared with another, as on the pages: `72 % lower`, `12 % higher`, `4.1 times as high`."""
    if base <= NEGLIGIBLE:
        return "the same" if value <= NEGLIGIBLE else "higher"
    change = value / base - 1.0
    if abs(change) < 0.005:
        return "the same"
    return f"{value / base:.2g} times as high" if change > 1.0 else f"{percent(abs(change))} {direction_of(change)}"


def direction_of(difference: float) -> str:
    """`lower` or `higher`."""
    return "lower" if difference < 0.0 else "higher"


def short_percent(share: float) -> str:
    """`12.5 %`, with up to three significant digits and a plain space."""
    return f"{100 * share:.3g} %"


def allowed_range(lower: float | None, upper: float | None) -> str:
    """`between 0 and 409`; `at least 0` or `at most 409` where there is one limit, `any` where there is none."""
    if lower is None:
        return "any" if upper is None else f"at most {upper:g}"
    return f"at least {lower:g}" if upper is None else f"between {lower:g} and {upper:g}"


def capitalised(sentence: str) -> str:
    """With a capital at its beginning; the rest as it is."""
    return sentence[:1].upper() + sentence[1:]


def count(amount: int, noun: str) -> str:
    """`1 flight`, `2 flights`."""
    return f"{amount} {noun}{'' if amount == 1 else 's'}"


def times(amount: int) -> str:
    """`once`, `twice`, `3 times`."""
    return {1: "once", 2: "twice"}.get(amount, f"{amount} times")


def signed(value: float) -> str:
    """`−0.012`, `+0.0000073`: two significant digits without an exponent."""
    power = math.floor(math.log10(abs(value))) if value else 0
    return _true_minus(f"{value:+.{max(0, 1 - power)}f}")


def named_flights(numbers: Sequence[int]) -> str:
    """`flight 3`, `flights 1–3, 7`; if that were a long list, `153 flights from 42 to 498`. Ascending numbers."""
    runs: list[tuple[int, int]] = []
    for each in numbers:
        if runs and each == runs[-1][1] + 1:
            runs[-1] = runs[-1][0], each
        else:
            runs.append((each, each))
    if len(runs) > _LISTED_RUNS:
        return f"{len(numbers)} flights from {numbers[0]} to {numbers[-1]}"
    listed = (
        str(first) if first == last else f"{first}{'–' if last - first > 1 else ', '}{last}" for first, last in runs
    )
    return f"flight{'' if len(numbers) == 1 else 's'} {', '.join(listed)}"


def grouped(amount: int, separator: str = " ") -> str:
    """`2 147 483 647`: digits in groups of three."""
    return f"{amount:,}".replace(",", separator)


def format_gains(gains: Mapping[str, float], digits: int = GAIN_DIGITS) -> str:
    """`kp 283, ki 13, kd −82`."""
    return ", ".join(f"{name} {gain(value, digits)}" for name, value in gains.items())


def number(value: float | None, digits: int = 3) -> str:
    """`0.132`; a dash for None."""
    return NOTHING if value is None else _true_minus(f"{value:z.{digits}f}")


def setting_text(value: bool | float | str, unit: str = "") -> str:
    """A setting as its form shows it: `on` or `off`, `10.5 V`, a text as it is, or `none` if it is empty."""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, str):
        return value or "none"
    return _true_minus(f"{value:g} {unit}".rstrip())


def _true_minus(text: str) -> str:
    return text.replace("-", "−")


def measured(value: float | None, uncertainty: float | None, unit: str) -> str:
    """`0.132 ± 0.007 m`, for tables; the value alone if its uncertainty is not known, and a dash for None."""
    if value is None:
        return NOTHING
    if uncertainty is None or uncertainty <= 0:
        return f"{short(value)} {unit}".rstrip()
    return plus_minus(value, uncertainty, unit)


def gain(value: float, digits: int = GAIN_DIGITS) -> str:
    """A gain as on the pages: an integer in full, any other with four significant digits."""
    text = f"{value:.0f}" if float(value).is_integer() else f"{value:.{digits}g}"
    return _true_minus(text)
