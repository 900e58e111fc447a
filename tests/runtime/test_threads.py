"""How many threads a process computes with."""

import subprocess
import sys

MULTIPLY = """
import app.core.tuning.calibration
import numpy as np
matrix = np.ones((700, 700))
matrix @ matrix
print(next(line for line in open("/proc/self/status") if line.startswith("Threads")).split()[1])
"""


def test_linear_algebra_takes_one_thread_whatever_the_machine_has() -> None:
    said = subprocess.run([sys.executable, "-c", MULTIPLY], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "1"
