"""No internet at the field: every page loads on a machine whose network is unplugged, and asks nothing elsewhere."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.unplugged import pages


def own_network() -> list[str]:
    """The command that runs another one in a separate network namespace, where this user may have one."""
    if shutil.which("unshare") is None:
        pytest.skip("there is no `unshare` here to unplug the network with")
    for command in (["unshare", "--net"], ["unshare", "--map-root-user", "--net"]):
        if subprocess.run([*command, "true"], capture_output=True, check=False).returncode == 0:
            return command
    pytest.skip("this user may not make a network namespace (needs root, or unprivileged user namespaces)")


@pytest.mark.timeout(600, func_only=True)
def test_every_page_loads_with_the_network_unplugged_and_asks_nothing_elsewhere(chromium: str) -> None:
    command = [*own_network(), sys.executable, "-m", "tests.e2e.unplugged", chromium]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2], check=False)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert seen["unplugged"]
    assert len(seen["pages"]) == len(pages())
    for page in seen["pages"]:
        assert page["elsewhere"] == [], page
        assert page["alerts"] == [], page
        assert ":" not in page["path"], f"{page['path']}: say in unplugged.py what stands for this parameter"
