"""MAVProxy against the simulated drones, over real UDP. Its time-outs are on the wall, the drones live faster."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.core.clock import ScaledClock
from app.simdrone.drone import Drone
from tests.ports import free_port
from tests.simdrone.ground import served
from tests.simdrone.paparazzi import CLIMB, HOLDING_POINT, LAND_HERE, START_ENGINE, SYSTEM, TAKEOFF
from tests.vehicles.peers.mavproxy import MavProxy
from tests.waiting import eventually

pytestmark = pytest.mark.real_time("MAVProxy knows no other clock", about_s=5)

SPEED = 5.0


@contextmanager
def typing_to(
    autopilot: str, folder: Path, *, dialect: str, mavlink: int, modules: tuple[str, ...]
) -> Iterator[tuple[MavProxy, Drone]]:
    port = free_port()
    with (
        MavProxy(port, folder, dialect=dialect, mavlink=mavlink, modules=modules) as mavproxy,
        served(autopilot, f"udp:127.0.0.1:{port}@{free_port()}", clock=ScaledClock(SPEED)) as drone,
    ):
        yield mavproxy, drone


@pytest.mark.complete
def test_mavproxy_tunes_and_flies_a_simulated_ardupilot(tmp_path: Path) -> None:
    modules = ("param", "mode", "arm", "misc", "cmdlong")
    with typing_to("ardupilot", tmp_path, dialect="ardupilotmega", mavlink=2, modules=modules) as (mavproxy, drone):
        mavproxy.hears(r"Received \d+ parameters")
        mavproxy.type("param set PSC_VELZ_P 4.5")
        eventually(lambda: fetched(mavproxy, "PSC_VELZ_P") == 4.5)
        mavproxy.type("mode GUIDED")
        mavproxy.hears("Mode GUIDED")
        mavproxy.type("arm throttle")
        mavproxy.hears(r"\bARMED")
        mavproxy.type("takeoff 3")
        mavproxy.hears("NAV_TAKEOFF: ACCEPTED")
        eventually(lambda: drone.body.altitude_m == pytest.approx(3.0, abs=0.1))
        mavproxy.type("mode LAND")
        mavproxy.hears("DISARMED")
        assert drone.body.stands


def fetched(mavproxy: MavProxy, name: str) -> float:
    mavproxy.type(f"param fetch {name}")
    return float(mavproxy.hears(rf"{name} = (\S+)").group(1))


def message(kind: str, *fields: object) -> str:
    """What MAVProxy's module `message` takes: Python expressions between blanks. The vehicle's number is added."""
    return " ".join(["message", kind, str(SYSTEM), "0", *(f'"{field!r}"' for field in fields)])


def block(number: int) -> tuple[str, str]:
    """As one must: whatever list was being read is read."""
    return message("MISSION_ACK", 0), message("SCRIPT_ITEM", number, b"")


@pytest.mark.complete
def test_mavproxy_tunes_and_flies_a_simulated_paparazzi(tmp_path: Path) -> None:
    """By the messages themselves, for its own commands do not fit: `param set` writes names in capitals, `arm` and
    `mode` ask for a COMMAND_ACK, which ends its listening where MAVLink 1 leaves out the target."""
    modules = ("param", "message")
    with typing_to("paparazzi", tmp_path, dialect="paparazzi", mavlink=1, modules=modules) as (mavproxy, drone):
        mavproxy.hears("Received 76 parameters")
        for name, value in ((b"gui_v_kp", 1624.7), (b"gui_v_ki", 1356), (b"gui_v_kd", 195)):
            mavproxy.type(message("PARAM_SET", name, value, 9))
        mavproxy.type(message("PARAM_REQUEST_READ", b"gui_v_kp", -1))
        eventually(lambda: read_back(mavproxy, "gui_v_kp") == 1624.0)
        mavproxy.type(message("MISSION_ITEM", CLIMB, 4, 16, 0, 0, 0, 0, 0, 0, 0, 0, 3.0))
        mavproxy.hears(r"MISSION_ACK \{[^}]*type : 0")
        mavproxy.type(*block(HOLDING_POINT), *block(START_ENGINE))
        mavproxy.hears(r"\bARMED")
        mavproxy.type(*block(TAKEOFF))
        eventually(lambda: drone.body.altitude_m > 2.8)
        mavproxy.type(*block(LAND_HERE))
        eventually(lambda: drone.body.stands)
        mavproxy.type(message("PARAM_SET", b"kil_thr", 1, 9))
        mavproxy.hears("DISARMED")


def read_back(mavproxy: MavProxy, name: str) -> float | None:
    """The last parameter that it heard of, when it is this one."""
    mavproxy.type("status PARAM_VALUE")
    heard, value = mavproxy.hears(r"PARAM_VALUE \{param_id : (\S+), param_value : ([^,]+),").groups()
    return float(value) if heard == name else None
