"""An autopilot is added in one folder and one line of the registry, as CONTRIBUTING.md says."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.complete
def test_an_autopilot_of_one_folder_and_one_line_is_offered_and_flown() -> None:
    done = subprocess.run(
        [sys.executable, Path(__file__).parent / "added" / "fly_toy.py"],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    toy = json.loads(done.stdout)
    assert (toy["experiments"], toy["address"]) == (["takeoff"], "udpin:127.0.0.1:14550")
    assert toy["failed"] == []
    assert toy["staged"] == {"kp": 400.0, "ki": 20.0, "kd": 90.0}
    assert toy["on board"] == pytest.approx(0.2, rel=1e-6)  # 400 · 0.0005, in single precision
    assert (toy["ending"], toy["reason"], toy["armed"]) == ("completed", "", False)
    assert toy["end_m"] == pytest.approx(3.0, abs=0.3)  # the takeoff's altitude, with a slow integrator
    assert toy["held"] == {"kp": 283.0, "ki": 13.0, "kd": 82.0}
