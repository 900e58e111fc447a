"""Computation time of one takeoff of the simple model, relative to the same loop in C at -O2.

    ./dev exec python -m bench.rollout

Needs gcc. Checks that both altitudes are equal bit by bit, then times both in turns and prints the best of each and
their ratio; exits with 1 if the ratio is above 1.3.
"""

import ctypes
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from app.core.models.vertical import rollout
from bench.timing.c_comparison import compiled, is_within_limit

SAMPLES: Final = 16_693
TARGET: Final = 768
GAINS: Final = (1600, 1023, 127)
HOVER, LAG, DRAG = 0.61, 0.05, 0.02


def in_c(library: ctypes.CDLL) -> tuple[Callable[[], int], "np.ndarray[tuple[int], np.dtype[np.float64]]"]:
    altitude = np.empty(SAMPLES)
    function = library.rollout
    function.restype = ctypes.c_int64
    gains = [ctypes.c_int32(gain) for gain in GAINS]
    model = [ctypes.c_double(value) for value in (HOVER, LAG, DRAG)]
    arguments = (
        *gains,
        *model,
        ctypes.c_int32(TARGET),
        ctypes.c_int64(SAMPLES),
        altitude.ctypes.data_as(ctypes.POINTER(ctypes.c_double)),
    )
    return lambda: int(function(*arguments)), altitude


def in_python() -> tuple[Callable[[], int], "np.ndarray[tuple[int], np.dtype[np.float64]]"]:
    altitude = np.empty((1, SAMPLES))
    gains, model = np.array(GAINS, dtype=np.int64), np.array([HOVER, 0.0, LAG, DRAG, 0.0, 0.0, 0.0, 0.0])
    targets = np.array([TARGET], dtype=np.int64)
    return lambda: rollout(gains, model, targets, None, altitude), altitude[0]


def main() -> int:
    with compiled(Path(__file__).with_suffix(".c"), "-fwrapv") as library:
        c, c_altitude = in_c(library)
        python, python_altitude = in_python()
        assert c() == python(), "the largest products differ"
        assert np.array_equal(c_altitude, python_altitude), "the altitudes differ"
        return 0 if is_within_limit("one takeoff", c, python, SAMPLES) else 1


if __name__ == "__main__":
    sys.exit(main())
