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
from app.core.reasons import UNNAMED_FRAME
from app.logs.base import Contents, refused
from app.logs.tlog import Message, frames, messages

HINT: Final = (
    "Use a .tlog with the vehicle's heartbeats and LOCAL_POSITION_NED or GLOBAL_POSITION_INT from before the takeoff; "
    "it should also contain the ground station's commands."
)
_AUTOPILOTS: Final = {each.autopilot: each for each in AUTOPILOTS.values()}
"""By the autopilot number in the heartbeat."""
_POSITIONS: Final = (32, 33, 30)
"""LOCAL_POSITION_NED, GLOBAL_POSITION_INT, ATTITUDE."""
_FEW: Final = 10
"""If there are so many times more positions above home, those in the vehicle's own frame are the rest of a test."""
_USUAL_COMPONENT: Final = 1
_FRAMES: Final[Mapping[int, str]] = MappingProxyType(
    {0: "", 2: "quadrotor", 3: "coaxial", 13: "hexarotor", 14: "octorotor", 15: "tricopter", 29: "decarotor"}
    | {35: "dodecarotor", 43: ""}
    | {1: "plane", 4: "helicopter", 5: "tracker", 7: "airship", 10: "rover", 11: "boat", 12: "submarine"}
    | dict.fromkeys((*range(19, 26), 47), "VTOL")
)
"""By the kind of vehicle in the heartbeat; first those of copters with several rotors, or of any kind."""
_NO_VEHICLES: Final = frozenset({6, 18, 26, 27, *range(30, 35), *range(36, 43), 44, 48, 49})
"""Kinds that are no vehicles: ground stations, companion computers, gimbals, cameras and other devices."""


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A vehicle in a log: its system and component, its autopilot, the number of its kind, and how often it reports
    each of `_POSITIONS`."""

    system: int
    component: int
    autopilot: Autopilot
    kind: int
    reports: tuple[int, ...]

    @property
    def frame(self) -> str:
        """What it is, one of `OTHER_FRAMES` if it is no copter with several rotors; empty if it does not tell."""
        return _FRAMES.get(self.kind, UNNAMED_FRAME)

    @property
    def has_own_frame(self) -> bool:
        """Whether it reports its position there, and not above home alone, or nearly."""
        return _FEW * self.reports[0] >= self.reports[1]

    def sends(self, heartbeat: Message) -> bool:
        """Whether a heartbeat with its address is its own, and not of another program under this address."""
        return _claims(heartbeat) and int(heartbeat["autopilot"]) == self.autopilot.autopilot

    def is_asked(self, request: Message) -> bool:
        """Whether a request is for it, or for all vehicles."""
        system, component = (int(request.fields.get(name, 0)) for name in ("target_system", "target_component"))
        return system in (0, self.system) and component in (0, _USUAL_COMPONENT, self.component)


def find_vehicles(data: Contents) -> list[Vehicle]:
    """Every vehicle that reports its position, one of each system; first the one that does so most often. The best
    guess if none does. A ground station may report its own above home, but no attitude. Raises TrajectoryError if there
    is no heartbeat of a known autopilot."""
    from pymavlink.dialects.v20 import minimal

    heard = Counter(
        (each.system, each.component, int(each["autopilot"]), int(each["type"]))
        for each in messages(data, minimal, {"HEARTBEAT"})
        if _claims(each)
    )
    sent = Counter((each.system, each.component, each.message) for each in frames(data))
    claimed: dict[tuple[int, int], Vehicle] = {}
    for (system, component, autopilot, kind), _ in heard.most_common():
        reports = tuple(sent[system, component, number] for number in _POSITIONS)
        claimed.setdefault((system, component), Vehicle(system, component, _AUTOPILOTS[autopilot], kind, reports))
    if not claimed:
        known = ", ".join(autopilot.project or autopilot.title for autopilot in _AUTOPILOTS.values())
        raise refused(f"contains no MAVLink heartbeat of {known}", HINT)

    def rank(each: Vehicle) -> tuple[int, bool, int]:
        often = each.reports[0 if each.has_own_frame else 1]
        return sum(map(bool, each.reports)), each.component == _USUAL_COMPONENT, often

    of_systems = {each.system: each for each in sorted(claimed.values(), key=rank)}
    ordered = sorted(of_systems.values(), key=lambda each: rank(each)[::-1], reverse=True)
    return [each for each in ordered if each.reports[0] or all(each.reports[1:])] or ordered[:1]


def _claims(heartbeat: Message) -> bool:
    """Whether the sender of a heartbeat claims to be a vehicle under a known autopilot."""
    return int(heartbeat["autopilot"]) in _AUTOPILOTS and int(heartbeat["type"]) not in _NO_VEHICLES
