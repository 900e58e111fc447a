"""Flight plan of the simulated Paparazzi with its blocks and waypoints, and the settings of the AR.Drone 2 airframe in
order, with their values after the start.

Setting names are the C variables' truncated to 16 characters; a name of 16 characters is never found by a request.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Final

from app.autopilots.simulated.copter_parameters import Kind, Parameters, read_parameters
from app.core.control.vertical_guidance import INT32_MAX, INT32_MIN

DESCENT_M_S: Final = 0.8
LANDED_AFTER_S: Final = 3.0
"""Value in this program's flight plan. Plans without such a guard stop the thrust of a vehicle that is commanded to
land in the first second, before it counts as flying."""
DEFAULT_ALTITUDE_M: Final = 2.0
MAX_DISTANCE_M: Final = 50.0
"""max_dist_from_home: greatest distance from HOME, the origin, at which blocks are flown."""
HOME_HEIGHT_M: Final = 1.0
"""Height of the waypoint HOME, to which it flies back and where it stays."""

CLIMB: Final = 2
WAYPOINTS: Final = ("dummy", "HOME", "CLIMB", "STDBY", "p1", "p2", "p3", "p4", "CAM", "TD")
"""Waypoints by index. Their names are not transmitted."""


class Vertical(Enum):
    """Vertical mode of a block."""

    THROTTLE = "no thrust"
    WAYPOINT = "the altitude of its waypoint"
    DESCEND = "down at DESCENT_M_S until it no longer flies"


@dataclass(frozen=True, slots=True)
class Block:
    """One block. Entering it starts or stops the `motors`, or leaves them as they are (None). `after` is the block that
    follows after `lasts_s`, if any, and not before there is a position if it `waits`; `landed` the one that follows
    when the vehicle no longer flies. `max_time_s`, `max_height_m` (local z, up) and `max_distance_m` (along an axis
    from HOME) are exceptions that lead to "land here"."""

    name: str
    vertical: Vertical = Vertical.WAYPOINT
    waypoint: str = "STDBY"
    motors: bool | None = None
    after: str | None = None
    lasts_s: float = 0.0
    waits: bool = False
    landed: str | None = None
    max_time_s: float = float("inf")
    max_height_m: float = float("inf")
    max_distance_m: float = float("inf")


BLOCKS: Final = (
    Block("Wait GPS", Vertical.THROTTLE, motors=False, after="Geo init", waits=True),
    Block("Geo init", Vertical.THROTTLE, motors=False, after="Holding point", lasts_s=10.0),
    Block("Holding point", Vertical.THROTTLE, motors=False),
    Block("Start Engine", Vertical.THROTTLE, motors=True),
    Block("Takeoff", waypoint="CLIMB", max_time_s=45.0, max_height_m=4.5, max_distance_m=8.0),
    Block("Standby"),
    Block("stay_p1", waypoint="p1"),
    Block("go_p2", waypoint="p2"),
    Block("line_p1_p2", waypoint="p1"),
    Block("route", waypoint="p1"),
    Block("Oval", waypoint="p1"),
    Block("test yaw", waypoint="p1"),
    Block("circle CAM", waypoint="CAM"),
    Block("land here", waypoint="TD", after="land"),
    Block("land", waypoint="TD", after="flare"),
    Block("flare", Vertical.DESCEND, landed="landed"),
    Block("landed", Vertical.THROTTLE),
    Block("HOME", waypoint="HOME"),
)
"""The plan's blocks in order; of blocks with horizontal figures only the height is flown."""

BY_NAME: Final = {block.name: seq for seq, block in enumerate(BLOCKS)}
GEO_INIT: Final = BY_NAME["Geo init"]
LAND_HERE: Final = BY_NAME["land here"]
TAKEOFF: Final = BY_NAME["Takeoff"]


class FlightPlan:
    """Current block of the plan."""

    def __init__(self, *, landed_after_s: float) -> None:
        """Begin in the first block; `landed_after_s` is the minimum time of descent before a landing is detected."""
        self._landed_after_s = landed_after_s
        self.seq = 0
        self.time_s = 0.0
        """Time since the block was entered, s."""
        self.altitudes_m = dict.fromkeys(WAYPOINTS, DEFAULT_ALTITUDE_M)
        """Of the waypoints, in the local frame."""

    @property
    def block(self) -> Block:
        return BLOCKS[self.seq]

    def enter(self, seq: int, height_m: float) -> None:
        """Enter a block at this height (local frame, up); a number past the end means the last one."""
        self.seq = min(seq, len(BLOCKS) - 1)
        self.time_s = 0.0
        if self.seq == LAND_HERE:
            self.altitudes_m["TD"] = height_m

    def next(
        self, elapsed_s: float, height_m: float, distance_m: float, *, flies: bool, has_position: bool
    ) -> int | None:
        """Advance time in the block; return the next block if the plan leaves this one. `distance_m` is from HOME."""
        self.time_s += elapsed_s
        block = self.block
        if block.after is not None and self.time_s >= block.lasts_s and (has_position or not block.waits):
            return BY_NAME[block.after]
        if block.landed is not None and not flies and self.time_s > self._landed_after_s:
            return BY_NAME[block.landed]
        is_over = self.time_s > block.max_time_s or height_m > block.max_height_m or distance_m > block.max_distance_m
        return LAND_HERE if is_over else None


NAME_LIMIT: Final = 16
KILL_SETTING: Final = "kil_thr"
NEWER_KILL_SETTING: Final = "aut_kil_thr"
"""Name in a source tree of 2017 (version 5.10), in which the variables are in one structure."""


def held(kind: Kind, value: float) -> float:
    """Return a value as held in the autopilot's variable."""
    if kind is Kind.REAL32:
        return value
    return float(min(max(math.trunc(value), INT32_MIN), INT32_MAX)) if math.isfinite(value) else float(INT32_MIN)


def settings(kill_setting: str) -> Parameters:
    """Return the settings with their values after the start; `kill_setting` is this release's name of the one that
    stops the throttle, empty if there is none."""
    known = read_parameters(Path(__file__).parent / "simulated_settings.csv")
    named = (replace(each, name=kill_setting) if each.name == KILL_SETTING else each for each in known)
    return Parameters([each for each in named if each.name], longest_name=NAME_LIMIT - 1)
