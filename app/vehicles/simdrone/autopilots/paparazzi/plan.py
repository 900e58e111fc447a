"""The flight plan: blocks, waypoints, and how one block follows another."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

DESCENT_M_S: Final = 0.8
LANDED_AFTER_S: Final = 3.0
"""By this program's flight plan. Plans without such a guard stop the thrust of a vehicle that is told to land in the
first second, before it counts as flying."""
DEFAULT_ALTITUDE_M: Final = 2.0
MAX_DISTANCE_M: Final = 50.0
"""max_dist_from_home: farther than that from HOME, the origin, no block is flown any more."""
HOME_HEIGHT_M: Final = 1.0
"""home_mode_height: at which it flies back then, and stays."""

CLIMB: Final = 2
WAYPOINTS: Final = ("dummy", "HOME", "CLIMB", "STDBY", "p1", "p2", "p3", "p4", "CAM", "TD")
"""By index. Their names are not transmitted."""


class Vertical(Enum):
    """What a block does with height."""

    THROTTLE = "no thrust"
    WAYPOINT = "the altitude of its waypoint"
    DESCEND = "down at DESCENT_M_S until it no longer flies"


class Engine(Enum):
    """What entering a block does with the motors."""

    LEAVE = "nothing"
    KILL = "stop"
    RESURRECT = "start"


@dataclass(frozen=True, slots=True)
class Block:
    """One block. `after` is the block that follows at once, where it only passes through; `landed` the one that
    follows when the vehicle no longer flies. `max_time_s`, `max_height_m` (local z, up) and `max_distance_m` (along an
    axis from HOME) are exceptions that lead to "land here"."""

    name: str
    vertical: Vertical = Vertical.WAYPOINT
    waypoint: str = "STDBY"
    engine: Engine = Engine.LEAVE
    after: str | None = None
    landed: str | None = None
    max_time_s: float = float("inf")
    max_height_m: float = float("inf")
    max_distance_m: float = float("inf")

    def is_over(self, time_s: float, height_m: float, distance_m: float) -> bool:
        """Whether one of its exceptions holds."""
        return time_s > self.max_time_s or height_m > self.max_height_m or distance_m > self.max_distance_m


BLOCKS: Final = (
    Block("Wait GPS", Vertical.THROTTLE, engine=Engine.KILL, after="Geo init"),
    Block("Geo init", Vertical.THROTTLE, engine=Engine.KILL, after="Holding point"),
    Block("Holding point", Vertical.THROTTLE, engine=Engine.KILL),
    Block("Start Engine", Vertical.THROTTLE, engine=Engine.RESURRECT),
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
"""The plan's blocks in order; the horizontal figures of some are not flown, only their height."""

BY_NAME: Final = {block.name: seq for seq, block in enumerate(BLOCKS)}
LAND_HERE: Final = BY_NAME["land here"]
TAKEOFF: Final = BY_NAME["Takeoff"]
HOLDING_POINT: Final = BY_NAME["Holding point"]


class FlightPlan:
    """Where in the plan the vehicle is."""

    def __init__(self, *, landed_after_s: float) -> None:
        """`landed_after_s`: how long it descends before it may believe to have landed."""
        self._landed_after_s = landed_after_s
        self.seq = HOLDING_POINT
        self.time_s = 0.0
        """Since the block was entered."""
        self.altitudes_m = dict.fromkeys(WAYPOINTS, DEFAULT_ALTITUDE_M)

    @property
    def block(self) -> Block:
        return BLOCKS[self.seq]

    @property
    def target_m(self) -> float:
        """The altitude of the block's waypoint, in the local frame."""
        return self.altitudes_m[self.block.waypoint]

    def enter(self, seq: int, height_m: float) -> None:
        """Go to a block at this height (local frame, up); a number past the end means the last one."""
        self.seq = min(seq, len(BLOCKS) - 1)
        self.time_s = 0.0
        if self.seq == LAND_HERE:
            self.altitudes_m["TD"] = height_m

    def next(self, elapsed_s: float, height_m: float, distance_m: float, *, flies: bool) -> int | None:
        """Let time pass in the block, so far from HOME; the block that the plan leads to, if to another."""
        self.time_s += elapsed_s
        block = self.block
        if block.after is not None:
            return BY_NAME[block.after]
        if block.landed is not None and not flies and self.time_s > self._landed_after_s:
            return BY_NAME[block.landed]
        return LAND_HERE if block.is_over(self.time_s, height_m, distance_m) else None
