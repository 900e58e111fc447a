"""Computation time of one takeoff of the simple model, relative to the same loop in C at -O2.

    ./dev exec python -m bench.rollout

Needs gcc. Checks that both altitudes are equal bit by bit, then times both in turns and prints the best of each and
their ratio; exits with 1 if the ratio is above 1.3. The rounds are spread over ten seconds, because a busy processor
slows the two loops by different factors for a second or so.
"""

import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from app.core.models.vertical import rollout

SAMPLES: Final = 16_693
ROUNDS: Final = 300
PAUSE_S: Final = 0.015
LIMIT: Final = 1.3
TARGET: Final = 768
GAINS: Final = (1600, 1023, 127)
HOVER, LAG, DRAG = 0.61, 0.05, 0.02


def in_c(library: Path) -> tuple[Callable[[], int], "np.ndarray[tuple[int], np.dtype[np.float64]]"]:
    altitude = np.empty(SAMPLES)
    function = ctypes.CDLL(str(library)).rollout
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
    return lambda: rollout(gains, model, TARGET, None, altitude), altitude[0]


def seconds(run: Callable[[], int]) -> float:
    time.sleep(PAUSE_S)
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def main() -> int:
    compiler = shutil.which("gcc")
    if compiler is None:
        print("bench.rollout: no gcc found; install one to compare against C.")
        return 2
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "rollout.so"
        subprocess.run(
            [compiler, "-O2", "-fwrapv", "-shared", "-fPIC", "-o", library, Path(__file__).with_suffix(".c"), "-lm"],
            check=True,
        )
        c, c_altitude = in_c(library)
        python, python_altitude = in_python()
        assert c() == python(), "the largest products differ"
        assert np.array_equal(c_altitude, python_altitude), "the altitudes differ"
        times = np.array([(seconds(c), seconds(python)) for _ in range(ROUNDS)]).min(axis=0)
    ratio = times[1] / times[0]
    print(
        f"one takeoff, {SAMPLES} steps, best of {ROUNDS}: C -O2 {times[0] * 1e6:.0f} µs "
        f"({times[0] / SAMPLES * 1e9:.1f} ns a step), compiled Python {times[1] * 1e6:.0f} µs "
        f"({times[1] / SAMPLES * 1e9:.1f} ns a step), ratio {ratio:.2f} (limit {LIMIT})"
    )
    return 0 if ratio <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
