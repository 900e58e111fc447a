"""What was set up once works without a network, and an installation that fails breaks nothing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.logs.recorded import LOGS

ROOT = Path(__file__).resolve().parents[2]
CLONED = ("app", "dev", "frontend", "hatch_build.py", "migrations", "pyproject.toml", "requirements", "README.md")
CLONED_ALSO = ("LICENSE", "CHANGELOG.md")
WITHOUT_NETWORK = ("unshare", "--net")


def clone(folder: Path) -> None:
    """The checkout as it stands, with the byte code and kernels compiled here, and what `./dev up` downloads and builds
    but for the Python packages: those come from the installer's cache."""
    for name in (*CLONED, *CLONED_ALSO):
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("node_modules", "dist", "coverage"))
        else:
            shutil.copy(source, folder / name)
    for link in (ROOT / ".dev" / "uv", ROOT / "frontend" / "dist"):
        home = link.resolve().parent
        shutil.copytree(home, folder / ".dev" / home.name, symlinks=True, copy_function=os.link)


@pytest.mark.complete
@pytest.mark.real_time
@pytest.mark.skipif(not (ROOT / "frontend" / "dist").is_symlink(), reason="./dev has not set this checkout up")
@pytest.mark.skipif(
    shutil.which("unshare") is None or subprocess.run([*WITHOUT_NETWORK, "true"], capture_output=True).returncode != 0,
    reason="this user may not take a process off the network (unshare --net)",
)
def test_a_clone_that_was_set_up_once_works_at_an_airfield(tmp_path: Path) -> None:
    folder = tmp_path / "clone"
    folder.mkdir()
    clone(folder)
    subprocess.run([folder / "dev", "exec", "gainline", "--help"], check=True, stdout=subprocess.DEVNULL)
    day = Path(__file__).with_name("day_offline.py")
    subprocess.run([*WITHOUT_NETWORK, sys.executable, day, folder, tmp_path / "data", LOGS], check=True)
