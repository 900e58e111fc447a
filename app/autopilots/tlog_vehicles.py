"""The vehicles in a telemetry log: whose messages count.

Companion computers, gimbals, cameras and ground stations send heartbeats too, some under the vehicle's system id, some
with the number of an autopilot that they are not. An autopilot is told by what it reports: where the vehicle is.
"""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.autopilots.autopilot import Autopilot
from app.autopilots.registry import AUTOPILOTS
from app.logs.base import Contents, refused
from app.logs.tlog import Message, frames, messages

HINT: Final = (
    "Use a .tlog with the vehicle's heartbeats and LOCAL_POSITION_NED from before the takeoff; it should also "
    "contain the ground station's commands."
)
_AUTOPILOTS: Final = {each.autopilot: each for each in AUTOPILOTS.values()}
"""By the autopilot number in the heartbeat."""
_POSITIONS: Final = (32, 33, 30)
"""LOCAL_POSITION_NED, GLOBAL_POSITION_INT, ATTITUDE."""
_USUAL_COMPONENT: Final = 1
_FRAMES: Final[Mapping[int, str]] = MappingProxyType(
    dict.fromkeys((2, 3, 13, 14, 15, 29, 35, 43), "")
    | {1: "plane", 4: "helicopter", 5: "tracker", 7: "airship", 10: "rover", 11: "boat", 12: "submarine"}
    | dict.fromkeys((*range(19, 26), 47), "VTOL")
)
"""By the kind of vehicle in the heartbeat; empty for a copter with several rotors, and the others are no copter."""
_NO_VEHICLES: Final = frozenset({6, 18, 26, 27, *range(30, 35), *range(36, 43), 44, 48, 49})
"""Kinds that are no vehicles: ground stations, companion computers, gimbals, cameras and other devices."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle in a log: its system and component, its autopilot, and the number of its kind."""

    system: int
    component: int
    autopilot: Autopilot
    kind: int

    @property
    def frame(self) -> str:
        """What it is, one of `OTHER_FRAMES`; empty if it is a copter with several rotors."""
        return _FRAMES.get(self.kind, "other")

    def sends(self, heartbeat: Message) -> bool:
        """Whether a heartbeat with its address is its own, and not of another program under this address."""
        return _claims(heartbeat) and int(heartbeat["autopilot"]) == self.autopilot.autopilot

    def is_asked(self, request: Message) -> bool:
        """Whether a request is for it, or for all vehicles."""
        system, component = (int(request.fields.get(name, 0)) for name in ("target_system", "target_component"))
        return system in (0, self.system) and component in (0, _USUAL_COMPONENT, self.component)


def find_vehicles(data: Contents) -> list[Vehicle]:
    """Every vehicle that reports its position, one of each system; first the one that does so most often. The best
    guess if none does. Raises TrajectoryError if there is no heartbeat of a known autopilot."""
    from pymavlink.dialects.v20 import minimal

    heard = Counter(
        (each.system, each.component, int(each["autopilot"]), int(each["type"]))
        for each in messages(data, minimal, {"HEARTBEAT"})
        if _claims(each)
    )
    claimed: dict[tuple[int, int], Vehicle] = {}
    for (system, component, autopilot, kind), _ in heard.most_common():
        claimed.setdefault((system, component), Vehicle(system, component, _AUTOPILOTS[autopilot], kind))
    if not claimed:
        known = ", ".join(autopilot.project or autopilot.title for autopilot in _AUTOPILOTS.values())
        raise refused(f"contains no MAVLink heartbeat of {known}", HINT)
    sent = Counter((each.system, each.component, each.message) for each in frames(data))

    def rank(each: Vehicle) -> tuple[int, bool, int]:
        reports = [sent[each.system, each.component, number] for number in _POSITIONS]
        return sum(map(bool, reports)), each.component == _USUAL_COMPONENT, reports[0]

    of_systems = {each.system: each for each in sorted(claimed.values(), key=rank)}
    first, *others = sorted(of_systems.values(), key=lambda each: rank(each)[::-1], reverse=True)
    return [first, *(each for each in others if rank(each)[-1])]


def _claims(heartbeat: Message) -> bool:
    """Whether the sender of a heartbeat claims to be a vehicle under a known autopilot."""
    return int(heartbeat["autopilot"]) in _AUTOPILOTS and int(heartbeat["type"]) not in _NO_VEHICLES
