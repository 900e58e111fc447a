"""Short ways to talk to a simulated Paparazzi, and what the real one was recorded to say."""

import struct
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from pymavlink.dialects.v10 import paparazzi as mavlink

from tests.simdrone.ground import Ground, Heard

LOGS: Final = Path(__file__).parents[1] / "data" / "logs"
SYSTEM: Final = 31
TO: Final[dict[str, Any]] = {"target_system": SYSTEM, "target_component": 0}
REAL32: Final = 9
ARMED: Final = 128
HOLDING_POINT, START_ENGINE, TAKEOFF, LAND_HERE, LAND, FLARE, LANDED, HOME = 2, 3, 4, 13, 14, 15, 16, 17
CLIMB: Final = 2
GROUND_M: Final = 25 / 256
PLAN_M: Final = 1.095
"""Height of the ground above the flight plan's own origin: 147.095 − 146 m."""


@dataclass(frozen=True)
class Pilot:
    """Commands one drone through its ground station."""

    ground: Ground

    def block(self, seq: int) -> None:
        """As one must: whatever list was being read is read."""
        self.ground.send("MISSION_ACK", type=0, **TO)
        self.ground.send("SCRIPT_ITEM", seq=seq, name="", **TO)

    def send_setting(self, name: str, value: float, *, kind: int = REAL32, system: int = SYSTEM) -> None:
        self.ground.send(
            "PARAM_SET", target_system=system, target_component=0, param_id=name, param_value=value, param_type=kind
        )

    def set(self, name: str, value: float) -> float:
        """The value in the answer."""
        self.send_setting(name, value)
        answer: float = self.ground.expect("PARAM_VALUE", lambda message: message.param_id == name).param_value
        return answer

    def read(self, name: str) -> Heard | None:
        self.ground.send("PARAM_REQUEST_READ", param_id=name, param_index=-1, **TO)
        return self.ground.wait_for("PARAM_VALUE", within_s=1.0)

    def set_gains(self, kp: float, ki: float, kd: float) -> None:
        for name, value in (("kp", kp), ("ki", ki), ("kd", kd)):
            assert self.set(f"gui_v_{name}", value) == value

    def waypoint(self, seq: int, height_m: float) -> None:
        """An altitude is all that counts here."""
        zeros = dict.fromkeys(("current", "autocontinue", "param1", "param2", "param3", "param4", "x", "y"), 0)
        self.ground.send("MISSION_ITEM", seq=seq, frame=4, command=16, z=height_m, **zeros, **TO)

    def command(self, command: int, param1: float = 0.0) -> int:
        """The result in the answer."""
        zeros = dict.fromkeys((f"param{i}" for i in range(2, 8)), 0.0)
        self.ground.send("COMMAND_LONG", command=command, confirmation=0, param1=param1, **zeros, **TO)
        result: int = self.ground.expect("COMMAND_ACK", lambda message: message.command == command).result
        return result

    def is_armed(self) -> bool:
        self.ground.listen(0.1)
        return bool(self.ground.expect("HEARTBEAT").base_mode & ARMED)

    def start_engine(self) -> None:
        self.block(HOLDING_POINT)
        self.block(START_ENGINE)
        self.ground.expect("HEARTBEAT", lambda message: message.base_mode & ARMED)

    def take_off(self, height_m: float = 3.0) -> None:
        self.waypoint(CLIMB, height_m)
        self.ground.expect("MISSION_ACK")
        self.start_engine()
        self.block(TAKEOFF)

    def hover(self, height_m: float = 3.0) -> None:
        """Take off and wait until it is about there."""
        self.take_off(height_m)
        self.ground.expect("LOCAL_POSITION_NED", lambda message: -message.z > height_m - 0.5, within_s=20.0)

    def position(self) -> Heard:
        """One measured from now on."""
        self.ground.listen(0.03)
        return self.ground.expect("LOCAL_POSITION_NED")


@cache
def recorded(name: str) -> list[Heard]:
    """Every message of a recorded trial, from both sides."""
    data = (LOGS / name).read_bytes()
    parser = mavlink.MAVLink(None)
    messages: list[Heard] = []
    while data:
        (time_us,) = struct.unpack(">Q", data[:8])
        length = data[9] + 8
        message = parser.parse_buffer(data[8 : 8 + length])[0]
        message.received_s = time_us / 1e6
        messages.append(message)
        data = data[8 + length :]
    return messages


def from_vehicle(messages: list[Heard], kind: str = "") -> list[Heard]:
    return [each for each in messages if each.get_srcSystem() == SYSTEM and kind in ("", each.get_type())]
