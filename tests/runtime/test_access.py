"""The scripts that flew a real vehicle, against a real server: refused, each of them."""

import re
import socket
import stat
import subprocess
import sys
from pathlib import Path

import httpx2
import pytest

from app.accounts.keys_and_links import Keyring
from app.accounts.permissions import Key
from tests.runtime.processes import Serving, environment
from tests.waiting import Waits

pytestmark = pytest.mark.real_time("a real server is asked over real connections")

REAL = {
    "name": "Bee",
    "kind": "mavlink",
    "options": {},
    "safe_gains_confirmed": True,
    "statement": "nobody has looked",
}
LAN = "192.168.178.20"


@pytest.fixture(scope="package")  # as the server is: another module's tests may come between these
def bee(serving: Serving) -> int:
    """A real vehicle of the operator, who has opened the link that the terminal printed."""
    serving.unlock()
    identity: int = serving.post("/vehicles", REAL)["id"]
    return identity


def script(name: str, port: int) -> dict[str, str]:
    """The headers of one of the scripts."""
    page = {"Sec-Fetch-Site": "same-origin", "Sec-Fetch-Mode": "cors"}
    here, there = f"127.0.0.1:{port}", f"{LAN}:{port}"
    return {
        "proxy": {**page, "Host": there, "Origin": f"http://{there}", "X-Forwarded-For": "203.0.113.5"},
        "proxy under our name": {**page, "Host": here, "Origin": f"http://{here}", "X-Forwarded-For": "127.0.0.1"},
        "tunnel": {**page, "Host": "bee.tunnel.example", "Origin": "https://bee.tunnel.example"},
        "tunnel under our name": {**page, "Host": here, "Origin": f"http://{here}", "CF-Connecting-IP": "203.0.113.5"},
        "address in the network": {**page, "Host": there, "Origin": f"http://{there}"},
        "another user": {**page, "Host": here, "Origin": f"http://{here}"},
        "another user without headers": {},
    }[name]


FROM_AFAR = ("proxy", "proxy under our name", "tunnel", "tunnel under our name", "address in the network")
SCRIPTS = (*FROM_AFAR, "another user", "another user without headers")


@pytest.mark.parametrize(
    ("name", "stolen"), [*((name, False) for name in SCRIPTS), *((name, True) for name in FROM_AFAR)]
)
def test_the_scripts_that_flew_a_real_vehicle_are_refused(serving: Serving, bee: int, name: str, stolen: bool) -> None:
    """Those from afar also with the operator's own key."""
    headers = script(name, int(serving.url.rpartition(":")[2]))
    keyring = Keyring(serving.data_dir)
    if stolen:
        headers["Cookie"] = f"{keyring.cookie}={keyring.value(Key.BROWSER)}"
    steps = [
        ("POST", "/api/vehicles", {**REAL, "name": "Wasp"}),
        ("PUT", f"/api/vehicles/{bee}/control", {"operator": "Mallory", "take_over": True}),
        ("POST", f"/api/vehicles/{bee}/connect", None),
        ("POST", f"/api/vehicles/{bee}/motors-off", None),
        ("PATCH", f"/api/vehicles/{bee}", {"version": 1, "name": "Mine"}),
    ]
    with httpx2.Client(timeout=Waits.at_most_s, base_url=serving.url, headers=headers) as mallory:
        for method, path, body in steps:
            refused = mallory.request(method, path, json=body)
            assert refused.status_code == 403, (path, refused.text)
    vehicles = {vehicle["id"]: vehicle for vehicle in serving.get("/vehicles")["items"]}
    vehicle = vehicles[bee]
    assert (vehicle["name"], vehicle["control"], vehicle["state"]) == ("Bee", None, "disconnected")
    assert "Wasp" not in {each["name"] for each in vehicles.values()}


def test_the_operator_does_the_same_in_the_unlocked_browser(serving: Serving, bee: int) -> None:
    lease = serving.api.put(f"/vehicles/{bee}/control", json={"operator": "Ada"})
    assert lease.status_code == 200
    token = {"X-Gainline-Control": lease.json()["token"]}
    assert serving.api.delete(f"/vehicles/{bee}/control", headers=token).status_code == 204


def test_another_user_of_this_computer_only_watches(serving: Serving, bee: int) -> None:
    with httpx2.Client(timeout=Waits.at_most_s, base_url=serving.url) as other:
        assert other.get(f"/api/vehicles/{bee}").status_code == 200
        assert other.get("/api/access").json()["may_command"] is False
        assert other.post(f"/api/vehicles/{bee}/connect").status_code == 403
        assert other.post(f"/api/vehicles/{bee}/land").status_code == 202
    assert stat.S_IMODE(serving.data_dir.stat().st_mode) == 0o700
    assert stat.S_IMODE((serving.data_dir / "access" / "secret").stat().st_mode) == 0o600


def unlock(serving: Serving, *options: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "app.cli", "unlock", "--data-dir", str(serving.data_dir), *options],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_second_browser_is_unlocked_by_a_link_of_the_command_line(serving: Serving) -> None:
    found = re.search(r"http://\S+/unlock\?token=\S+", unlock(serving))
    assert found is not None
    with httpx2.Client(timeout=Waits.at_most_s, base_url=serving.url) as second:
        assert second.get(found.group()).status_code == 303
        assert second.get("/api/access").json()["may_command"]
    with httpx2.Client(timeout=Waits.at_most_s, base_url=serving.url) as third:
        assert third.get(found.group()).status_code == 403


@pytest.mark.complete
def test_the_token_of_a_script_is_printed_for_this_computer_alone(serving: Serving) -> None:
    said = unlock(serving, "--script")
    token = said.split()[-1]
    assert "other devices" not in said
    with httpx2.Client(
        timeout=Waits.at_most_s, base_url=f"{serving.url}/api", headers={"Authorization": f"Bearer {token}"}
    ) as script:
        assert script.post("/vehicles/4711/motors-off").status_code == 202


@pytest.mark.complete
def test_without_a_server_there_is_no_link(tmp_path: Path) -> None:
    refused = subprocess.run(
        [sys.executable, "-m", "app.cli", "unlock", "--data-dir", str(tmp_path)],
        env=environment(COLUMNS="1000"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert refused.returncode == 1
    assert "No Gainline server is running on" in refused.stderr
    assert list(tmp_path.iterdir()) == []


def test_no_token_is_in_the_logs(serving: Serving) -> None:
    token = Keyring(serving.data_dir).new_link()
    with httpx2.Client(timeout=Waits.at_most_s, base_url=serving.url) as browser:
        assert browser.get(f"/unlock?token={token}").status_code == 303
        assert browser.get(f"/unlock?token={token}").status_code == 303
        assert browser.get(f"/unlock?token={token}x").status_code == 303
    with socket.create_connection(("127.0.0.1", int(serving.url.rpartition(":")[2]))) as broken:
        broken.sendall(f"GET /unlock?token={token} HTTP/9.9\r\n\r\n".encode())
        broken.recv(1000)
    written = "".join(path.read_text() for path in (serving.data_dir / "log").iterdir())
    assert token not in written + serving.logged()
    assert "ready" in written
