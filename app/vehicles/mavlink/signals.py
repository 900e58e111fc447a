"""What goes into the machine of a trial and what comes out of it: events, which carry their time, and commands."""

from dataclasses import dataclass
from enum import StrEnum

from app.vehicles.mavlink.measurements import Measurement, Position


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
