"""A day at an airfield, for `test_offline.py`: run in a clone that was set up, by a process that has no network.

    unshare --net python day_offline.py CLONE DATA LOGS

Fails with a traceback where something does not work; how long it waits for anything is up to the test that runs it.
"""

import fcntl
import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import Any

CLONE, DATA, LOGS = map(Path, sys.argv[1:])
NONE_SUCH = f"no-such-package==1.0 --hash=sha256:{0:064}\n"
SET_INTERFACE_FLAGS, UP = 0x8914, 0x1


def bring_loopback_up() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        fcntl.ioctl(any_socket, SET_INTERFACE_FLAGS, struct.pack("16sh", b"lo", UP))


def start(*command: str | Path) -> subprocess.Popen[str]:
    return subprocess.Popen([CLONE / "dev", *command], stdout=subprocess.PIPE, text=True, start_new_session=True)


def gainline(*arguments: str | Path, works: bool = True) -> str:
    """What a command prints."""
    done = subprocess.run([CLONE / "dev", "exec", "gainline", *arguments], capture_output=True, text=True, check=False)
    assert (done.returncode == 0) is works, (arguments, done.stdout, done.stderr)
    return done.stdout + done.stderr


def lines_until(process: subprocess.Popen[str], last: str) -> list[str]:
    assert process.stdout is not None
    lines: list[str] = []
    while not lines or last not in lines[-1]:
        lines.append(process.stdout.readline())
        assert lines[-1], lines
    return lines


def ask(url: str, body: object = None) -> Any:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data=data, headers={"Content-Type": "application/json"})
    with urllib.request.urlopen(request) as answer:
        return json.load(answer)


def fly_without_a_network() -> None:
    server = start("up", "--port", "0", "--data-dir", DATA)
    lines = "".join(lines_until(server, "works once"))
    found = re.search(r"Gainline is ready at (http://\S+)", lines)
    assert found, lines
    url = found[1]
    assert lines.startswith("Gainline ")
    assert "The worker is ready" in "".join(lines_until(server, "ready to compute")) + lines
    assert f"{url}/unlock?token=" in gainline("unlock", "--data-dir", DATA)
    created = ask(f"{url}/api/campaigns", {"name": "Garage", "vehicle": {"kind": "import"}, "definition": {}})
    while ask(f"{url}/api/campaigns/{created['id']}")["state"] != "ready":
        time.sleep(0.05)
    log = LOGS / "paparazzi_283_13_82.tlog"
    assert "Trial 1 of campaign" in gainline("import", log, "--campaign", "Garage", "--data-dir", DATA)
    server.send_signal(signal.SIGINT)
    assert server.wait() == 0
    for line in (DATA / "log" / "web.log").read_text().splitlines():
        assert json.loads(line)["event"]
    drone = start("exec", "gainline", "sim-drone")
    assert "Paparazzi" in "".join(lines_until(drone, "Paparazzi"))
    drone.terminate()
    drone.wait()
    assert "The model predicts" in gainline("analyze", log)
    assert "flight" in gainline("run", "paper-ardrone-takeoff", "--max-flights", "1").lower()


def survive_what_cannot_be_installed() -> None:
    working = (CLONE / ".venv").resolve()
    lock, project = CLONE / "requirements" / "run.txt", CLONE / "pyproject.toml"
    before, asked = lock.read_text(), project.read_text()
    lock.write_text(before + "# another version\n")
    killed = start("exec", "true")
    while not any(folder.parent != working.parent for folder in (CLONE / ".dev").glob("venv-*/made")):
        assert killed.poll() is None
    os.killpg(killed.pid, signal.SIGKILL)
    killed.wait()
    lock.write_text(before + NONE_SUCH)
    assert "Going on with the packages of before" in gainline("--help")
    project.write_text(asked.replace('"rich>=', '"rich>=9'))
    assert "it asks for rich>=9" in gainline("--help", works=False)
    lock.write_text(before)
    project.write_text(asked)
    assert "Going on" not in gainline("--help")
    assert not (CLONE / ".venv" / "bin" / "pytest").exists()
    assert (CLONE / ".venv").resolve() == working
    lock = CLONE / "requirements" / "node.txt"
    lock.write_text(lock.read_text() + NONE_SUCH)
    refused = subprocess.run([CLONE / "dev", "up"], capture_output=True, text=True, check=False)
    assert refused.returncode == 1
    assert "Go back to the version that ran here last" in refused.stderr


if __name__ == "__main__":
    os.environ["UV_HTTP_RETRIES"] = "0"
    bring_loopback_up()
    fly_without_a_network()
    survive_what_cannot_be_installed()
