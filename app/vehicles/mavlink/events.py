"""Events and commands of a trial: what a vehicle's messages mean, whichever autopilot sent them, what else goes into
the trial machine, and what comes out of it. SI, altitude and climb positive up; events carry their time.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass, field
from enum import StrEnum
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


class Action(StrEnum):
    """What a vehicle is told to do, by whatever messages its autopilot wants."""

    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"
    MOTORS_OFF = "motors off"
    """On the ground: some autopilots refuse it in the air."""
    KILL = "stop its motors"
    """At any height."""


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter by its name on the vehicle, with the value to send."""

    parameter: str
    value: float


@dataclass(frozen=True, slots=True)
class Tick:
    now_s: float


@dataclass(frozen=True, slots=True)
class PacketReceived:
    """A packet from the vehicle; None where it measures nothing."""

    measurement: Measurement | None
    now_s: float


@dataclass(frozen=True, slots=True)
class AbortRequested:
    reason: str
    now_s: float


@dataclass(frozen=True, slots=True)
class MotorsOffRequested:
    """By a person, who has seen what the program has not: at any height."""

    reason: str
    now_s: float


@dataclass(frozen=True, slots=True)
class SecondaryAltitudeReceived:
    """The second source of altitude spoke. `altitude_m` is on the vehicle's datum; `is_new` where it really saw the
    vehicle, and not once more what it saw before."""

    altitude_m: float
    is_new: bool
    now_s: float


@dataclass(frozen=True, slots=True)
class DuplicateVehicleDetected:
    """Two vehicles speak under one system id; `why` says how that shows."""

    why: str
    now_s: float


@dataclass(frozen=True, slots=True)
class ActionDone:
    """The vehicle has taken what an action sends."""

    action: Action
    now_s: float


@dataclass(frozen=True, slots=True)
class ActionRefused:
    action: Action
    why: str
    now_s: float


@dataclass(frozen=True, slots=True)
class GainsRestored:
    """The safe gains were written and read back; `problem` says why not."""

    now_s: float
    problem: str = ""


Event = (
    Tick
    | PacketReceived
    | AbortRequested
    | MotorsOffRequested
    | SecondaryAltitudeReceived
    | DuplicateVehicleDetected
    | ActionDone
    | ActionRefused
    | GainsRestored
)


@dataclass(frozen=True, slots=True)
class PerformAction:
    action: Action


@dataclass(frozen=True, slots=True)
class SendGain:
    """Once, without waiting for an answer."""

    setting: Setting


@dataclass(frozen=True, slots=True)
class RestoreGains:
    """Write the safe gains and read them back, with repetitions."""


@dataclass(frozen=True, slots=True)
class RecordSample:
    """A sample that belongs to the record, with what it was to be, and where the second source saw the vehicle."""

    position: Position
    set_point_m: float
    battery_v: float | None
    second_m: float | None = None


Command = PerformAction | SendGain | RestoreGains | RecordSample
