"""The vehicle that a telemetry log (.tlog) is of, and what its autopilot does differently from others."""

import importlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType, ModuleType
from typing import Final

from app.autopilots.ardupilot.log import GAIN_SETS as ARDUPILOT_SETS
from app.autopilots.paparazzi.log import GAIN_SETS as PAPARAZZI_SETS
from app.autopilots.paparazzi.log import PARAMETERS
from app.autopilots.px4.log import GAIN_SETS as PX4_SETS
from app.autopilots.recording import GainSets
from app.logs.base import Contents, refused
from app.logs.tlog import frames, messages

HINT: Final = (
    "Use a .tlog with the vehicle's heartbeats and LOCAL_POSITION_NED from before the takeoff; it should also "
    "contain the ground station's commands."
)
_LOCAL_POSITION_NED: Final = 32
_COPTERS: Final = frozenset({2, 3, 13, 14, 15, 29, 35})
"""Kinds of vehicles with several rotors, in a heartbeat."""
_OTHER_KINDS: Final[Mapping[int, str]] = MappingProxyType(
    {1: "a fixed-wing aircraft", 4: "a helicopter", 10: "a rover", 11: "a boat", 12: "a submarine"}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedAutopilot:
    """Differences between autopilots.

    `parameters` maps their parameter names to those of the gains, where these differ. Some store gains as integers
    only; some send integers byte by byte in place of a float; some have a takeoff mode.
    """

    name: str
    title: str
    dialect_module: str
    gain_sets: GainSets
    parameters: Mapping[str, str] | None = None
    from_ground: bool = True
    keeps_whole_numbers: bool = False
    sends_integers_bytewise: bool = False
    has_takeoff_mode: bool = False

    @property
    def dialect(self) -> ModuleType:
        """Loaded when the first log of such a vehicle is read, because a dialect contains a thousand classes."""
        return importlib.import_module(f"pymavlink.dialects.{self.dialect_module}")


_AUTOPILOTS: Final[Mapping[int, LoggedAutopilot]] = MappingProxyType(
    {
        9: LoggedAutopilot(
            name="paparazzi",
            title="Paparazzi",
            dialect_module="v10.paparazzi",
            gain_sets=PAPARAZZI_SETS,
            parameters=PARAMETERS,
            from_ground=False,
            keeps_whole_numbers=True,
        ),
        3: LoggedAutopilot(
            name="ardupilot", title="ArduPilot", dialect_module="v20.ardupilotmega", gain_sets=ARDUPILOT_SETS
        ),
        12: LoggedAutopilot(
            name="px4",
            title="PX4",
            dialect_module="v20.common",
            gain_sets=PX4_SETS,
            sends_integers_bytewise=True,
            has_takeoff_mode=True,
        ),
    }
)
"""By the autopilot number in the heartbeat.

Paparazzi's altitude is above its local origin, that of the others above the ground.
"""


@dataclass(frozen=True, slots=True)
class LoggedVehicle:
    """A vehicle in a log: its system and component, its autopilot, and the number of its kind."""

    system: int
    component: int
    autopilot: LoggedAutopilot
    kind: int

    @property
    def other_frame(self) -> str:
        """What it is, if it is not a copter with several rotors."""
        other = _OTHER_KINDS.get(self.kind, f"a vehicle of MAVLink's type {self.kind}")
        return "" if self.kind in _COPTERS else other


def find_vehicle(data: Contents) -> LoggedVehicle:
    """The vehicle that reports its position most often. Raises TrajectoryError if there is no heartbeat of a known
    autopilot."""
    from pymavlink.dialects.v20 import minimal

    found: dict[tuple[int, int], LoggedVehicle] = {}
    for message in messages(data, minimal, {"HEARTBEAT"}):
        place, autopilot = (message.system, message.component), _AUTOPILOTS.get(int(message["autopilot"]))
        if autopilot is not None and place not in found:
            found[place] = LoggedVehicle(*place, autopilot, int(message["type"]))
    if not found:
        known = ", ".join(autopilot.title for autopilot in _AUTOPILOTS.values())
        raise refused(f"contains no MAVLink heartbeat of {known}", HINT)
    positions = Counter(
        (frame.system, frame.component) for frame in frames(data) if frame.message == _LOCAL_POSITION_NED
    )
    return max(found.values(), key=lambda each: positions[each.system, each.component])
