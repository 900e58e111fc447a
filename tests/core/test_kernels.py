"""Where machine code is kept: a folder for each state of the sources, and none where nothing can be written."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.core import kernels

ROLLOUT = """
import numpy as np
from app.core.experiments.takeoff import Takeoff
run = Takeoff().simulate(np.array([1600.0, 1023.0, 127.0]), np.array([0.61, 0.3, 0.05, 0.02, 0.1, 0.1, 0.01, 0.01]))
print(run["altitude_m"].tobytes().hex()[-4000:])
"""

SMALL = """
from app.autopilots.ardupilot.replica.shaping import square_root
print(square_root(1.0, 2.0, 3.0, 0.01))
"""
"""A kernel that is compiled within a moment."""


def output(script: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return done.stdout


@pytest.mark.complete
def test_compiled_and_interpreted_rollouts_are_equal_bit_for_bit() -> None:
    assert output(ROLLOUT, NUMBA_DISABLE_JIT="0") == output(ROLLOUT, NUMBA_DISABLE_JIT="1")


@pytest.mark.complete
def test_a_cache_folder_of_the_operators_choice_is_used(tmp_path: Path) -> None:
    output(SMALL, NUMBA_DISABLE_JIT="0", NUMBA_CACHE_DIR=str(tmp_path))
    (folder,) = tmp_path.iterdir()
    assert folder.name.startswith("kernels-")
    assert list(folder.rglob("*.nbi"))


@pytest.mark.complete
def test_where_nothing_can_be_kept_kernels_are_compiled_for_each_process(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    kept = output(SMALL, NUMBA_DISABLE_JIT="0")
    assert output(SMALL, NUMBA_DISABLE_JIT="0", NUMBA_CACHE_DIR=str(blocked / "kernels")) == kept


def test_a_user_without_a_home_gets_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    def homeless(_chosen: str) -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(kernels, "_cache_folder", homeless)
    assert not kernels._use_cache.__wrapped__()


def test_each_state_of_the_sources_has_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "control").mkdir()
    (tmp_path / "models").mkdir()
    source = tmp_path / "control" / "loop.py"
    monkeypatch.setattr(kernels, "_HERE", tmp_path)
    names = []
    for text in ("one", "two", "one"):
        source.write_text(text)
        names.append(kernels._cache_folder("").name)
    assert names[0] == names[2] != names[1]


NUMBA_FREE = """
import sys
from app.autopilots.registry import EXPERIMENTS
assert "numba" not in sys.modules
"""


def test_importing_the_kernels_does_not_import_numba() -> None:
    subprocess.run([sys.executable, "-c", NUMBA_FREE], check=True)


def test_a_kernel_compiles_those_it_calls_and_looks_like_its_function(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "_use_cache", lambda: False)

    @kernels.kernel
    def doubled(value: int) -> int:
        """Twice the value."""
        return 2 * value

    @kernels.kernel
    def doubled_twice(value: int) -> int:
        return doubled(doubled(value))

    assert doubled_twice(3) == 12
    assert doubled(value=2) == 4
    assert (doubled.__name__, doubled.__doc__) == ("doubled", "Twice the value.")
