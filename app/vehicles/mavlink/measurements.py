"""What a vehicle's messages mean, whichever autopilot sent them: SI, altitude and climb positive up."""

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Final

DISARMING: Final = "command 400"
"""What an answer to arming and disarming refers to (`Reply.to`)."""


@dataclass(frozen=True, slots=True)
class Position:
    """By the vehicle's own clock and origin; `climb_rate_m_s` is the vehicle's own estimate."""

    time_boot_s: float
    altitude_m: float
    climb_rate_m_s: float
    north_m: float = 0.0
    east_m: float = 0.0

    def away_m(self, start: "Position") -> float:
        """How far it is from there, horizontally."""
        return math.hypot(self.north_m - start.north_m, self.east_m - start.east_m)


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """Of an autopilot, by its MAVLink `system` and `component`. `mode` in its own numbers, as text; `autopilot` is
    MAVLink's number of its make."""

    autopilot: int
    armed: bool
    mode: str
    system: int = 0
    component: int = 0


@dataclass(frozen=True, slots=True)
class Battery:
    """None where the vehicle does not know. `may_arm`: whether its own checks would let it be armed, told beside."""

    voltage_v: float | None
    may_arm: bool | None = None


@dataclass(frozen=True, slots=True)
class StatusText:
    """A line of text from the vehicle; of a longer one (with a `number`) the piece that has this `place`."""

    text: str
    number: int = 0
    place: int = 0
    is_last: bool = True


@dataclass(frozen=True, slots=True)
class Parameter:
    """`place` of `count` in the vehicle's own list, where it is told; the same parameter with or without."""

    name: str
    value: float
    place: int | None = field(default=None, compare=False)
    count: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class CommandReply:
    """The vehicle's answer to what was asked: `to` is "command 400" or "waypoint"."""

    to: str
    accepted: bool
    why: str = ""


@dataclass(frozen=True, slots=True)
class FenceBreach:
    """The vehicle's own fence was crossed; which limit of it, where it is told."""

    limit: str = ""


@dataclass(frozen=True, slots=True)
class LandedState:
    """Whether the vehicle itself believes to be on the ground."""

    on_ground: bool


@dataclass(frozen=True, slots=True)
class BlockCount:
    """How many blocks Paparazzi's flight plan has."""

    count: int


@dataclass(frozen=True, slots=True)
class Block:
    """One block of Paparazzi's flight plan."""

    number: int
    name: str


@dataclass(frozen=True, slots=True)
class BlockEntered:
    """Paparazzi's flight plan has come to another block."""

    number: int


@dataclass(frozen=True, slots=True)
class Version:
    """What the autopilot's firmware calls itself, and its hardware's own id; either empty where it is not told."""

    version: str
    uid: str = ""


@dataclass(frozen=True, slots=True)
class VehicleEvent:
    """One event of MAVLink's events interface; what its `arguments` mean depends on its `number`."""

    number: int
    sequence: int
    arguments: bytes


Measurement = (
    Position
    | Heartbeat
    | Battery
    | StatusText
    | Parameter
    | CommandReply
    | FenceBreach
    | LandedState
    | BlockCount
    | Block
    | BlockEntered
    | Version
    | VehicleEvent
)


def confirms_motors_off(measurement: Measurement | None, stop_settings: Collection[str]) -> bool:
    """Whether it answers the order to stop the motors: the command accepted, or a setting that stops them read back."""
    match measurement:
        case CommandReply(to=to, accepted=True):
            return to == DISARMING
        case Parameter(name=name, value=value):
            return name in stop_settings and value != 0.0
        case _:
            return False
