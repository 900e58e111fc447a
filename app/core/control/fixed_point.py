"""Integer arithmetic of a 32-bit autopilot, the same compiled and interpreted."""

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
    """Quotient truncated toward zero, as C divides. Exact for 32-bit operands, whose quotients a double can tell apart
    (two different ones lie at least 2⁻³¹ of their size apart, a double resolves 2⁻⁵³)."""
    return int(dividend / divisor)


@kernel
def limit(value: int, low: int, high: int) -> int:
    """`value`, held within `low` … `high`."""
    return low if value < low else min(value, high)


def fix(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ truncated toward zero: how a constant enters the loop. Not for kernels: it is called on import."""
    return int(value * (1 << fraction_bits))


@kernel
def measured(value: float, fraction_bits: int) -> int:
    """`value`·2ⁿ to the nearest integer: how a continuous quantity enters the loop without a bias."""
    return math.floor(value * (1 << fraction_bits) + 0.5)
