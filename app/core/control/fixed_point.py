"""Integer arithmetic of a 32-bit autopilot, identical in compiled and interpreted code."""

import math
from typing import Final

from app.core.kernels import kernel

INT32_MIN: Final = -(2**31)
INT32_MAX: Final = 2**31 - 1


@kernel
def wrap32(value: int) -> int:
    """The 32-bit two's-complement integer with the same low 32 bits."""
    return ((value + 0x80000000) & 0xFFFFFFFF) - 0x80000000


@kernel
def divide(dividend: int, divisor: int) -> int:
    """Quotient truncated toward zero, as in C.

    Exact for 32-bit operands, because a double resolves their quotients (two different ones differ by at least 2⁻³¹ of
    their size, a double resolves 2⁻⁵³).
    """
    return int(dividend / divisor)


@kernel
def limit(value: int, low: int, high: int) -> int:
    """`value` limited to `low` … `high`."""
    return low if value < low else min(value, high)


def fix(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ truncated toward zero, as the firmware converts constants. Called on import, so not for kernels."""
    return int(value * (1 << fraction_bits))


@kernel
def measured(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ rounded to the nearest integer: converts a continuous quantity for the loop without a bias."""
    return math.floor(value * (1 << fraction_bits) + 0.5)
