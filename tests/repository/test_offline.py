"""What was set up once works without a network, and an installation that fails breaks nothing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.logs.recorded import LOGS

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("app", "frontend", "migrations", "requirements")
FILES = ("dev", "hatch_build.py", "pyproject.toml", "CHANGELOG.md", "LICENSE", "README.md")
WITHOUT_NETWORK = ("unshare", "--net")


def may_unshare() -> bool:
    done = (
        subprocess.run([*WITHOUT_NETWORK, "true"], capture_output=True, check=False)
        if shutil.which("unshare")
        else None
    )
    return done is not None and done.returncode == 0


def clone(folder: Path) -> None:
    """The checkout as it stands, with the byte code and kernels compiled here, and what `./dev up` downloads and builds
    but for the Python packages: those come from the installer's cache."""
    for name in FILES:
        shutil.copy(ROOT / name, folder)
    for name in FOLDERS:
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("node_modules", "dist", "coverage"))
    for link in (ROOT / ".dev" / "uv", ROOT / "frontend" / "dist"):
        home = link.resolve().parent
        shutil.copytree(home, folder / ".dev" / home.name, symlinks=True, copy_function=os.link)


@pytest.mark.complete
@pytest.mark.real_time("a server, a drone and an installation run in processes of their own", about_s=40)
@pytest.mark.skipif(not (ROOT / "frontend" / "dist").is_symlink(), reason="./dev has not set this checkout up")
@pytest.mark.skipif(not may_unshare(), reason="this user may not take a process off the network (unshare --net)")
def test_a_clone_that_was_set_up_once_works_at_an_airfield(tmp_path: Path) -> None:
    folder = tmp_path / "clone"
    folder.mkdir()
    clone(folder)
    subprocess.run([folder / "dev", "exec", "gainline", "--help"], check=True, stdout=subprocess.DEVNULL)
    day = Path(__file__).with_name("day_offline.py")
    subprocess.run([*WITHOUT_NETWORK, sys.executable, day, folder, tmp_path / "data", LOGS], check=True)
