"""32-bit arithmetic against independent computations with Python's unbounded integers."""

import ctypes
import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.core.control.vertical_guidance import INT32_MAX, INT32_MIN, divide, fix, limit, wrap32

INT32 = st.integers(INT32_MIN, INT32_MAX)


@given(st.integers(-(2**62), 2**62))
def test_wrap32_keeps_the_low_32_bits_as_c_does(value: int) -> None:
    assert wrap32(value) == ctypes.c_int32(value & 0xFFFFFFFF).value


@given(INT32, INT32.filter(bool))
def test_division_truncates_toward_zero_as_c_does(dividend: int, divisor: int) -> None:
    assert divide(dividend, divisor) == math.trunc(Fraction(dividend, divisor))


@given(INT32, INT32, INT32)
def test_limit_stays_within_its_bounds_and_changes_nothing_inside(value: int, one: int, other: int) -> None:
    low, high = sorted((one, other))
    limited = limit(value, low, high)
    assert low <= limited <= high
    assert limited == value or not low <= value <= high


@pytest.mark.parametrize(
    ("value", "bits", "expected"), [(1.5, 8, 384), (-1.999, 0, -1), (-0.00390624, 8, 0), (4.0, 16, 262144)]
)
def test_fix_truncates_toward_zero(value: float, bits: int, expected: int) -> None:
    assert fix(value, bits) == expected
