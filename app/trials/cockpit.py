"""A process that flies: it opens one vehicle at a time, for the worker, which keeps the books.

A flight has a process of its own because JSBSim holds the interpreter's lock while it computes, cannot run on two
threads at once, and must not take the worker with it when it breaks. The process never touches the database. When the
worker dies, the pipe between them breaks: the flight is then aborted, its vehicle left with its safe gains.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Final

from app.core.errors import GainlineError
from app.core.experiments import get_experiment
from app.processes import process_context
from app.trials.crew import (
    Decline,
    Free,
    Landed,
    Orders,
    Said,
    Staged,
    StandDown,
    TakeOff,
    as_asked,
    died,
    in_control,
    mistake,
    trouble,
)
from app.trials.flying import Monitor
from app.vehicles.base import FlightRecord, ShouldStop, Stop, Vehicle
from app.vehicles.jsbsim.kind import prepare
from app.vehicles.open import open_vehicle

CONTROL_WITHIN_S: Final = 10.0
"""How long a flight waits for another process that still has the vehicle (one whose worker was killed, landing)."""
ENDS_WITHIN_S: Final = 5.0


class Cockpit:
    """The worker's handle of one such process. `stand_down` may be called from any thread and from signal handlers."""

    def __init__(self) -> None:
        context = process_context()
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
            raise died(self._process.exitcode) from error

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def take_off(self) -> None:
        self._tell(TakeOff())

    def decline(self) -> None:
        self._tell(Decline())

    def stand_down(self, trial_id: int, reason: str) -> None:
        self._tell(StandDown(trial_id, reason))

    def close(self) -> None:
        """Let the process end; it is killed when it does not."""
        self._pipe.close()
        self._process.join(ENDS_WITHIN_S)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    def _tell(self, message: TakeOff | Decline | StandDown) -> None:
        with suppress(OSError):  # it is dead, which whoever listens to `fly` learns
            self._send(message)

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
    """The process: one flight after the other, until the worker closes the pipe or dies. Until the first is there, it
    loads what the usual vehicle needs."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    try:
        if not pipe.poll():
            with suppress(GainlineError, ImportError):  # a flight that needs it says so
                prepare()
        while True:
            if isinstance(orders := pipe.recv(), Orders):
                _fly(pipe, orders)
                pipe.send(Free())
    except (EOFError, OSError):
        os._exit(0)


def _fly(pipe: Connection, orders: Orders) -> None:
    try:
        with (
            in_control(orders.lock, within_s=CONTROL_WITHIN_S, clock=orders.flight.clock),
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
        pipe.send(trouble(error))
    except (EOFError, OSError):
        raise
    except Exception as error:  # noqa: BLE001 - whatever a vehicle raises, its trial gets a truthful end
        pipe.send(mistake(error))


def _take_off(pipe: Connection, orders: Orders, vehicle: Vehicle, standing_down: str | None) -> FlightRecord:
    experiment = get_experiment(orders.experiment)
    monitor = Monitor(orders.campaign_id, orders.trial_id, experiment, pipe.send, orders.flight.clock)
    monitor.phase("flying")
    asked: set[str] = set()
    listener = _listener(pipe, orders.trial_id, standing_down, asked)
    record = vehicle.fly(orders.flight, on_sample=monitor.sample, should_stop=listener)
    monitor.flush()
    monitor.phase("landed")
    return as_asked(record, asked)


def _listener(pipe: Connection, trial_id: int, standing_down: str | None, asked: set[str]) -> ShouldStop:
    """Looks into the pipe, which takes microseconds, unless the flight is standing down already; why it is to end goes
    into `asked`."""

    def should_stop() -> Stop | None:
        stop = heard()
        if stop is not None:
            asked.add(stop.reason)
        return stop

    def heard() -> Stop | None:
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
