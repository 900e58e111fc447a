"""Messages between the worker and a process that flies a vehicle, whichever kind of process that is; one of them is the
vehicle's status, with its readiness for the flight that it waits for.

    worker    FlightRequest →             → TakeOffDecision →
    process                   GainsStaged →   Telemetry … FlightLanded → SafeGainsRestored → FlightFinished

`CancelFlight` may come at any moment; `FlightFailure` takes the place of the messages that do not come.
"""

import datetime as dt
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from app.autopilots.registry import get_experiment
from app.common.states import ActKind, FlightMode
from app.core.clock import REAL_TIME, Clock
from app.core.experiments.base import Experiment
from app.live.messages import (
    SILENT_AFTER_S,
    FlightPhase,
    Telemetry,
    UnreadyReason,
    VehicleCommandKind,
    VehicleStatus,
)
from app.vehicles.base import (
    CheckItem,
    Condition,
    ConnectedVehicle,
    ConnectionOpened,
    FlightOptions,
    FlightRecord,
    Identity,
    LinkedVehicle,
    OptionValue,
)
from app.vehicles.flight_end import StopRequest


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRequest:
    """One flight, from its row to the vehicle: all that a worker and the process that flies it need of the database.

    `speed`: how many times faster than real time a simulation flies, None for as fast as possible. A flight of mode
    `stage` waits, once its gains are read back, for its operator's takeoff request.
    """

    flight_id: int
    trial_id: int
    campaign_id: int
    experiment: str
    vehicle_id: int
    vehicle_kind: str
    vehicle_options: Mapping[str, OptionValue]
    safe_gains: Mapping[str, float]
    gains: Mapping[str, float]
    seed: int
    experiment_options: Mapping[str, OptionValue] = field(default_factory=dict)
    speed: float | None = None
    mode: FlightMode = "fly"

    @property
    def configured_experiment(self) -> Experiment:
        """The experiment with its settings."""
        return get_experiment(self.experiment, self.experiment_options)

    def options(self, clock: Clock) -> FlightOptions:
        experiment = self.configured_experiment
        options = FlightOptions(seed=self.seed, speed=self.speed, clock=clock, window_s=experiment.window_s)
        return options if experiment.set_points is None else replace(options, set_points=experiment.set_points)


@dataclass(frozen=True, slots=True)
class GainsStaged:
    """From the process, which then waits for TakeOffDecision."""

    read_back: dict[str, float]


@dataclass(frozen=True, slots=True)
class TakeOffDecision:
    """To the process: the gains are verified and the lift-off is recorded, so take off, but not after `by_s` of this
    computer's monotonic clock, s; None: this flight does not take place."""

    by_s: float | None


@dataclass(frozen=True, slots=True)
class CancelFlight:
    """To the process, at any moment: end this flight now. A vehicle that has not taken off stays on the ground."""

    trial_id: int
    request: StopRequest


@dataclass(frozen=True, slots=True)
class StagingLost:
    """From the process, while it waits for the takeoff: why the vehicle no longer holds the staged gains."""

    why: str


@dataclass(frozen=True, slots=True)
class FlightLanded:
    """From the process: the flight's record."""

    record: FlightRecord


@dataclass(frozen=True, slots=True)
class SafeGainsRestored:
    """From the process, however the flight ended: the safe gains were written, and these were read back."""

    held: dict[str, float]


@dataclass(frozen=True, slots=True)
class FlightFailure:
    """From the process: what went wrong.

    `unsafe`: the safe gains could not be verified afterwards. `not_flown`: no takeoff command was sent to the vehicle.
    """

    what: str
    unsafe: bool
    not_flown: bool = False


@dataclass(frozen=True, slots=True)
class FlightFinished:
    """From the process: this flight is over, and the process is free for the next."""


FlightMessage = (
    GainsStaged | Telemetry | FlightPhase | FlightLanded | SafeGainsRestored | FlightFailure | FlightFinished
)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionRequest:
    """What the process needs to connect to a vehicle.

    `keep_retrying`: retry until the vehicle answers. The vehicle's lock, its telemetry logs and the parameters that a
    trial changes are in `data_dir`.
    """

    vehicle: LinkedVehicle
    data_dir: Path
    keep_retrying: bool = False
    clock: Clock = REAL_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleRequest:
    """To the process: carry out this act, for a vehicle with these safe gains."""

    kind: ActKind
    safe_gains: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleResponse:
    """From the process: outcome of an act; `problem` when it failed. `held` are the gains as last read back."""

    problem: str = ""
    concern: str = ""
    held: dict[str, float] = field(default_factory=dict)
    checks: tuple[CheckItem, ...] | None = None
    parameters: dict[str, float] | None = None
    identity: Identity | None = None


@dataclass(frozen=True, slots=True)
class VehicleCommand:
    """To the process, at any moment: land, or motors off.

    `words` are those of who asked, if any. Not to be carried out after `by_s` of this computer's monotonic clock, s.
    `number` tells the commands of a connection apart.
    """

    number: int
    order: VehicleCommandKind
    words: str
    by_s: float


@dataclass(frozen=True, slots=True)
class CommandForwarded:
    """From the process: a command was forwarded to the vehicle; `problem` when it could not be, or when the vehicle did
    not confirm it. `is_awaited`: another such message tells whether the vehicle has confirmed it."""

    command: VehicleCommand
    problem: str = ""
    is_awaited: bool = False


FromVehicleProcess = ConnectionOpened | VehicleResponse | CommandForwarded | VehicleStatus | StagingLost | FlightMessage
ToVehicleProcess = FlightRequest | TakeOffDecision | CancelFlight | VehicleRequest | VehicleCommand

Staging = Literal["none", "staged", "silent", "lost"]
"""Of the flight that waits for its takeoff: nothing staged, the staged gains read back, a silence since then, or the
gains no longer on the vehicle."""

LOST_AFTER_S: Final = 3.0
"""A vehicle without a heartbeat for this long is shown as gone."""


def status_of(vehicle_id: int, vehicle: ConnectedVehicle, staging: Staging, *, speed: float) -> VehicleStatus:
    """The vehicle's status now, its ages in the time of the ground; `speed` is that of its clock."""
    known = vehicle.condition()
    age_s = _in_ground_time(known.heartbeat_age_s, speed)
    condition = replace(
        known,
        packet_age_s=_in_ground_time(known.packet_age_s, speed),
        heartbeat_age_s=age_s,
        said_age_s=_in_ground_time(known.said_age_s, speed),
        held=dict(known.held),
    )
    return VehicleStatus(
        vehicle_id=vehicle_id,
        state="gone" if age_s is None or age_s > LOST_AFTER_S else "connected",
        at=status_time(),
        concern=vehicle.concern,
        unready=_unready(condition, staging),
        **asdict(condition),
    )


def is_silent(condition: Condition) -> bool:
    """Whether nothing was received from the vehicle for long."""
    return condition.packet_age_s is None or condition.packet_age_s > SILENT_AFTER_S


def status_time() -> str:
    """The present time as a VehicleStatus has it."""
    return dt.datetime.now(dt.UTC).isoformat()


def _unready(condition: Condition, staging: Staging) -> UnreadyReason:
    is_blind = staging == "staged" and not condition.position_hz
    if staging == "silent" or is_blind or is_silent(condition):
        return "link silent"
    return "gains unknown" if staging == "lost" or not condition.held else ""


def _in_ground_time(age_s: float | None, speed: float) -> float | None:
    return None if age_s is None else age_s / speed
