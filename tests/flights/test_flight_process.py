"""The process that flies, with real simulated vehicles."""

import math
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import numpy as np
import pytest

from app.autopilots.registry import get_experiment
from app.common.data_folder import vehicle_lock
from app.core.clock import REAL_TIME
from app.flights.flight_loop import FlightMonitor, PipeClosedError, SimulationLoop, WorkerPipe, run_simulations
from app.flights.flight_process import FlightProcess
from app.flights.process_messages import (
    FlightFailure,
    FlightFinished,
    FlightLanded,
    FlightMessage,
    FlightRequest,
    FromVehicleProcess,
    GainsStaged,
    TakeOffDecision,
)
from app.live.messages import MAX_LINE_BYTES, FlightPhase, Telemetry, encode
from app.processes.locks import exclusive
from app.vehicles.base import FlightOptions, FlightRecord, Sample, VehicleError
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import open_vehicle
from tests.clocks import ManualClock
from tests.flights.process_ids import pid_of

GAINS: dict[str, float] = {"kp": 283, "ki": 13, "kd": 82}


def flight_of(*, kind: str = "twin", speed: float | None = None, trial_id: int = 1) -> FlightRequest:
    return FlightRequest(
        flight_id=trial_id,
        trial_id=trial_id,
        campaign_id=1,
        experiment="takeoff",
        vehicle_id=1,
        vehicle_kind=kind,
        vehicle_options={},
        safe_gains=GAINS,
        gains=GAINS,
        seed=3,
        speed=speed,
    )


def start(data_dir: Path) -> FlightProcess:
    data_dir.mkdir(exist_ok=True)
    return FlightProcess(run_simulations, data_dir, REAL_TIME, name="flight")


@pytest.fixture(scope="module")
def flight_process(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FlightProcess]:
    one = start(tmp_path_factory.mktemp("data"))
    yield one
    one.close()


def fly(
    flight_process: FlightProcess, asked: FlightRequest, on_said: Callable[[FlightMessage], None] = lambda _said: None
) -> list[FlightMessage]:
    heard: list[FlightMessage] = []

    for said in flight_process.fly(asked):
        if isinstance(said, GainsStaged):
            flight_process.decide(takes_off=True)
        heard.append(said)
        on_said(said)
    return heard


def landed_of(heard: list[FlightMessage]) -> FlightRecord:
    """What the only flight left behind."""
    (landed,) = (said for said in heard if isinstance(said, FlightLanded))
    return landed.record


def test_a_flight_in_the_process_is_the_flight_in_this_one_and_its_telemetry_covers_it(
    flight_process: FlightProcess,
) -> None:
    heard = fly(flight_process, flight_of())
    with open_vehicle("twin", {}, safe_gains=GAINS) as vehicle:
        vehicle.stage(GAINS)
        here = vehicle.fly(FlightOptions(seed=3), on_sample=lambda _: None, should_stop=lambda: None)
    record = landed_of(heard)
    assert heard[0] == GainsStaged(GAINS)
    assert record.ending == "completed"
    np.testing.assert_array_equal(record.trajectory["altitude_m"], here.trajectory["altitude_m"])
    assert [said.phase for said in heard if isinstance(said, FlightPhase)] == ["flying", "landed"]
    telemetry = [said for said in heard if isinstance(said, Telemetry)]
    rows = [row for said in telemetry for row in said.samples]
    assert [round(row[0] * 50) for row in rows] == list(range(len(rows)))
    assert rows[-1][0] == pytest.approx(33.0, abs=0.03)
    # 50 Hz telemetry against the 512 Hz record
    assert telemetry[-1].error_so_far == pytest.approx(get_experiment("takeoff").error(record.trajectory), abs=2e-4)


def test_a_flight_computed_at_once_is_sent_in_messages_that_the_live_link_takes() -> None:
    """Observed defect: a pitch flight at full speed came as one message, longer than a line of the link may be."""
    heard: list[Telemetry] = []
    monitor = FlightMonitor(flight_of(), heard.append, ManualClock())
    channels = {"altitude_m": 1.0 / 3.0, **{f"channel_{number}": 1.0 / 3.0 for number in range(10)}}
    sent = [Sample(number / 500.0, channels) for number in range(4000)]
    for sample in sent:
        monitor.sample(sample)
    monitor.flush()
    assert [row[0] for said in heard for row in said.samples] == [sample.time_s for sample in sent]
    assert max(len(encode(said)) for said in heard) < MAX_LINE_BYTES


def test_a_reference_that_is_reported_later_begins_a_message_and_is_scored_from_then_on() -> None:
    heard: list[Telemetry] = []
    steps = replace(flight_of(), experiment="altitude-steps")
    monitor = FlightMonitor(steps, heard.append, ManualClock())
    for number in range(4):
        known = {"reference_m": 2.0 + 0.1 * number} if number > 1 else {}
        monitor.sample(Sample(11.0 + number, {"altitude_m": 2.0, **known}))
    monitor.flush()
    assert all(len(row) == len(said.columns) for said in heard for row in said.samples)
    assert heard[0].error_so_far is None
    assert heard[-1].error_so_far == pytest.approx((3.0 * 0.2 + 0.25) / 4.0)


def test_an_abort_lands_the_vehicle_and_an_old_one_does_not_end_the_next_flight(flight_process: FlightProcess) -> None:
    def abort(said: FlightMessage) -> None:
        if isinstance(said, Telemetry):
            flight_process.cancel_flight(1, StopRequest("too high"))

    aborted = landed_of(fly(flight_process, flight_of(speed=1.0), abort))
    assert (aborted.ending, aborted.reason) == ("aborted", "too high")
    assert aborted.trajectory["altitude_m"][-1] < 0.1
    assert landed_of(fly(flight_process, flight_of(trial_id=2))).ending == "completed"


def test_what_the_vehicle_refuses_is_trouble_and_the_process_stays_usable(flight_process: FlightProcess) -> None:
    (trouble,) = fly(flight_process, flight_of(kind="import"))
    assert isinstance(trouble, FlightFailure)
    assert not trouble.unsafe
    assert landed_of(fly(flight_process, flight_of())).ending == "completed"


class ForgetfulPipe(WorkerPipe):
    """A real pipe whose process has no memory for the record of a flight."""

    def send(self, message: FromVehicleProcess) -> None:
        if isinstance(message, FlightLanded):
            raise MemoryError
        super().send(message)


def test_a_record_that_cannot_be_sent_is_trouble_of_its_flight_and_the_loop_goes_on(tmp_path: Path) -> None:
    here, there = Pipe()
    worker = threading.Thread(
        target=run_until_closed, args=(SimulationLoop(ForgetfulPipe(there), tmp_path, REAL_TIME),)
    )
    worker.start()
    for trial_id in (1, 2):
        here.send(flight_of(trial_id=trial_id))
        heard: list[FromVehicleProcess] = []
        while not isinstance(said := here.recv(), FlightFinished):
            heard.append(said)
            if isinstance(said, GainsStaged):
                here.send(TakeOffDecision(by_s=math.inf))
        assert [said.what for said in heard if isinstance(said, FlightFailure)] == ["Internal error (MemoryError: )."]
    here.close()
    worker.join()


def run_until_closed(loop: SimulationLoop) -> None:
    with suppress(PipeClosedError):
        loop.run()


def test_a_declined_flight_leaves_no_record(flight_process: FlightProcess) -> None:
    heard = []
    for said in flight_process.fly(flight_of()):
        heard.append(said)
        flight_process.decide(takes_off=False)
    assert heard == [GainsStaged(GAINS)]


def test_an_abort_that_overtakes_the_take_off_ends_the_flight_on_the_ground(flight_process: FlightProcess) -> None:
    heard = []
    for said in flight_process.fly(flight_of(speed=1.0)):
        heard.append(said)
        if isinstance(said, GainsStaged):
            flight_process.cancel_flight(1, StopRequest("not today"))
            flight_process.decide(takes_off=True)
    aborted = landed_of(heard)
    assert (aborted.ending, aborted.reason) == ("aborted", "not today")
    assert aborted.trajectory["altitude_m"].max() < 0.05


def test_two_simulations_in_the_air_at_once_do_not_disturb_each_other(tmp_path: Path) -> None:
    alone, together = start(tmp_path / "alone"), [start(tmp_path / "one"), start(tmp_path / "other")]
    records: dict[int, FlightRecord] = {}

    def one(number: int) -> None:
        records[number] = landed_of(fly(together[number], flight_of(kind="jsbsim")))

    threads = [threading.Thread(target=one, args=(number,)) for number in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    expected = landed_of(fly(alone, flight_of(kind="jsbsim")))
    assert len(records) == 2
    for record in records.values():
        np.testing.assert_array_equal(record.trajectory["altitude_m"], expected.trajectory["altitude_m"])
    for each in (alone, *together):
        each.close()


def test_a_process_that_is_killed_ends_its_flight_with_an_error(tmp_path: Path) -> None:
    flight_process = start(tmp_path)

    def kill(said: FlightMessage) -> None:
        if isinstance(said, Telemetry):
            os.kill(pid_of(flight_process), signal.SIGKILL)

    with pytest.raises(VehicleError, match=r"exit code -9"):
        fly(flight_process, flight_of(speed=1.0), kill)
    flight_process.close()


def test_a_vehicle_in_another_process_hands_is_flown_only_once_it_is_free(tmp_path: Path) -> None:
    """That nothing comes is seen by waiting: for a second, in which a flight with a free vehicle is over."""
    flight_process = start(tmp_path)
    heard: list[FlightMessage] = []
    with exclusive(vehicle_lock(tmp_path, "twin")):
        thread = threading.Thread(target=lambda: heard.extend(fly(flight_process, flight_of())))
        thread.start()
        thread.join(1.0)
        assert heard == []
    thread.join()
    assert landed_of(heard).ending == "completed"
    flight_process.close()
