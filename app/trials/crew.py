"""Messages between the worker and a process that flies a vehicle, whichever kind of process that is.

    worker    FlightRequest →             → TakeOffCommand | CancelTakeOff →
    process                   GainsStaged →   Telemetry … FlightLanded → SafeGainsRestored → FlightFinished

`CancelFlight` may come at any moment; `FlightFailure` takes the place of the messages that do not come.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.live.messages import FlightPhase, Telemetry
from app.processes.locks import LockedError, exclusive
from app.vehicles.base import MOTORS_OFF_ASKED, FlightOptions, FlightRecord, OptionValue
from app.vehicles.errors import SafeGainsError, VehicleError


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRequest:
    """Everything the process needs for one flight.

    `lock` is held while the process has the vehicle; `tlog` is where a vehicle that supports it logs its link.
    """

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
    """From the process, which then waits for TakeOffCommand or CancelTakeOff."""

    read_back: dict[str, float]


@dataclass(frozen=True, slots=True)
class TakeOffCommand:
    """To the process: the gains are verified and the lift-off is recorded.

    Not to be carried out after `by_s` of this computer's monotonic clock, s.
    """

    by_s: float


@dataclass(frozen=True, slots=True)
class CancelTakeOff:
    """To the process: this flight does not take place."""


@dataclass(frozen=True, slots=True)
class CancelFlight:
    """To the process, at any moment: end this flight now. A vehicle that has not taken off stays on the ground."""

    trial_id: int
    reason: str


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

    `unsafe`: the safe gains could not be verified afterwards. `not_flown`: no take-off command was sent to the vehicle.
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


class FlightBackend(Protocol):
    """The worker's handle of a process that flies. Everything but `fly` may be called from any thread."""

    @property
    def alive(self) -> bool: ...

    def fly(self, orders: FlightRequest) -> Iterator[FlightMessage]:
        """Send the request and yield the process's messages until it is free again.

        The caller answers GainsStaged by `take_off` or `cancel_take_off`. Raises VehicleError when the process dies.
        """
        ...

    def take_off(self) -> None: ...
    def cancel_take_off(self) -> None: ...
    def cancel_flight(self, trial_id: int, reason: str) -> None: ...
    def close(self) -> None:
        """Let the process end: a running flight is aborted and the vehicle left with its safe gains."""
        ...


def mark_if_requested(record: FlightRecord, reasons: Collection[str]) -> FlightRecord:
    """Return the record with `on_request` set: whether the flight was aborted for one of these reasons, which were sent
    by the worker, and not for a limit."""
    said = record.reason.removeprefix(MOTORS_OFF_ASKED)
    asked = record.ending == "aborted" and any(said.startswith(reason) for reason in reasons)
    return replace(record, on_request=asked)


def process_died_error(exit_code: int | None) -> VehicleError:
    return VehicleError(
        f"The process that flew died (exit code {exit_code}).",
        hint="Look at the vehicle. The worker's log may say more; then fly again.",
    )


def failure_from(error: GainlineError) -> FlightFailure:
    """Build the failure message of an error.

    If the error followed from a refusal to fly, the refusal comes first.
    """
    refusals = [each for each in _chain(error) if isinstance(each, VehicleError) and each.not_flown]
    what = " ".join(dict.fromkeys(str(each) for each in (*refusals, error)))
    return FlightFailure(what, unsafe=isinstance(error, SafeGainsError), not_flown=bool(refusals))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """The error and its chain of contexts: those that were being handled when it was raised."""
    while error is not None:
        yield error
        error = error.__context__


def internal_error(error: Exception) -> FlightFailure:
    """Failure message of an internal error, so that the trial gets a definite end."""
    return FlightFailure(f"The program made a mistake ({type(error).__name__}: {error}).", unsafe=False)


@contextmanager
def hold_vehicle_lock(
    lock: Path, *, within_s: float, wanted: Callable[[], bool] = lambda: True, clock: Clock = REAL_TIME
) -> Iterator[None]:
    """Hold the vehicle's lock, so that this process has the vehicle to itself.

    Another process whose worker was killed may still be landing the vehicle: waits for its lock for at most `within_s`
    seconds and while `wanted()`. Raises VehicleError when the lock is not free by then.
    """
    deadline_s = clock.now_s() + within_s
    try:
        with exclusive(lock, keep_waiting=lambda: wanted() and clock.now_s() < deadline_s, clock=clock):
            yield
    except LockedError as error:
        raise VehicleError(
            f"The vehicle is still under the control of {error.holder or 'another process'}.",
            hint="Wait until that process has landed it, or end the process; then fly again.",
        ) from error
