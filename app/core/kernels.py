"""How the inner loops are compiled."""

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

_P = ParamSpec("_P")
_R = TypeVar("_R")


def kernel(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Compile on first use and keep the machine code beside the source; runs without the interpreter's lock.

    The types seen by callers stay those of the Python function. With `NUMBA_DISABLE_JIT=1` it is that very function,
    so kernels must mean the same thing both ways: no reliance on machine integers that wrap by themselves.
    """
    return cast(Callable[_P, _R], njit(nogil=True, cache=True, error_model="numpy")(function))
