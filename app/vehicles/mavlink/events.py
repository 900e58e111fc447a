"""Events and commands of a trial: inputs of the trial machine beside the measurements, and its outputs. SI units,
altitude and climb rate positive up; events carry their time.
"""

from collections.abc import Collection
from dataclasses import dataclass

from app.autopilots.commands import Action, Setting
from app.autopilots.measurements import DISARMING, CommandReply, Measurement, Parameter, Position
from app.vehicles.flight_end import StopRequest


def confirms_motors_off(measurement: Measurement | None, stop_settings: Collection[str]) -> bool:
    """Whether this confirms the command to stop the motors: it was accepted, or a stop setting was read back as set."""
    match measurement:
        case CommandReply(to=to, accepted=True):
            return to == DISARMING
        case Parameter(name=name, value=value):
            return name in stop_settings and value != 0.0
        case _:
            return False


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
