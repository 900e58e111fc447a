"""Events and commands of a trial: autopilot-independent measurements from a vehicle's messages, other inputs of the
trial machine, and its outputs. SI units, altitude and climb rate positive up; events carry their time.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from app.vehicles.flight_end import StopRequest

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


def confirms_motors_off(measurement: Measurement | None, stop_settings: Collection[str]) -> bool:
    """Whether this confirms the command to stop the motors: it was accepted, or a stop setting was read back as set."""
    match measurement:
        case CommandReply(to=to, accepted=True):
            return to == DISARMING
        case Parameter(name=name, value=value):
            return name in stop_settings and value != 0.0
        case _:
            return False


class Action(StrEnum):
    """Actions of a vehicle, independent of the messages that its autopilot needs for them."""

    ARM = "arm"
    TAKE_OFF = "take off"
    HOLD = "hold its first set point"
    """By position targets, which it follows from now on."""
    FLY_TO = "fly to its next set point"
    LAND = "land"
    MOTORS_OFF = "motors off"
    """On the ground only: some autopilots refuse it in flight."""
    KILL = "stop its motors"
    """At any height."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Parameter name on the vehicle and the value to send."""

    parameter: str
    value: float


@dataclass(frozen=True, slots=True)
class ModeParameter:
    """Parameter that holds the vehicle's mode: `flying` is its value in flight, `modes` are others, named as in
    Heartbeat."""

    name: str
    flying: float
    modes: Mapping[float, str]


@dataclass(frozen=True, slots=True)
class Tick:
    now_s: float


@dataclass(frozen=True, slots=True)
class PacketReceived:
    """A packet from the vehicle; `measurement` is None if it contains none."""

    measurement: Measurement | None
    now_s: float


@dataclass(frozen=True, slots=True)
class StopRequested:
    request: StopRequest
    now_s: float


@dataclass(frozen=True, slots=True)
class SecondaryAltitudeReceived:
    """Sample of the second source of altitude. `altitude_m` is on the vehicle's datum; `is_new` is false if the sample
    repeats an old one or the vehicle is not tracked."""

    altitude_m: float
    is_new: bool
    now_s: float


@dataclass(frozen=True, slots=True)
class DuplicateVehicleDetected:
    """Two vehicles use the same system id; `why` is the evidence."""

    why: str
    now_s: float


@dataclass(frozen=True, slots=True)
class ActionDone:
    """The vehicle has acknowledged all messages of an action. `sent_s` are the times at which the last message was
    sent, `replied_s` is the time at which its reply was received; None without a reply."""

    action: Action
    now_s: float
    sent_s: tuple[float, ...] = ()
    replied_s: float | None = None


@dataclass(frozen=True, slots=True)
class ActionRefused:
    action: Action
    why: str
    now_s: float


@dataclass(frozen=True, slots=True)
class SetPointsPaused:
    """The stream of set points, which some autopilots must receive, was not sent for so long, s."""

    paused_s: float
    now_s: float


@dataclass(frozen=True, slots=True)
class GainsRestored:
    """The safe gains were written and read back; otherwise `problem` is the reason."""

    now_s: float
    problem: str = ""


Event = (
    Tick
    | PacketReceived
    | StopRequested
    | SecondaryAltitudeReceived
    | DuplicateVehicleDetected
    | ActionDone
    | ActionRefused
    | SetPointsPaused
    | GainsRestored
)


@dataclass(frozen=True, slots=True)
class PerformAction:
    """Carry out an action; `altitude_m` is the altitude to fly to, on the vehicle's datum, with this acceleration fed
    forward, up."""

    action: Action
    altitude_m: float | None = None
    acceleration_m_s2: float = 0.0


@dataclass(frozen=True, slots=True)
class WithdrawSetPoint:
    """Send nothing more of the action in progress, and no more set points: a pilot may be flying."""


@dataclass(frozen=True, slots=True)
class SendGain:
    """Send a gain once, without waiting for a reply."""

    setting: Setting


@dataclass(frozen=True, slots=True)
class RequestGain:
    """Request a gain once, without waiting for the reply, which confirms that all earlier messages were received."""

    parameter: str


@dataclass(frozen=True, slots=True)
class RestoreGains:
    """Write the safe gains and read them back, with repetitions."""


@dataclass(frozen=True, slots=True)
class RecordSample:
    """A sample of the record, with its set point, the altitude of the second source, and if known the throttle and the
    autopilot's own reference. Altitudes are on the vehicle's datum."""

    position: Position
    set_point_m: float
    battery_v: float | None
    second_m: float | None = None
    throttle: float | None = None
    reference_m: float | None = None


Command = PerformAction | WithdrawSetPoint | SendGain | RequestGain | RestoreGains | RecordSample
