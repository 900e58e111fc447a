"""No internet at the field: server and dashboard work on a machine whose network is unplugged. That no page asks
anything elsewhere is seen in every browser test."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest


def own_network() -> list[str]:
    """The command that runs another one in a separate network namespace, where this user may have one."""
    if shutil.which("unshare") is None:
        pytest.skip("there is no `unshare` here to unplug the network with")
    for command in (["unshare", "--net"], ["unshare", "--map-root-user", "--net"]):
        if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
            return command
    pytest.skip("this user may not make a network namespace (needs root, or unprivileged user namespaces)")


def test_a_campaign_is_flown_and_drawn_with_the_network_unplugged(chromium: str) -> None:
    command = [*own_network(), sys.executable, "-m", "tests.e2e.unplugged", chromium]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {"unplugged": True, "wrong": [], "alerts": []}
