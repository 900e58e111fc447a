"""The process that holds a vehicle and flies it for the worker: the flights, whatever the vehicle, and the simulations.

A flight has a process of its own because JSBSim holds the interpreter lock while it computes, cannot run in two threads
at once, and must not take the worker down when it crashes. The process never touches the database. When the worker
dies, the pipe between them breaks; the flight is then aborted and the vehicle left with its safe gains.
"""

import os
import select
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import numpy as np

from app.common.data_folder import vehicle_lock
from app.core.clock import REAL_TIME, Clock
from app.core.errors import GainlineError
from app.flights.process_messages import (
    CancelFlight,
    FlightFailure,
    FlightFinished,
    FlightLanded,
    FlightMessage,
    FlightRequest,
    FromVehicleProcess,
    GainsStaged,
    TakeOffDecision,
    ToVehicleProcess,
    VehicleCommand,
)
from app.live.messages import FlightPhase, Telemetry
from app.processes import ignore_stop_signals
from app.processes.locks import LockedError, exclusive
from app.vehicles.base import SafeGainsError, Sample, Vehicle, VehicleError
from app.vehicles.flight_end import Requester, StopRequest
from app.vehicles.jsbsim import prepare
from app.vehicles.registry import open_vehicle

LOCK_TIMEOUT_S: Final = 10.0
"""How long a simulation waits for another process that still holds it, such as one that is landing it after its worker
was killed."""
MESSAGES_PER_S: Final = 25
ROWS_PER_MESSAGE: Final = 500
"""Limit of the samples in one message: a simulation at full speed computes a whole flight between two messages, which
would be longer than a line of the live link may be."""


class PipeClosedError(Exception):
    """The pipe is broken: the worker has closed it or died."""


class WorkerPipe:
    """The process's end of the pipe. Once it is broken, `receive` raises; `send` and `send_if_ready` drop the
    message."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._received: deque[ToVehicleProcess] = deque()

    def receive(self, timeout_s: float | None = 0.0) -> ToVehicleProcess | None:
        """Return the next message; None when there is none within that time, s (None: any). Raises PipeClosedError."""
        return self._received.popleft() if self._received else self._read(timeout_s)

    def receive_command(self) -> VehicleCommand | None:
        """Return the next command ahead of other messages; None when there is none, or the pipe is broken."""
        with suppress(PipeClosedError):
            while (message := self._read(0.0)) is not None:
                self._received.append(message)
        found = next((each for each in self._received if isinstance(each, VehicleCommand)), None)
        if found is not None:
            self._received.remove(found)
        return found

    def _read(self, timeout_s: float | None) -> ToVehicleProcess | None:
        try:
            return self._pipe.recv() if self._pipe.poll(timeout_s) else None
        except (EOFError, OSError) as error:
            raise PipeClosedError from error

    def is_open(self) -> bool:
        """Return True while the pipe is open; discards a waiting message. Raises PipeClosedError instead of returning
        False."""
        self.receive()
        return True

    def send(self, message: FromVehicleProcess) -> None:
        with suppress(OSError):
            self._pipe.send(message)

    def send_if_ready(self, message: FromVehicleProcess) -> None:
        """Send the message unless that would block."""
        with suppress(OSError, ValueError):
            if select.select([], [self._pipe], [], 0.0)[1]:
                self._pipe.send(message)


class FlightExecution(ABC):
    """Carries out one flight after another, from staging the gains to the record, for a FlightRunner."""

    def __init__(self, clock: Clock, show: Callable[[Telemetry], None]) -> None:
        """`show` sends telemetry."""
        self._clock = clock
        self._show = show
        self._trial_id: int | None = None
        self._stop: StopRequest | None = None

    @abstractmethod
    def _next(self) -> ToVehicleProcess:
        """Wait for the runner's next message. Raises PipeClosedError."""

    @abstractmethod
    def _vehicle_for(self, request: FlightRequest) -> AbstractContextManager[Vehicle]:
        """The vehicle for one flight; however the flight ends, it is left with its safe gains, read back."""

    def fly(self, request: FlightRequest) -> Generator[FlightMessage]:
        """Carry out the flight, yielding what the runner is to know. After GainsStaged the runner answers.

        Raises PipeClosedError; any other error is a FlightFailure.
        """
        self._trial_id, self._stop = request.trial_id, None
        try:
            with self._vehicle_for(request) as vehicle:
                with self._interruptible():
                    read_back = vehicle.stage(request.gains)
                yield GainsStaged(read_back)
                if (by_s := self._await_takeoff_clearance()) is not None:
                    yield from self._take_off(vehicle, request, by_s)
        except PipeClosedError:
            raise
        except Exception as error:  # noqa: BLE001 - whatever a vehicle raises, its trial must get a definite end
            yield failure_from(error)
        finally:
            self._trial_id = None
        yield FlightFinished()

    def _interruptible(self) -> AbstractContextManager[None]:
        """Context that a command for the vehicle interrupts; a simulation gets none."""
        return nullcontext()

    def _await_takeoff_clearance(self) -> float | None:
        """Wait for the runner's decision: by when to take off, None for not at all. Raises PipeClosedError."""
        while not isinstance(answer := self._next(), TakeOffDecision):
            self._note(answer)
        return answer.by_s

    def _take_off(self, vehicle: Vehicle, request: FlightRequest, _by_s: float) -> Generator[FlightMessage]:
        monitor = FlightMonitor(request, self._show, self._clock)
        yield FlightPhase(campaign_id=request.campaign_id, trial_id=request.trial_id, phase="flying")
        record = vehicle.fly(request.options(self._clock), on_sample=monitor.sample, should_stop=self._should_stop)
        monitor.flush()
        if record.has_flown:
            yield FlightPhase(campaign_id=request.campaign_id, trial_id=request.trial_id, phase="landed")
        yield FlightLanded(record)

    def _should_stop(self) -> StopRequest | None:
        """Stop callback, called every few milliseconds in the air."""
        return self._stop

    def _note(self, message: ToVehicleProcess) -> None:
        """Note a reason to end the flight: the first one counts."""
        if isinstance(message, CancelFlight) and message.trial_id == self._trial_id:
            self._stop = self._stop or message.request


class FlightLoop(FlightExecution):
    """Carries out flights for the worker at the other end of the pipe."""

    def __init__(self, line: WorkerPipe, clock: Clock, show: Callable[[Telemetry], None]) -> None:
        super().__init__(clock, show)
        self._line = line
        self._is_worker_gone = False

    def run(self) -> None:
        """Carry out requests. Raises PipeClosedError when the worker closes the pipe or dies."""
        while True:
            self._carry_out(self._next())

    def _carry_out(self, asked: ToVehicleProcess) -> None:
        if isinstance(asked, FlightRequest):  # anything else belongs to a flight that is over
            flight = self.fly(asked)
            for message in flight:
                try:
                    self._line.send(message)
                except Exception as error:  # noqa: BLE001 - fails the flight, like an error of its vehicle
                    self._line.send(flight.throw(error))

    def _should_stop(self) -> StopRequest | None:
        """Poll the pipe, which takes microseconds."""
        try:
            while not self._is_worker_gone and (message := self._line.receive()) is not None:
                self._note(message)
        except PipeClosedError:
            self._is_worker_gone = True
            self._stop = self._stop or StopRequest(by=Requester.WORKER_EXITED)
        return self._stop


class SimulationLoop(FlightLoop):
    """Opens a simulation for each flight."""

    def __init__(self, line: WorkerPipe, data_dir: Path, clock: Clock) -> None:
        super().__init__(line, clock, line.send)
        self._data_dir = data_dir

    def _next(self) -> ToVehicleProcess:
        message = self._line.receive(timeout_s=None)
        assert message is not None
        return message

    @contextmanager
    def _vehicle_for(self, request: FlightRequest) -> Iterator[Vehicle]:
        lock = vehicle_lock(self._data_dir, request.vehicle_kind)
        with (
            hold_vehicle_lock(lock, within_s=LOCK_TIMEOUT_S, clock=self._clock),
            open_vehicle(request.vehicle_kind, request.vehicle_options, safe_gains=request.safe_gains) as vehicle,
        ):
            yield vehicle


def run_simulations(pipe: Connection, data_dir: Path, clock: Clock) -> None:
    """Main function of the process, until the worker closes the pipe or dies.

    Imports what the most common vehicle needs while it waits for the first request.
    """
    ignore_stop_signals()
    if not pipe.poll():
        with suppress(GainlineError, ImportError):  # reported by the flight that needs it
            prepare()
    try:
        SimulationLoop(WorkerPipe(pipe), data_dir, clock).run()
    except PipeClosedError:
        os._exit(0)


def failure_from(error: Exception) -> FlightFailure:
    """Build the failure message of an error, also of an internal one, so that the trial gets a definite end.

    If the error followed from a refusal to fly, the refusal comes first.
    """
    if not isinstance(error, GainlineError):
        return FlightFailure(f"Internal error ({type(error).__name__}: {error}).", unsafe=False)
    refusals = [each for each in _chain(error) if isinstance(each, VehicleError) and each.not_flown]
    what = " ".join(dict.fromkeys(str(each) for each in (*refusals, error)))
    return FlightFailure(what, unsafe=isinstance(error, SafeGainsError), not_flown=bool(refusals))


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """The error and its chain of contexts: those that were being handled when it was raised."""
    while error is not None:
        yield error
        error = error.__context__


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


class FlightMonitor:
    """Collects one flight's samples and publishes them in about 25 messages a second, with the error so far.

    The error so far is the trapezoidal mean of |set point − output| from the command to the newest sample (its integral
    where the experiment's error is one), within the time that the experiment scores. The flight's own error is computed
    from its full-rate record.
    """

    def __init__(self, request: FlightRequest, show: Callable[[Telemetry], None], clock: Clock) -> None:
        self._request = request
        self._experiment = request.configured_experiment
        self._columns: list[str] = []
        self._scored_from_s = self._experiment.scored_from_s
        self._scored_until_s = float(self._experiment.grid_s[-1])
        self._show = show
        self._clock = clock
        self._rows: list[list[float]] = []
        self._due_s = 0.0
        self._last: tuple[float, float] | None = None
        self._integral = 0.0

    def sample(self, sample: Sample) -> None:
        output = self._experiment.output
        target = self._target(sample)
        if target is not None and self._scored_from_s <= sample.time_s <= self._scored_until_s:
            deviation = abs(target - sample[output])
            before_s, before = self._last if self._last is not None else (self._scored_from_s, deviation)
            self._integral += (sample.time_s - before_s) * (before + deviation) / 2.0
            self._last = (sample.time_s, deviation)
        others = [name for name in sample.channels if name != output]
        if (columns := ["time_s", output, *others]) != self._columns:  # a vehicle may report more from some time on
            self.flush()
            self._columns = columns
        self._rows.append([sample.time_s, sample[output], *(sample[name] for name in others)])
        now_s = self._clock.now_s()
        if now_s >= self._due_s or len(self._rows) >= ROWS_PER_MESSAGE:
            self._due_s = max(self._due_s + 1.0 / MESSAGES_PER_S, now_s)
            self.flush()

    def flush(self) -> None:
        """Publish the collected samples."""
        if self._rows:
            rows, self._rows = self._rows, []
            self._show(
                Telemetry(
                    campaign_id=self._request.campaign_id,
                    trial_id=self._request.trial_id,
                    time_s=rows[-1][0],
                    columns=self._columns,
                    samples=rows,
                    error_so_far=self.error_so_far,
                )
            )

    @property
    def error_so_far(self) -> float | None:
        if self._last is None or self._last[0] <= self._scored_from_s:
            return None
        return self._integral if self._experiment.integrates else self._integral / (self._last[0] - self._scored_from_s)

    def _target(self, sample: Sample) -> float | None:
        """What the output is compared with: a channel of the sample, None if the vehicle does not send it, or the set
        point."""
        channel = self._experiment.target_channel
        if channel is not None:
            return sample.channels.get(channel)
        return float(self._experiment.set_point(np.array([sample.time_s]))[0])
