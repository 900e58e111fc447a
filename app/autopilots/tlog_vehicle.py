"""The vehicle that a telemetry log (.tlog) is of."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.autopilots.autopilot import Autopilot
from app.autopilots.registry import AUTOPILOTS
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


_AUTOPILOTS: Final = {each.autopilot: each for each in AUTOPILOTS.values()}
"""By the autopilot number in the heartbeat."""


@dataclass(frozen=True, slots=True)
class LoggedVehicle:
    """A vehicle in a log: its system and component, its autopilot, and the number of its kind."""

    system: int
    component: int
    autopilot: Autopilot
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
        known = ", ".join(autopilot.project or autopilot.title for autopilot in _AUTOPILOTS.values())
        raise refused(f"contains no MAVLink heartbeat of {known}", HINT)
    positions = Counter(
        (frame.system, frame.component) for frame in frames(data) if frame.message == _LOCAL_POSITION_NED
    )
    return max(found.values(), key=lambda each: positions[each.system, each.component])
