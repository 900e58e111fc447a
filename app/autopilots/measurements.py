"""Measurements: what a message of a vehicle says, whatever its autopilot. SI units, altitude and climb rate up."""

import math
from dataclasses import dataclass, field
from typing import Final

DISARMING: Final = "command 400"
"""`CommandReply.to` of a reply to arming and disarming."""


@dataclass(frozen=True, slots=True)
class Position:
    """Position by the vehicle's own clock and origin; `climb_rate_m_s` is the vehicle's own estimate."""

    time_boot_s: float
    altitude_m: float
    climb_rate_m_s: float
    north_m: float = 0.0
    east_m: float = 0.0

    def away_m(self, start: "Position") -> float:
        """Return the horizontal distance from `start`."""
        return math.hypot(self.north_m - start.north_m, self.east_m - start.east_m)


@dataclass(frozen=True, slots=True)
class InvalidPosition:
    """A position by the vehicle's clock with a value that is not finite: no sample, but its clock advances."""

    time_boot_s: float


@dataclass(frozen=True, slots=True)
class Attitude:
    """Attitude of the vehicle by its lean: roll and pitch as one angle, rad."""

    lean_rad: float


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """Heartbeat of an autopilot with its MAVLink `system` and `component`. `mode` is the autopilot's mode number as
    text, `autopilot` a MAV_AUTOPILOT."""

    autopilot: int
    armed: bool
    mode: str
    system: int = 0
    component: int = 0


@dataclass(frozen=True, slots=True)
class Battery:
    """Battery voltage, and from the same message whether the vehicle's own checks allow arming; None if unknown."""

    voltage_v: float | None
    may_arm: bool | None = None


@dataclass(frozen=True, slots=True)
class Throttle:
    """Throttle as the vehicle reports it: a `share` of full, 0 … 1; `exact`: not in whole percents."""

    share: float
    exact: bool = False


@dataclass(frozen=True, slots=True)
class AltitudeError:
    """How far the autopilot's own reference is above the vehicle."""

    error_m: float


@dataclass(frozen=True, slots=True)
class TargetAltitude:
    """Altitude of the position target that the autopilot follows."""

    altitude_m: float


@dataclass(frozen=True, slots=True)
class StatusText:
    """A status text, or of a longer one (with a `number`) the chunk at this `place`."""

    text: str
    number: int = 0
    place: int = 0
    is_last: bool = True


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter's value, with its `place` among the `count` in the vehicle's list if reported; not compared."""

    name: str
    value: float
    place: int | None = field(default=None, compare=False)
    count: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class CommandReply:
    """The vehicle's reply to a request: `to` is "command 400" or "waypoint"."""

    to: str
    accepted: bool
    why: str = ""


@dataclass(frozen=True, slots=True)
class FenceBreach:
    """The vehicle has crossed its own fence; `limit` names which limit, if reported."""

    limit: str = ""


@dataclass(frozen=True, slots=True)
class LandedState:
    """Whether the vehicle reports that it is on the ground."""

    on_ground: bool


@dataclass(frozen=True, slots=True)
class BlockCount:
    """Number of blocks in Paparazzi's flight plan."""

    count: int


@dataclass(frozen=True, slots=True)
class Block:
    """One block of Paparazzi's flight plan."""

    number: int
    name: str


@dataclass(frozen=True, slots=True)
class BlockEntered:
    """Paparazzi's flight plan has entered another block."""

    number: int


@dataclass(frozen=True, slots=True)
class Version:
    """Version of the autopilot's firmware, and its hardware id; either is empty if not reported."""

    version: str
    uid: str = ""


@dataclass(frozen=True, slots=True)
class VehicleEvent:
    """One event of MAVLink's events interface; the meaning of its `arguments` depends on its `number`."""

    number: int
    sequence: int
    arguments: bytes


Measurement = (
    Position
    | InvalidPosition
    | Attitude
    | Heartbeat
    | Battery
    | Throttle
    | AltitudeError
    | TargetAltitude
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
