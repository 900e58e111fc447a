"""Each contract of the layers catches the import it is there for; `./dev test` checks the code against them."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

VIOLATIONS = {
    "a circle of packages": ("fleet/service.py", "import app.campaigns.service", "Every import between packages"),
    "a circle of modules": ("campaigns/history.py", "import app.campaigns.proposals", "No circle"),
    "a package without a place": ("attic/__init__.py", "", "Every import between packages"),
    "the core reads settings": ("core/policy.py", "import app.common.settings", "The core is pure"),
    "the core knows pydantic": ("core/policy.py", "import pydantic", "The core is pure"),
    "the trial machine knows the link": (
        "vehicles/mavlink/observation.py",
        "import app.vehicles.mavlink.radio",
        "The trial",
    ),
    "a vehicle's process knows the database": (
        "flights/connection_process.py",
        "import app.db.models",
        "Processes that",
    ),
    "an autopilot knows a vehicle": ("autopilots/__init__.py", "import app.vehicles.base", "Logs and figures"),
    "a replica reads a log": (
        "autopilots/px4/replica/vertical.py",
        "import app.logs.ulog",
        "Replicas of autopilots",
    ),
    "a replica reads a recording": (
        "autopilots/px4/replica/vertical.py",
        "import app.autopilots.recording",
        "Replicas of autopilots",
    ),
    "a replica knows its log": (
        "autopilots/px4/replica/vertical.py",
        "import app.autopilots.px4.log",
        "Replicas of autopilots",
    ),
    "a replica knows pymavlink": (
        "autopilots/px4/replica/vertical.py",
        "import pymavlink",
        "Replicas of autopilots",
    ),
    "a vehicle reads logs": ("vehicles/base.py", "import app.logs", "Logs and figures"),
    "a figure reads the database": ("figures/base.py", "import app.db.models", "Logs and figures"),
    "the simulated drone reads the database": ("simdrone/drone.py", "import app.db.models", "The simulated drone"),
    "states know a service": ("common/states.py", "import app.campaigns.service", "States import nothing"),
    "a service uses another slice's repository": (
        "flights/service.py",
        "import app.campaigns.repository",
        "A slice calls another",
    ),
    "a repository knows its service": ("campaigns/repository.py", "import app.campaigns.service", "Within a slice"),
    "a router goes past its service": ("campaigns/router.py", "import app.campaigns.repository", "Routers and runners"),
    "a runner uses the tables": ("flights/runner.py", "import app.db.models", "Routers and runners"),
    "a service knows FastAPI": ("campaigns/service.py", "from fastapi import HTTPException", "Only routers"),
    "a service knows Starlette": ("campaigns/service.py", "from starlette.types import ASGIApp", "Only routers"),
    "the worker knows JSBSim": ("worker.py", "import jsbsim", "Only vehicles know"),
    "the worker knows pymavlink": ("worker.py", "import pymavlink", "Only vehicles, autopilots"),
}


@pytest.mark.complete
@pytest.mark.parametrize(("file", "violation", "contract"), VIOLATIONS.values(), ids=VIOLATIONS.keys())
def test_a_forbidden_import_breaks_a_contract(file: str, violation: str, contract: str, tmp_path: Path) -> None:
    shutil.copytree(ROOT / "app", tmp_path / "app", ignore=shutil.ignore_patterns("__pycache__", "ui"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    (tmp_path / "app" / file).parent.mkdir(exist_ok=True)
    with (tmp_path / "app" / file).open("a") as source:
        source.write(f"\n{violation}\n")
    done = subprocess.run(
        [Path(sys.executable).parent / "lint-imports", "--no-cache"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    broken = [line for line in done.stdout.splitlines() if "BROKEN" in line]
    assert any(line.startswith(contract) for line in broken), done.stdout
