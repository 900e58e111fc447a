"""`gainline sim-drone`: the real command, as a separate process."""

import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pymavlink.dialects.v10 import paparazzi as mavlink
from typer.testing import CliRunner, Result

from app.autopilots.simulated_kinds import SIMULATED
from app.cli.commands import app
from app.simdrone.fault_kinds import FAULTS
from tests.waiting import Waits

DOCUMENT = (Path(__file__).parents[2] / "docs" / "sim-drone.md").read_text()
GAINLINE = Path(sys.executable).parent / "gainline"


def gainline(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["sim-drone", *arguments])


def test_it_speaks_until_it_is_stopped_and_then_ends_well() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as radio:
        radio.bind(("127.0.0.1", 0))
        radio.settimeout(Waits.at_most_s)
        link = f"udp:127.0.0.1:{radio.getsockname()[1]}"
        with subprocess.Popen(
            [GAINLINE, "sim-drone", "--vehicle", "twin", "--system", "42", "--link", link, "--set", "scatter=0"],
            stderr=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        ) as process:
            message = mavlink.MAVLink(None).parse_buffer(radio.recv(1024))[0]
            process.send_signal(signal.SIGTERM)
            said, complained = process.communicate(timeout=Waits.at_most_s)
    assert message.get_srcSystem() == 42
    assert process.returncode == 0
    assert link in said
    assert complained == ""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--link", "udp:192.0.2.1:14550"], "--any-network"),
        (["--mocap", "natnet:192.0.2.1?body=1"], "--any-network"),
        (["--mocap", "mavlink:udp:192.0.2.1:14600"], "--any-network"),
        (["--mocap", "vicon:127.0.0.1"], "must be natnet:HOST?body=ID, odometry or"),
        (["--autopilot", "betaflight"], "must be one of paparazzi"),
        (["--vehicle", "lti"], "must be one of jsbsim, twin"),
        (["--fault", "gremlins@3"], "must be one of no-heartbeat"),
        (["--set", "scatter=much"], "must be NAME=NUMBER"),
        (["--vehicle", "twin", "--set", "wings=2"], "is not an option of twin"),
        (["--speed", "0"], "must be above 0"),
    ],
)
def test_what_cannot_be_had_is_refused_in_words(arguments: list[str], words: str) -> None:
    result = gainline(*arguments)
    assert result.exit_code == 1
    assert words in result.stderr


@pytest.mark.parametrize("name", [*SIMULATED, *FAULTS])
def test_every_autopilot_and_every_fault_is_in_its_document(name: str) -> None:
    assert f"| `{name}` |" in DOCUMENT
