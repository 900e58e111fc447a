"""What the worker and the web process say to each other: one JSON object a line, told apart by `type`."""

from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Annotated, Final, Literal

from app.core.errors import InputError
from app.vehicles.base import Condition

if TYPE_CHECKING:
    from pydantic import TypeAdapter

MAX_LINE_BYTES: Final = 256 * 1024
NO_LINK: Final = "No worker has a link to this vehicle, so it was told nothing: use its own remote control now."

Phase = Literal["staging", "staged", "flying", "landed", "ended"]
VehicleLinkState = Literal["connecting", "connected", "gone", "not answering"]
VehicleCommandKind = Literal["land", "motors off"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """What was measured since the last message of this flight: rows of `columns`, the first of which is the seconds
    since the command and the second the scored channel. `error_so_far` is the error up to `time_s`, in the experiment's
    unit; None until the first scored sample. `age_s` is how long ago the worker said it: of what a stream that joins
    late is told once more."""

    campaign_id: int
    trial_id: int
    time_s: float
    columns: list[str]
    samples: list[list[float]]
    error_so_far: float | None
    age_s: float = 0.0
    type: Literal["telemetry"] = "telemetry"


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPhase:
    """A flight has moved on. It may run ahead of the database, which stays the record; `note` says what a person ought
    to know meanwhile."""

    campaign_id: int
    trial_id: int
    phase: Phase
    note: str = ""
    type: Literal["phase"] = "phase"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStatus(Condition):
    """How a vehicle with a link of its own is; `at` is UTC in ISO 8601. While nothing of it is heard the state is
    `gone`, and `not answering` while the process that has its link tells nothing; the rest is as last heard then, and
    `trouble` says what the latter means. `concern` says why it may only be observed; empty when it may fly. `age_s` as
    in `Telemetry`; the other ages are as they were when it was said."""

    vehicle_id: int
    state: VehicleLinkState
    at: str
    concern: str = ""
    age_s: float = 0.0
    type: Literal["vehicle"] = "vehicle"


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerHello:
    """First line of the worker to every client: who it is and what it flies."""

    pid: int
    version: str
    flying: list[int] = field(default_factory=list)
    type: Literal["worker"] = "worker"


@dataclass(frozen=True, slots=True, kw_only=True)
class Abort:
    """End this trial's flight now: safe gains, land. `request` comes back in the answer. After `by_s` of the computer's
    monotonic clock it is not carried out any more, and whoever asked is told that it could not be."""

    request: int
    trial_id: int
    reason: str
    by_s: float
    type: Literal["abort"] = "abort"


@dataclass(frozen=True, slots=True, kw_only=True)
class AbortAnswer:
    """`accepted` is False when the worker is not flying that trial."""

    request: int
    trial_id: int
    accepted: bool
    type: Literal["abort answer"] = "abort answer"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOrder:
    """Have this vehicle land, or stop its motors at any height, now and whatever it does. `request` and `by_s` as in
    `Abort`."""

    request: int
    vehicle_id: int
    order: VehicleCommandKind
    reason: str
    by_s: float
    type: Literal["order"] = "order"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOrderAnswer:
    """`accepted` once the process that has the vehicle's link has passed the order on; `problem` says why it was not,
    and then it is not carried out later."""

    request: int
    vehicle_id: int
    accepted: bool
    problem: str = ""
    type: Literal["order answer"] = "order answer"


@dataclass(frozen=True, slots=True, kw_only=True)
class Ping:
    """Asked of the worker again and again: one that hangs does not answer."""

    request: int
    type: Literal["ping"] = "ping"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pong:
    request: int
    type: Literal["pong"] = "pong"


PublishedMessage = Telemetry | FlightPhase | VehicleStatus
"""What streams show, as it comes."""
Answer = AbortAnswer | VehicleOrderAnswer | Pong
FromWorker = PublishedMessage | WorkerHello | Answer
ToWorker = Abort | VehicleOrder | Ping
Message = FromWorker | ToWorker


@cache
def _adapter() -> "TypeAdapter[Message]":
    """Made when something is first written or read: the processes that fly make messages and neither."""
    from pydantic import Field, TypeAdapter  # noqa: PLC0415

    return TypeAdapter(Annotated[Message, Field(discriminator="type")])


def encode(message: Message) -> bytes:
    """One line, its end included."""
    return _adapter().dump_json(message) + b"\n"


def decode(line: bytes) -> Message:
    """Raises InputError when the line is none of the messages above."""
    from pydantic import ValidationError  # noqa: PLC0415

    try:
        return _adapter().validate_json(line)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"The live link carried a line that is no message: {'.'.join(map(str, first['loc']))} {first['msg']}.",
            hint="Run the web process and the worker from the same version of Gainline.",
        ) from error
