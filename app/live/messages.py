"""Messages between the worker and the web process: one JSON object per line, distinguished by `type`; and the address
of the worker's socket, a file in the data folder, or in a short private folder when that path is too long.
"""

import hashlib
import os
import stat
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from app.core.errors import InputError
from app.vehicles.base import Condition

if TYPE_CHECKING:
    from pydantic import TypeAdapter


MAX_LINE_BYTES: Final = 256 * 1024
NO_LINK: Final = "No worker has a link to this vehicle, so nothing was sent: use its own remote control now."

Phase = Literal["staging", "staged", "flying", "landed", "ended"]
SILENT_AFTER_S: Final = 2.0
"""A vehicle that has sent nothing for this long is not ready to fly, nor is one whose process, which reports its status
five times a second, has not reported it for this long."""
VehicleLinkState = Literal["connecting", "connected", "gone", "not answering"]
VehicleCommandKind = Literal["land", "motors off"]
RequestKind = Literal["ping", "abort"] | VehicleCommandKind
UnreadyReason = Literal["", "link silent", "gains unknown"]
"""Why a vehicle on the ground is not ready, as its own process sees it: nothing was received from it for 2 s, or
the staged gains have not been read again since; or its gains are unknown, since it restarted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Telemetry:
    """Samples since the last message of this flight.

    Rows of `columns`: the first is the time since the command, s, the second the scored channel. `error_so_far` is the
    error up to `time_s`, in the experiment's unit; None until the first scored sample. `age_s` is the message's age, s,
    when it is sent again to a stream that joins late.
    """

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
    """New phase of a flight. It may be ahead of the database, which remains the record; `note` is information for a
    person."""

    campaign_id: int
    trial_id: int
    phase: Phase
    note: str = ""
    type: Literal["phase"] = "phase"


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleStatus(Condition):
    """Status of a connected vehicle; `at` is UTC in ISO 8601.

    The state is `gone` while nothing is received from the vehicle, and `not answering` while the process that has its
    link sends nothing; the other fields are then as last received, and in the latter case `trouble` explains it.
    `concern` says why the vehicle may only be observed; empty when it may fly. `age_s` as in `Telemetry`; the other
    ages are as of when the status was sent.
    """

    vehicle_id: int
    state: VehicleLinkState
    at: str
    concern: str = ""
    unready: UnreadyReason = ""
    age_s: float = 0.0
    type: Literal["vehicle"] = "vehicle"


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerHello:
    """First line from the worker to every client, which is then connected."""

    type: Literal["worker"] = "worker"


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Request to the worker, whose answer carries the same number: only to answer, which a worker that hangs does not;
    to end the flight of the trial `of` now, with the safe gains restored; or to land the vehicle `of`, or stop its
    motors at any height, now and whatever it is doing.

    Not carried out after `by_s` of this computer's monotonic clock, s; the answer then says so.
    """

    request: int
    kind: RequestKind
    of: int
    reason: str
    by_s: float
    type: Literal["request"] = "request"


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """Answer of the worker to the request of this number. `accepted` is False when it is not flying the trial of an
    abort, or when the process that has the vehicle's link has not forwarded a command, which is then not carried out
    later: `problem` says why."""

    request: int
    accepted: bool = True
    problem: str = ""
    type: Literal["answer"] = "answer"


PublishedMessage = Telemetry | FlightPhase | VehicleStatus
"""Messages that the event streams pass on unchanged."""
FromWorker = PublishedMessage | WorkerHello | Answer
Message = FromWorker | Request


@cache
def _adapter() -> "TypeAdapter[Message]":
    """The adapter, created at its first use, because the processes that fly create messages but neither encode nor
    decode them."""
    from pydantic import Field, TypeAdapter  # noqa: PLC0415

    return TypeAdapter(Annotated[Message, Field(discriminator="type")])


def encode(message: Message) -> bytes:
    """Encode a message as one line, including its end."""
    return _adapter().dump_json(message) + b"\n"


def decode(line: bytes) -> Message:
    """Decode a line. Raises InputError when it is none of the messages above."""
    from pydantic import ValidationError  # noqa: PLC0415

    try:
        return _adapter().validate_json(line)
    except ValidationError as error:
        first = error.errors()[0]
        raise InputError(
            f"The live link received an invalid message: {'.'.join(map(str, first['loc']))} {first['msg']}.",
            hint="Run the web process and the worker from the same version of Gainline.",
        ) from error


LONGEST_PATH_BYTES: Final = 100
"""Below the 104 bytes of macOS and the 108 of Linux (sockaddr_un)."""


def live_address(data_dir: Path) -> Path:
    """The socket's path for this data folder; the same in every process that uses the folder."""
    path = data_dir.resolve() / "worker.sock"
    if len(os.fsencode(path)) <= LONGEST_PATH_BYTES:
        return path
    name = hashlib.sha256(os.fsencode(path)).hexdigest()[:16]
    return _private_folder() / f"{name}.sock"


def _private_folder() -> Path:
    """A folder of this user under the system's temporary folder. Raises InputError when it is not private to this
    user."""
    folder = Path(tempfile.gettempdir()) / f"gainline-{os.getuid()}"
    if len(os.fsencode(folder)) > LONGEST_PATH_BYTES - len("/0123456789abcdef.sock"):
        folder = Path("/tmp") / folder.name  # noqa: S108 - made private and checked below
    folder.mkdir(mode=0o700, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or stat.S_IMODE(status.st_mode) & 0o077:
        raise InputError(
            f"{folder} is not a private folder of this user, so the worker cannot listen there.",
            hint="Remove it, or choose a data folder with a shorter path (--data-dir).",
        )
    return folder
