"""What the worker and a process that flies say to each other, whoever that process is.

    worker    FlightRequest →             → TakeOffCommand | CancelTakeOff →
    process                   GainsStaged →   Telemetry … FlightLanded → SafeGainsRestored → FlightFinished

`CancelFlight` may come at any moment; in place of what is missing comes `FlightFailure`.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.live.messages import FlightPhase, Telemetry
from app.locks import LockedError, exclusive
from app.vehicles.base import MOTORS_OFF_ASKED, FlightOptions, FlightRecord, OptionValue
from app.vehicles.errors import SafeGainsError, VehicleError


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRequest:
    """Everything the process needs to know of one flight. `lock` is held while it has the vehicle; a vehicle that can
    keeps a log of its link in `tlog`."""

    campaign_id: int
    trial_id: int
    experiment: str
    vehicle_kind: str
    vehicle_options: Mapping[str, OptionValue]
    safe_gains: Mapping[str, float]
    gains: Mapping[str, float]
    flight: FlightOptions
    lock: Path
    tlog: Path | None = None


@dataclass(frozen=True, slots=True)
class GainsStaged:
    """Said by the process, which then waits for TakeOffCommand or CancelTakeOff."""

    read_back: dict[str, float]


@dataclass(frozen=True, slots=True)
class TakeOffCommand:
    """Said to the process: the gains are right and the lift-off is recorded; not to be carried out after `by_s` of this
    computer's monotonic clock."""

    by_s: float


@dataclass(frozen=True, slots=True)
class CancelTakeOff:
    """Said to the process: this flight does not take place."""


@dataclass(frozen=True, slots=True)
class CancelFlight:
    """Said to the process at any moment: end this flight now. One that was to take off ends on the ground."""

    trial_id: int
    reason: str


@dataclass(frozen=True, slots=True)
class FlightLanded:
    """Said by the process: the flight's record."""

    record: FlightRecord


@dataclass(frozen=True, slots=True)
class SafeGainsRestored:
    """Said by the process, however the flight ended: the vehicle was given its safe gains and holds these."""

    held: dict[str, float]


@dataclass(frozen=True, slots=True)
class FlightFailure:
    """Said by the process: what went wrong; `unsafe` when the safe gains could not be verified afterwards, `not_flown`
    when the vehicle was never told to take off."""

    what: str
    unsafe: bool
    not_flown: bool = False


@dataclass(frozen=True, slots=True)
class FlightFinished:
    """Said by the process: this flight is over, the next one may come."""


FlightMessage = (
    GainsStaged | Telemetry | FlightPhase | FlightLanded | SafeGainsRestored | FlightFailure | FlightFinished
)


class FlightBackend(Protocol):
    """The worker's handle of a process that flies. Everything but `fly` may be called from any thread."""

    @property
    def alive(self) -> bool: ...

    def fly(self, orders: FlightRequest) -> Iterator[FlightMessage]:
        """What the process says, until it is free again; the caller answers Staged by `take_off` or `decline`.

        Raises VehicleError when the process dies.
        """
        ...

    def take_off(self) -> None: ...
    def cancel_take_off(self) -> None: ...
    def cancel_flight(self, trial_id: int, reason: str) -> None: ...
    def close(self) -> None:
        """Let the process end: what flies is aborted and left with its safe gains."""
        ...


def mark_if_requested(record: FlightRecord, reasons: Collection[str]) -> FlightRecord:
    """The record; it says so where the flight was broken off for one of these reasons that were given from here, and
    not for a limit."""
    said = record.reason.removeprefix(MOTORS_OFF_ASKED)
    asked = record.ending == "aborted" and any(said.startswith(reason) for reason in reasons)
    return replace(record, on_request=asked)


def process_died_error(exit_code: int | None) -> VehicleError:
    return VehicleError(
        f"The process that flew died (exit code {exit_code}).",
        hint="Look at the vehicle. The worker's log may say more; then fly again.",
    )


def failure_from(error: GainlineError) -> FlightFailure:
    """What went wrong, as the error tells it; first why it was not flown, where the error followed upon that."""
    refusals = [each for each in _chain(error) if isinstance(each, VehicleError) and each.not_flown]
    what = " ".join(dict.fromkeys(str(each) for each in (*refusals, error)))
    return FlightFailure(what, unsafe=isinstance(error, SafeGainsError), not_flown=bool(refusals))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """The error, and those that were being handled when it was raised."""
    while error is not None:
        yield error
        error = error.__context__


def internal_error(error: Exception) -> FlightFailure:
    """What the program did wrong, for a truthful end of the trial."""
    return FlightFailure(f"The program made a mistake ({type(error).__name__}: {error}).", unsafe=False)


@contextmanager
def hold_vehicle_lock(
    lock: Path, *, within_s: float, wanted: Callable[[], bool] = lambda: True, clock: Clock = REAL_TIME
) -> Iterator[None]:
    """The vehicle is this process's alone; one whose worker was killed may still be landing it, and is waited for while
    that is `wanted`. Raises VehicleError."""
    deadline_s = clock.now_s() + within_s
    try:
        with exclusive(lock, keep_waiting=lambda: wanted() and clock.now_s() < deadline_s, clock=clock):
            yield
    except LockedError as error:
        raise VehicleError(
            f"The vehicle is still under the control of {error.holder or 'another process'}.",
            hint="Wait until that process has landed it, or end the process; then fly again.",
        ) from error
