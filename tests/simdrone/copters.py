"""Short ways to talk to a simulated ArduPilot or PX4."""

import struct
from dataclasses import dataclass
from typing import Any, Final

from tests.simdrone.ground import Ground, Heard

SYSTEM: Final = 1
TO: Final[dict[str, Any]] = {"target_system": SYSTEM, "target_component": 1}
ARMED: Final = 128
INT32, REAL32 = 6, 9
ARM, SET_MODE, TAKE_OFF, SET_INTERVAL = 400, 176, 22, 511
GUIDED, LAND = 4, 9
POSITION: Final = 32
FORCE: Final = 21196
POSITION_ONLY: Final = 0b110111111000


@dataclass(frozen=True)
class Pilot:
    """Commands one drone through its ground station."""

    ground: Ground

    def tell(self, command: int, *params: float) -> None:
        """A command, without waiting for the answer."""
        values = dict.fromkeys((f"param{i}" for i in range(1, 8)), 0.0)
        values |= {f"param{i}": value for i, value in enumerate(params, 1)}
        self.ground.send("COMMAND_LONG", command=command, confirmation=0, **values, **TO)

    def command(self, command: int, *params: float) -> int:
        """The result in the answer."""
        self.tell(command, *params)
        result: int = self.ground.expect("COMMAND_ACK", lambda message: message.command == command).result
        return result

    def set(self, name: str, value: float, kind: int = REAL32) -> float:
        """The value in the answer."""
        self.ground.send("PARAM_SET", param_id=name, param_value=value, param_type=kind, **TO)
        answer: float = self.ground.expect("PARAM_VALUE", lambda message: message.param_id == name).param_value
        return answer

    def read(self, name: str) -> Heard | None:
        self.ground.send("PARAM_REQUEST_READ", param_id=name, param_index=-1, **TO)
        return self.ground.wait_for("PARAM_VALUE", within_s=1.0)

    def beat(self, *, kind: int = 6) -> None:
        """One heartbeat of a ground station."""
        rest = {"autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4, "mavlink_version": 3}
        self.ground.send("HEARTBEAT", type=kind, **rest)

    def fast_positions(self) -> None:
        assert self.command(SET_INTERVAL, POSITION, 20_000.0) == 0

    def arm(self) -> None:
        """As soon as it knows where it is."""
        self.ground.listen(max(3.5 - self.ground.elapsed_s, 0.1))
        assert self.command(ARM, 1.0) == 0

    def go_to(self, height_m: float, mask: int = POSITION_ONLY, **vertical: float) -> None:
        """A position target in the local frame; `vertical` are `vz` and `afz`."""
        fields = {
            **dict.fromkeys(("x", "y", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
            **vertical,
        }
        frame = {"time_boot_ms": 0, "coordinate_frame": 1, "type_mask": mask}
        self.ground.send("SET_POSITION_TARGET_LOCAL_NED", z=-height_m, **frame, **fields, **TO)

    def height_m(self) -> float:
        """Above the ground it started from, from now on."""
        self.ground.listen(0.6)
        height: float = self.ground.expect("GLOBAL_POSITION_INT").relative_alt / 1000
        return height

    def words(self) -> list[str]:
        """What it said so far."""
        said: list[tuple[int, str]] = []
        for each in self.ground.heard:
            if each.get_type() == "STATUSTEXT" and each.id and said and said[-1][0] == each.id:
                said[-1] = (each.id, said[-1][1] + each.text)
            elif each.get_type() == "STATUSTEXT":
                said.append((each.id, each.text))
        return [text for _, text in said]

    def is_armed(self) -> bool:
        self.ground.listen(0.1)
        return bool(self.ground.expect("HEARTBEAT").base_mode & ARMED)


@dataclass(frozen=True)
class ArduPilot(Pilot):
    def hover(self, height_m: float = 3.0) -> None:
        self.fast_positions()
        assert self.command(SET_MODE, 1, GUIDED) == 0
        self.arm()
        assert self.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, height_m) == 0
        self.ground.expect("LOCAL_POSITION_NED", lambda message: -message.z > height_m - 0.2, within_s=15.0)


@dataclass(frozen=True)
class Px4(Pilot):
    def hover(self, height_m: float = 3.0) -> None:
        self.set("MIS_TAKEOFF_ALT", height_m)
        self.arm()
        assert self.command(SET_MODE, 1, 4, 2) == 0
        self.ground.expect("LOCAL_POSITION_NED", lambda message: -message.z > height_m + 0.3, within_s=15.0)


def bytewise(value: int) -> float:
    """An integer's bytes, read as a float."""
    (carried,) = struct.unpack("<f", struct.pack("<i", value))
    return float(carried)


def integer(carried: float) -> int:
    """Back again."""
    (value,) = struct.unpack("<i", struct.pack("<f", carried))
    return int(value)
