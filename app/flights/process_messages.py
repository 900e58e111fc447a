"""Messages between the worker and a process that flies a vehicle, whichever kind of process that is.

    worker    FlightRequest →             → TakeOffCommand | CancelTakeOff →
    process                   GainsStaged →   Telemetry … FlightLanded → SafeGainsRestored → FlightFinished

`CancelFlight` may come at any moment; `FlightFailure` takes the place of the messages that do not come.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from app.common.states import ActKind, FlightMode
from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.core.experiments.base import Experiment
from app.live.messages import FlightPhase, Phase, PublishedMessage, Telemetry, VehicleCommandKind, VehicleStatus
from app.processes.locks import LockedError, exclusive
from app.vehicles.base import (
    MOTORS_OFF_REQUESTED,
    CheckItem,
    FlightOptions,
    FlightRecord,
    Identity,
    OptionValue,
    SafeGainsError,
    Sample,
    VehicleError,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRequest:
    """One flight, from its row to the vehicle: all that a worker and the process that flies it need of the database.

    `speed`: how many times faster than real time a simulation flies, None for as fast as possible. A flight of mode
    `stage` waits, once its gains are read back, for its operator's take-off request.
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
    speed: float | None = None
    mode: FlightMode = "fly"

    def options(self, clock: Clock) -> FlightOptions:
        return FlightOptions(seed=self.seed, speed=self.speed, clock=clock)


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
    stated = record.reason.removeprefix(MOTORS_OFF_REQUESTED)
    asked = record.ending == "aborted" and any(stated.startswith(reason) for reason in reasons)
    return replace(record, on_request=asked)


def process_died_error(exit_code: int | None) -> VehicleError:
    return VehicleError(
        f"The flight process died (exit code {exit_code}).",
        hint="Inspect the vehicle and the worker's log, then fly again.",
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
    return FlightFailure(f"Internal error ({type(error).__name__}: {error}).", unsafe=False)


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


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionRequest:
    """What the process needs to connect to a vehicle.

    `identity` is the pinned one, None before the first connection. `keep_retrying`: retry until the vehicle answers.
    The vehicle's lock, its telemetry logs and the parameters that a trial changes are in `data_dir`.
    """

    vehicle_id: int
    name: str
    kind: str
    options: Mapping[str, OptionValue]
    safe_gains: Mapping[str, float]
    identity: Identity | None
    data_dir: Path
    keep_retrying: bool = False
    clock: Clock = REAL_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionOpened:
    """From the process: the link is open; `concern` is why the vehicle may only be observed."""

    identity: Identity
    concern: str
    held: dict[str, float]


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

    Not to be carried out after `by_s` of this computer's monotonic clock, s. The answer carries the same `number`.
    """

    number: int
    order: VehicleCommandKind
    reason: str
    by_s: float


@dataclass(frozen=True, slots=True)
class CommandForwarded:
    """From the process: a command was forwarded to the vehicle; `problem` when it could not be."""

    number: int
    order: VehicleCommandKind
    reason: str
    problem: str = ""


FromVehicleProcess = ConnectionOpened | VehicleResponse | CommandForwarded | VehicleStatus | FlightMessage
ToVehicleProcess = FlightRequest | TakeOffCommand | CancelTakeOff | CancelFlight | VehicleRequest | VehicleCommand


MESSAGES_PER_S: Final = 25

Publish = Callable[[PublishedMessage], None]


class FlightMonitor:
    """Collects one flight's samples and publishes them in at most 25 messages a second, with the error so far.

    The error so far is the trapezoidal mean of |set point − output| from the command to the newest sample (its integral
    where the experiment's error is one), within the time that the experiment scores. The flight's own error is computed
    from its full-rate record.
    """

    def __init__(
        self, campaign_id: int, trial_id: int, experiment: Experiment, publish: Publish, clock: Clock = REAL_TIME
    ) -> None:
        self._campaign_id = campaign_id
        self._trial_id = trial_id
        self._experiment = experiment
        self._columns: list[str] = []
        self._scored_until_s = float(experiment.grid_s[-1])
        self._publish = publish
        self._clock = clock
        self._rows: list[list[float]] = []
        self._due_s = 0.0
        self._last: tuple[float, float] | None = None
        self._integral = 0.0

    def phase(self, phase: Phase, note: str = "") -> None:
        self._publish(FlightPhase(campaign_id=self._campaign_id, trial_id=self._trial_id, phase=phase, note=note))

    def sample(self, sample: Sample) -> None:
        output = self._experiment.output
        set_point = float(self._experiment.set_point(np.array([sample.time_s]))[0])
        self._score(sample.time_s, abs(set_point - sample[output]))
        others = [name for name in sample.channels if name != output]
        self._columns = ["time_s", output, *others]
        self._rows.append([sample.time_s, sample[output], *(sample[name] for name in others)])
        now_s = self._clock.now_s()
        if now_s >= self._due_s:
            self._due_s = max(self._due_s + 1.0 / MESSAGES_PER_S, now_s)
            self.flush()

    def flush(self) -> None:
        """Publish the collected samples."""
        if self._rows:
            rows, self._rows = self._rows, []
            self._publish(
                Telemetry(
                    campaign_id=self._campaign_id,
                    trial_id=self._trial_id,
                    time_s=rows[-1][0],
                    columns=self._columns,
                    samples=rows,
                    error_so_far=self.error_so_far,
                )
            )

    @property
    def error_so_far(self) -> float | None:
        if self._last is None or self._last[0] <= 0.0:
            return None
        return self._integral if self._experiment.integrates else self._integral / self._last[0]

    def _score(self, time_s: float, deviation: float) -> None:
        if 0.0 <= time_s <= self._scored_until_s:
            before_s, before = self._last if self._last is not None else (0.0, deviation)
            self._integral += (time_s - before_s) * (before + deviation) / 2.0
            self._last = (time_s, deviation)
