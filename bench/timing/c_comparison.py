"""Comparison of a compiled loop in Python with the same loop in C at -O2, which lies beside the benchmark."""

import contextlib
import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

ROUNDS: Final = 300
PAUSE_S: Final = 0.015
"""The rounds are spread over ten seconds, because a busy processor slows the two loops by different factors for a
second or so."""
LIMIT: Final = 1.3


@contextlib.contextmanager
def compiled(source: Path, *flags: str) -> Iterator[ctypes.CDLL]:
    """Compile a C file and load it. Ends the program with status 2 if there is no gcc."""
    compiler = shutil.which("gcc")
    if compiler is None:
        print(f"{source.stem}: no gcc found; install one to compare against C.")
        sys.exit(2)
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "loop.so"
        subprocess.run([compiler, "-O2", *flags, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
        yield ctypes.CDLL(str(library))


def is_within_limit(what: str, in_c: Callable[[], object], in_python: Callable[[], object], steps: int) -> bool:
    """Time both in turns, print the best of each for `steps` steps, and return whether their ratio is within the
    limit."""
    rounds = [(_seconds(in_c), _seconds(in_python)) for _ in range(ROUNDS)]
    c_s, python_s = min(times[0] for times in rounds), min(times[1] for times in rounds)
    ratio = python_s / c_s
    print(
        f"{what}, {steps} steps, best of {ROUNDS}: C -O2 {c_s * 1e6:.0f} µs ({c_s / steps * 1e9:.1f} ns a step), "
        f"compiled Python {python_s * 1e6:.0f} µs ({python_s / steps * 1e9:.1f} ns a step), ratio {ratio:.2f} (limit "
        f"{LIMIT})"
    )
    return ratio <= LIMIT


def _seconds(run: Callable[[], object]) -> float:
    time.sleep(PAUSE_S)
    start = time.perf_counter()
    run()
    return time.perf_counter() - start
