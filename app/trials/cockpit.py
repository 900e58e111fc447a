"""A process that flies: it opens one vehicle at a time, for the worker, which keeps the books.

A flight has a process of its own because JSBSim holds the interpreter's lock while it computes, cannot run on two
threads at once, and must not take the worker with it when it breaks. The process never touches the database. When the
worker dies, the pipe between them breaks: the flight is then aborted, its vehicle left with its safe gains.
"""

import os
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from app.core.errors import GainlineError
from app.core.experiments import get_experiment
from app.live.messages import FlightPhase, Telemetry
from app.locks import LockedError, exclusive
from app.trials.flying import Monitor
from app.vehicles.base import FlightOrder, FlightRecord, OptionValue, ShouldStop, Stop, Vehicle
from app.vehicles.errors import SafeGainsError, VehicleError
from app.vehicles.open import open_vehicle

CONTROL_WITHIN_S: Final = 10.0
"""How long a flight waits for another process that still has the vehicle (one whose worker was killed, landing)."""
ENDS_WITHIN_S: Final = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Orders:
    """Everything the process needs to know of one flight. `lock` is held while it has the vehicle."""

    campaign_id: int
    trial_id: int
    experiment: str
    vehicle_kind: str
    vehicle_options: Mapping[str, OptionValue]
    safe_gains: Mapping[str, float]
    gains: Mapping[str, float]
    flight: FlightOrder
    lock: Path


@dataclass(frozen=True, slots=True)
class Staged:
    """Said by the process, which then waits for TakeOff or Decline."""

    read_back: dict[str, float]


@dataclass(frozen=True, slots=True)
class TakeOff:
    """Said to the process: the gains are right and the lift-off is recorded."""


@dataclass(frozen=True, slots=True)
class Decline:
    """Said to the process: this flight does not take place."""


@dataclass(frozen=True, slots=True)
class StandDown:
    """Said to the process at any moment: end this flight now. One that was to take off ends on the ground."""

    trial_id: int
    reason: str


@dataclass(frozen=True, slots=True)
class Landed:
    """Said by the process: the flight's record."""

    record: FlightRecord


@dataclass(frozen=True, slots=True)
class Trouble:
    """Said by the process: what went wrong; `unsafe` when the safe gains could not be verified afterwards."""

    what: str
    unsafe: bool


@dataclass(frozen=True, slots=True)
class Free:
    """Said by the process: the vehicle is released, the next flight may come."""


Said = Staged | Telemetry | FlightPhase | Landed | Trouble | Free


class Cockpit:
    """The worker's handle of one such process. `stand_down` may be called from any thread and from signal handlers."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._sending = threading.Lock()
        self._process = context.Process(target=_work, args=(theirs,), name="cockpit", daemon=True)
        self._process.start()
        theirs.close()

    def fly(self, orders: Orders) -> Iterator[Said]:
        """What the process says, until it is free again; the caller answers Staged by `take_off` or `decline`.

        Raises VehicleError when the process dies.
        """
        try:
            self._send(orders)
            while not isinstance(said := self._pipe.recv(), Free):
                yield said
        except (EOFError, OSError) as error:
            self._process.join(ENDS_WITHIN_S)
            raise VehicleError(
                f"The process that flew died (exit code {self._process.exitcode}).",
                hint="Look at the vehicle. The worker's log may say more; then fly again.",
            ) from error

    def take_off(self) -> None:
        self._send(TakeOff())

    def decline(self) -> None:
        self._send(Decline())

    def stand_down(self, trial_id: int, reason: str) -> None:
        try:
            self._send(StandDown(trial_id, reason))
        except OSError:
            return  # it is dead, which whoever listens to `fly` learns

    def close(self) -> None:
        """Let the process end; it is killed when it does not."""
        self._pipe.close()
        self._process.join(ENDS_WITHIN_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _send(self, message: Orders | TakeOff | Decline | StandDown) -> None:
        with self._sending:
            self._pipe.send(message)


class Hangar:
    """Cockpits in waiting, so that a flight finds one with everything loaded. Thread-safe."""

    def __init__(self, *, spare: int = 1) -> None:
        self._spare = spare
        self._lock = threading.Lock()
        self._waiting = [Cockpit() for _ in range(spare)]

    def take(self) -> Cockpit:
        with self._lock:
            return self._waiting.pop() if self._waiting else Cockpit()

    def give_back(self, cockpit: Cockpit) -> None:
        """One that is free again; of too many, one is closed."""
        with self._lock:
            if len(self._waiting) < self._spare:
                self._waiting.append(cockpit)
                return
        cockpit.close()

    def close(self) -> None:
        with self._lock:
            waiting, self._waiting = self._waiting, []
        for cockpit in waiting:
            cockpit.close()


def _work(pipe: Connection) -> None:
    """The process: one flight after the other, until the worker closes the pipe or dies."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        while True:
            if isinstance(orders := pipe.recv(), Orders):
                _fly(pipe, orders)
                pipe.send(Free())
    except (EOFError, OSError):
        os._exit(0)


def _fly(pipe: Connection, orders: Orders) -> None:
    try:
        with (
            _control(orders),
            open_vehicle(orders.vehicle_kind, orders.vehicle_options, safe_gains=orders.safe_gains) as vehicle,
        ):
            pipe.send(Staged(vehicle.stage(orders.gains)))
            standing_down: str | None = None
            while not isinstance(answer := pipe.recv(), TakeOff | Decline):
                if isinstance(answer, StandDown) and answer.trial_id == orders.trial_id:
                    standing_down = answer.reason
            if isinstance(answer, TakeOff):
                pipe.send(Landed(_take_off(pipe, orders, vehicle, standing_down)))
    except GainlineError as error:
        pipe.send(Trouble(str(error), unsafe=isinstance(error, SafeGainsError)))
    except (EOFError, OSError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever a vehicle raises, its trial gets a truthful end
        pipe.send(Trouble(f"The program made a mistake ({type(error).__name__}: {error}).", unsafe=False))


def _take_off(pipe: Connection, orders: Orders, vehicle: Vehicle, standing_down: str | None) -> FlightRecord:
    monitor = Monitor(orders.campaign_id, orders.trial_id, get_experiment(orders.experiment), pipe.send)
    monitor.phase("flying")
    listener = _listener(pipe, orders.trial_id, standing_down)
    record = vehicle.fly(orders.flight, on_sample=monitor.sample, should_stop=listener)
    monitor.flush()
    monitor.phase("landed")
    return record


def _listener(pipe: Connection, trial_id: int, standing_down: str | None) -> ShouldStop:
    """Looks into the pipe, which takes microseconds, unless the flight is standing down already."""

    def should_stop() -> Stop | None:
        if standing_down is not None:
            return Stop(standing_down)
        try:
            while pipe.poll():
                message = pipe.recv()
                if isinstance(message, StandDown) and message.trial_id == trial_id:
                    return Stop(message.reason)
        except (EOFError, OSError):
            return Stop("the worker is gone")
        return None

    return should_stop


@contextmanager
def _control(orders: Orders) -> Iterator[None]:
    """The vehicle is this process's alone; one whose worker was killed may still be landing it."""
    deadline_s = time.monotonic() + CONTROL_WITHIN_S
    try:
        with exclusive(orders.lock, keep_waiting=lambda: time.monotonic() < deadline_s):
            yield
    except LockedError as error:
        raise VehicleError(
            f"The vehicle is still under the control of {error.holder or 'another process'}.",
            hint="Wait until that process has landed it, or end the process; then fly again.",
        ) from error
